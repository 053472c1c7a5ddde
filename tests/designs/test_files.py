"""What a design's files hold, of a design made up for it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from algid import __version__
from algid.arm import FloatArray
from algid.designs.belief import Belief, Objective
from algid.designs.campaign import Campaign, Design
from algid.designs.information import Experiment
from algid.designs.limits import Limits, Row, Usage
from algid.designs.write import Planned
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import NoiseLevels
from algid.model import Model, Motion
from algid.notices import Notice

RATE, COUNT = 120.0, 61
T = np.arange(COUNT) / RATE
MEAN = np.array([0.05, 1.0, 0.03, 4.0, 0.2, 0.3, 0.0])


def moved(shift: float) -> Motion:
    wave = np.stack([np.sin(3 * T + shift), np.cos(2 * T + shift)])
    return Motion(wave, wave + 1, wave + 2)


def made_up(*, loaded: tuple[bool, ...] = (False, True)) -> Design:
    shared = Shared(Model())
    asked = Objective(np.maximum(MEAN, 0.1), MEAN > 0, np.array([True] * 6 + [False]))
    limits = Limits(
        low=np.array([-np.inf, -1.0]),
        high=np.array([np.inf, 3.0]),
        speed=np.array([2.0, np.inf]),
        acceleration=np.full(2, np.inf),
        torque=np.array([5.0, 2.5]),
        height=-np.inf,
        lengths=np.array([0.4, 0.3]),
    )
    noise = NoiseLevels(np.array([1e-3, 2e-3]), np.array([1e-2, 3e-2]))
    campaign = Campaign(
        experiment=Experiment(shared, (2, 1), noise, RATE),
        belief=Belief(shared, MEAN, np.diag(0.1 * np.maximum(MEAN, 0.1)), box=False),
        limits=limits,
        asked=asked,
        duration=0.5,
        margin=0.1,
        seed=3,
    )
    torque: dict[bool, FloatArray] = {one: np.stack([T + one, T - one]) for one in loaded}
    rows = (
        Row("range", 1, -1.0, 1.0, upper=False),
        Row("speed", 0, 2.0),
        Row("torque", 0, -5.0, upper=False, loaded=True),
    )
    return Design(
        campaign=campaign,
        t=T,
        motion=moved(0.0),
        torque=torque,
        std=0.02 * np.maximum(MEAN, 0.1) * np.array([1, 2, 3, 40, 5, 6, 7]),
        worst=0.1 * np.ones(7),
        shares=np.tile([0.25, 0.123456], (7, 1)),
        usage=Usage(rows, np.array([[0.1, 0.5], [0.2, 0.9], [-0.4, 0.7]])),
        interrupted=True,
    )


def test_the_json_holds_what_decides_and_what_is_predicted() -> None:
    one = made_up()
    doubts = (Notice("DOUBT", "something"),)
    text = Planned(one, "arm.algid", "algid design arm.algid", ("a", "b"), doubts).as_json()
    assert text.endswith("}\n")
    content = json.loads(text)
    assert content["version"] == __version__
    assert (content["prior"], content["command"]) == ("arm.algid", "algid design arm.algid")
    assert (content["drive"], content["duration"], content["rate"], content["seed"]) == (
        "position",
        0.5,
        RATE,
        3,
    )
    assert content["runs"] == {"unloaded": 2, "loaded": 1}
    assert content["interrupted"] is True
    assert content["noise"] == {"theta1": 1e-3, "theta2": 2e-3, "tau1": 1e-2, "tau2": 3e-2}
    assert content["gravity"] == 9.81
    assert content["limits"] == {
        "range": [[None, -1.0], [None, 3.0]],
        "speed": [2.0, None],
        "acceleration": [None, None],
        "torque": [5.0, 2.5],
        "tip_height": None,
        "margin": 0.1,
    }
    assert [
        (row["limit"], row["joint"], row["loaded"], row["share"]) for row in content["used"]
    ] == [
        ("speed", 1, None, 0.9),
        ("torque", 1, True, 0.7),
        ("range", 2, None, 0.5),
    ]
    # a share of the distance from the middle, 1, to the lower end, -1; of the speed; of the
    # torque, the other way
    expected = [(2.0, 1.8), (-5.0, -3.5), (-1.0, 0.0)]
    np.testing.assert_allclose([(row["allowed"], row["most"]) for row in content["used"]], expected)
    assert content["start"] == one.motion.theta[:, 0].tolist()
    assert content["joints"] == ["a", "b"]
    assert content["verdict"]["grade"] == "reservations"
    assert "something" in [reason["text"] for reason in content["verdict"]["reasons"]]
    k4, k7 = content["parameters"]["k4"], content["parameters"]["k7"]
    assert (k4["believed"], k4["unit"], k4["asked"]) == (4.0, "N m", True)
    np.testing.assert_allclose(
        [k4["believed_std"], k4["std"], k4["relative"], k4["worst_std"]], [0.4, 3.2, 0.8, 0.1]
    )
    assert k4["information_by_second"] == [0.25, 0.1235]
    assert (k7["relative"], k7["asked"]) == (None, False)  # what is zero has no relative error
    assert content["largest_relative_bound"] == pytest.approx(0.8)
