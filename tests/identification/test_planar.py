"""Planar arms in general: centres of mass off the links' lines, payloads that are bodies."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.notices import of_codes
from algid.settings import Settings
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.planar import PAYLOAD, Row, drawn, scene
from tests.golden.scenes import ARM, log_of, times
from tests.golden.scenes import PAYLOAD as CARRIED
from tests.intervals import distances

CHANCE = 4.5  # standard deviations: once in 150 000


POINT = CARRIED, ARM.l2, 0.0, 0.0


def moved(constants: FloatArray, seed: int, fastest: float = 8.0) -> Log:
    """A log of the paper's first arm with these constants, under a wide torque."""
    frequency = tuple(np.geomspace(0.3, fastest, 6).tolist())
    torque = replace(wide_multi_sine(ARM, seed), frequency=(frequency, frequency))
    motion = simulate(constants, torque, times())
    return log_of(motion, motion.tau, seed)


@pytest.mark.parametrize(
    ("name", "share"),
    [*product(("l1", "l2"), (0.95, 1.03)), ("l1", 1.09), ("l2", 0.91), ("l2", 1.0)],
)
def test_a_wrong_length_is_named_and_no_estimate_rests_on_it(name: str, share: float) -> None:
    """Held, it may refute the likelihood, or an inertia of the payload takes up what it lacks.

    It moves the constants, and with them what they say of the right length and of the arm.
    """
    logs = moved(ARM.phasors(), 1, 2.0), moved(ARM.phasors(*POINT), 2, 2.0)
    lengths = {"l1": ARM.l1, "l2": ARM.l2}
    given = lengths | {name: share * lengths[name]}
    result = identify(*logs, Settings.model_validate(given), report=False)
    wrong = of_codes(result.notices, "LENGTH_CONTRADICTED")
    named = [one.numbers["name"] for one in wrong]
    assert named == [name] * (share != 1)
    assert all("all estimates are without given lengths" in one.text for one in wrong)
    assert not of_codes(result.notices, "LOGS_APART")
    assert result.verdict.failed is bool(named)
    truth = dict(zip(CONSTANT_NAMES, ARM.phasors(), strict=False)) | {"m_p": CARRIED}
    if named:
        truth |= lengths
    else:
        assert not set(lengths) & set(result.payload)
    assert np.abs(distances(result, truth.values(), list(truth))).max() < CHANCE


def test_a_log_with_a_payload_among_unloaded_ones_is_named() -> None:
    """Of two logs nobody knows which is odd."""
    bare, other = (moved(ARM.phasors(), seed) for seed in (1, 2))
    burdened = moved(ARM.phasors(*POINT), 3)
    for logs, case, names in (
        ([bare, burdened], "unlike", ["run 1", "run 3"]),
        ([bare, burdened, other], "odd", ["run 3"]),
    ):
        result = identify(logs, report=False)
        (one,) = of_codes(result.notices, "LOGS_APART")
        assert (one.numbers["case"], one.numbers["names"]) == (case, names)
        assert result.verdict.failed is (case == "unlike")
    assert not identify([bare, other], report=False).notices


def test_a_payload_off_the_line_of_a_straight_arm_is_found() -> None:
    x, y, J = 0.9 * ARM.l2, 0.3 * ARM.l2, 2e-4
    logs = moved(ARM.phasors(), 1), moved(ARM.phasors(CARRIED, x, y, J), 2)
    result = identify(*logs, report=False)
    assert result.fit.model.terms == ["phases"]
    assert result.fit.intervals == "likelihood"  # not refuted
    truth = {"m_p": CARRIED, "l1": ARM.l1, "l2": x, "y_p": y, "J_p": J, "k1s": 0.0}
    assert np.abs(distances(result, truth.values(), list(truth))).max() < CHANCE


def test_an_offset_is_not_taken_for_an_inertia_where_both_would_make_that_negative() -> None:
    """Of one parameter of the body the likelier counts, not the one that has more of its own
    errors.
    """
    row = Row(10.0, 0.0, 20.0)
    result = drawn("arm21", row, 0)
    truth = dict(zip(PAYLOAD, scene("arm21", row)[1].tolist(), strict=True))
    assert "J_p" not in result.estimates
    names = ("m_p", "l1", "l2", "y_p")
    assert np.abs(distances(result, [truth[name] for name in names], names)).max() < CHANCE


def test_phases_are_a_note_of_what_they_mean_and_no_accusation() -> None:
    off1, off2, bent1, bent2 = np.radians([4.0, -3.0, 8.0, 12.0])
    arm = replace(ARM, delta1=float(bent1), delta2=float(bent2))
    log = moved(arm.phasors(), 3)
    log = replace(log, theta=log.theta - np.array([[off1], [off2]]))
    result = identify(log, report=False)
    assert result.verdict.grade == "good"
    (note,) = result.notices
    assert note.code == "PHASES"
    K1, K4 = arm.phasors()[[0, 3]] + 1j * arm.phasors()[[7, 9]]
    for name, true in (
        ("first", off1),
        ("load", np.angle(K4)),
        ("second", np.angle(K1) + off2),
    ):
        value, half = (float(one) for one in note.numbers[name].replace("°", "").split(" ± "))
        assert 0 < half < 1.5
        assert abs(value - np.degrees(true)) < 2.2 * half, name


def test_a_large_payload_on_a_bent_arm_is_no_other_convention() -> None:
    """Three phases of their own look like a motor at the base, to conventions that have
    two zeros.
    """
    result = drawn("arm23", Row(30.0, 0.15, 20.0), 0)
    assert result.verdict.grade == "good"
    assert "WRONG_CONVENTION" not in {one.code for one in result.notices}
