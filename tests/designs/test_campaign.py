"""A whole campaign, small: limits, files, rehearsal, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from algid import __version__
from algid.arm import inverse_dynamics
from algid.base.errors import AlgidError
from algid.designs.belief import objective_of
from algid.designs.campaign import Campaign, Planned, plan
from algid.designs.information import Experiment
from algid.designs.limits import limits_of, request
from algid.designs.prior import PriorKnowledge, prior_of
from algid.designs.write import design_json, verdict
from algid.estimators.whitening import NoiseLevels
from algid.notices import Notice
from algid.readers import read_log
from tests.cli.commands import app
from tests.report.pages import Page, typed

NOISE = NoiseLevels(np.full(2, 1e-3), np.full(2, 1e-2))
FLAGS: dict[str, str | float | None] = {
    "range": "1.2",
    "speed": "3",
    "torque": "1.9,0.95",
    "acceleration": "40",
    "tip_height": -0.27,
}
LIMITS = [
    "--range",
    "1.2",
    "--speed",
    "3",
    "--torque",
    "1.9,0.95",
    "--set",
    "acceleration=40",
    "--set",
    "tip_height=-0.27",
]
SENSORS = ["--position-noise", "1e-3", "--torque-noise", "1e-2"]
DURATION = 2.0


@pytest.fixture(scope="module", autouse=True)
def one_start() -> Iterator[None]:
    """A short search: what it finds is good enough to be judged here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("algid.designs.search.STARTS", 1)
        yield


def campaign(names: list[str] | None = None) -> Campaign:
    prior = prior_of("case1", None, PriorKnowledge())
    return Campaign(
        experiment=Experiment(prior.belief.shared, (1, 1), NOISE, 500.0),
        belief=prior.belief,
        limits=limits_of(request(None, FLAGS), prior.lengths),
        asked=objective_of(prior.belief, names, "case1"),
        duration=DURATION,
    )


@pytest.fixture(scope="module")
def design() -> Planned:
    return plan(campaign())


def test_no_limit_breaks_for_any_arm_that_is_believed_possible(design: Planned) -> None:
    limits, motion, belief = design.campaign.limits, design.motion, design.campaign.belief
    away = motion.theta - limits.middle[:, None]
    for name, values in {
        "range": away,
        "speed": motion.omega,
        "acceleration": motion.alpha,
    }.items():
        assert np.all(np.abs(values) <= limits.allowed[name][:, None])
    heights = 0.1626 * np.sin(motion.theta[0]) + 0.1232 * np.sin(motion.theta.sum(axis=0))
    assert heights.min() >= -0.27
    for arm in belief.draws(100, seed=123):
        for loaded in (False, True):
            k = belief.shared.coefficients(arm, loaded)
            torque = inverse_dynamics(k, motion.theta, motion.omega, motion.alpha)
            assert np.all(np.abs(torque) <= limits.allowed["torque"][:, None])


def test_what_is_asked_for_is_what_becomes_certain(design: Planned) -> None:
    payload = plan(campaign(["m_p"]))
    place = design.names.index("m_p")
    assert payload.relative[place] < 0.9 * design.relative[place]
    assert payload.largest == payload.relative[place]
    assert "m_p is the least certain" in verdict(payload).headline
    (lost,) = verdict(replace(payload, std=1e3 * payload.std)).reasons
    assert "no motion within the limits determines m_p: widen" in str(lost)


def test_the_json_holds_what_decides_and_what_is_predicted(design: Planned) -> None:
    limits = design.campaign.limits
    allowed = {**limits.allowed, "acceleration": np.full(2, np.inf)}
    limits = replace(limits, allowed=allowed, height=-np.inf)
    asked = replace(design.campaign.asked, known=np.arange(10) != 6)
    decided_by = replace(
        design.campaign,
        limits=limits,
        asked=asked,
        source="arm.algid",
        doubts=(Notice("DOUBT", "something"),),
        joints=("a", "b"),
        command="algid design arm.algid",
    )
    content = json.loads(design_json(replace(design, campaign=decided_by)))
    decided = {
        "prior": "arm.algid", "command": "algid design arm.algid", "drive": "position",
        "duration": 2.0, "rate": 500.0, "seed": 0, "gravity": 9.81,
        "version": __version__, "schema_version": 2, "joints": ["a", "b"],
        "runs": {"unloaded": 1, "loaded": 1},
        "noise": {"theta1": 1e-3, "theta2": 1e-3, "tau1": 1e-2, "tau2": 1e-2},
        "start": design.motion.theta[:, 0].tolist(),
    }  # fmt: skip
    assert {name: content[name] for name in decided} == decided
    told = content["limits"]
    np.testing.assert_allclose(told["range"], [[-np.pi / 2 - 1.2, -1.2], [1.2 - np.pi / 2, 1.2]])
    assert (told["speed"], told["torque"]) == ([3.0, 3.0], [1.9, 0.95])
    assert (told["acceleration"], told["tip_height"]) == ([None, None], None)
    shares = [row["share"] for row in content["used"]]
    assert shares == sorted(shares, reverse=True)
    for row in (one for one in content["used"] if one["limit"] == "speed"):
        own = design.motion.omega[row["joint"] - 1]
        assert row["most"] == pytest.approx(own.max() if row["most"] > 0 else own.min())
        assert row["share"] == pytest.approx(row["most"] / row["allowed"])
    assert content["verdict"]["grade"] == "reservations"
    assert "something" in [reason["text"] for reason in content["verdict"]["reasons"]]
    k4, believed = content["parameters"]["k4"], design.campaign.belief
    known = {
        "believed": believed.mean[3], "believed_std": believed.std[3], "std": design.std[3],
        "relative": design.relative[3], "worst_std": design.worst[3], "unit": "N m", "asked": True,
        "information_by_second": design.shares[3].round(4).tolist(),
    }  # fmt: skip
    assert {name: k4[name] for name in known} == known
    assert content["parameters"]["k7"]["relative"] is None  # what is zero has no relative error
    assert content["largest_relative_bound"] == max(design.relative)


def run(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["design", *arguments])
    if isinstance(done.exception, AlgidError):  # the entry point prints it and exits with 2
        return 2, str(done.exception)
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("designs")
    code, text = run(
        "case1",
        *LIMITS,
        *SENSORS,
        "--duration",
        "2",
        "--rate",
        "500",
        "--joints",
        "a,b",
        "-o",
        str(out),
        "--format",
        "json",
    )
    assert code == 0, text
    plain, _, wrote = text.partition("\nwrote ")
    assert wrote == f"{out / 'case1.design'}\n"
    assert json.loads(plain) == json.loads((out / "case1.design/design.json").read_text())
    return out / "case1.design"


def test_the_folder_holds_the_trajectory_in_every_form(folder: Path) -> None:
    table = pl.read_csv(folder / "trajectory.csv")
    assert table.equals(pl.read_parquet(folder / "trajectory.parquet"))
    assert table.height == 1001
    for name in ("trajectory.csv", "trajectory.mcap"):
        log = read_log(folder / name)
        np.testing.assert_allclose(log.theta[0], table["theta1"], atol=1e-12)
        np.testing.assert_allclose(log.tau[1], table["tau2"], atol=1e-12)
        assert log.omega is not None
    motion = [
        table.select(f"{name}1", f"{name}2").to_numpy().T for name in ("theta", "omega", "alpha")
    ]
    k = prior_of("case1", None, PriorKnowledge()).belief.load(True).c
    loaded = table.select("loaded_tau1", "loaded_tau2").to_numpy().T
    np.testing.assert_allclose(inverse_dynamics(k, *motion), loaded, atol=1e-9)


def test_the_page_says_what_the_json_holds_and_draws_the_trajectory(folder: Path) -> None:
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    told = json.loads((folder / "design.json").read_text(encoding="utf-8"))
    bounds, limits = page.tables["Predicted standard deviations"], page.tables["Active limits"]
    heads = "Parameter|Believed|Predicted ±|Unit|± %|Requested|Worst arm ± %"
    assert "|".join(bounds[0]) == heads
    assert "|".join(limits[0]) == "Limit|Used|Allowed|%|Active|Unit|Tightest"
    for row, (name, one) in zip(bounds[1], told["parameters"].items(), strict=True):
        assert (row[0], row[3].replace("²", "^2"), row[5]) == (name, one["unit"], "yes")
        worst = 100 * one["worst_std"] / one["believed"]
        wanted = one["believed"], one["std"], 100 * one["relative"], worst
        found = [float(row[place]) for place in (1, 2, 4, 6)]
        np.testing.assert_allclose(found, wanted, rtol=0.05)  # two digits
    used = dict[str, Any]()
    for one in told["used"]:
        sides = told["limits"][one["limit"].replace("-", "_")]
        if one["joint"]:
            own = np.array(sides)[..., one["joint"] - 1]
            sides = own if own.size == 2 else [-own, own]
        assert np.abs(np.subtract(sides, one["allowed"])).min() < 1e-9
        load = {None: "", True: ", loaded", False: ", unloaded"}[one["loaded"]]
        used.setdefault(one["limit"].replace("-", " ") + load, one)
    units = {"range": "rad", "speed": "rad/s", "acceleration": "rad/s²", "tip height": "m"}
    for row, (kind, one) in zip(limits[1], used.items(), strict=True):
        way = "up" if one["allowed"] > 0 else "down"
        place = f"joint {one['joint']}, {way}" if one["joint"] else "–"
        active = "yes" if one["share"] >= 0.98 * 0.95 else ""
        assert (row[0], row[4], row[6]) == (kind, active, place)
        assert row[5] == units.get(kind, "N m")
        found = [float(cell.replace("−", "-")) for cell in row[1:4]]
        np.testing.assert_allclose(
            found, [one["most"], one["allowed"], 100 * one["share"]], rtol=1e-3
        )
    least = max(told["parameters"], key=lambda name: told["parameters"][name]["relative"])
    for words in (
        f"{least} is the least certain", ">Numbers<", ">Information by time<",
        "active limit: {0} of {6} ({3} %)".format(*limits[1][0]),
        "1 unloaded run and 1 loaded run together", "the worst of 20 drawn", "A margin of 5.0 %",
        "2.000 s under position control · logged at 500.0 Hz · prior case1",
        "is the space around the arm free?", "payload of 0.35", "the red one its limit",
        "a planned identification",
    ):  # fmt: skip
        assert words in page.text
    table = pl.read_csv(folder / "trajectory.csv")
    drawn = page.figures["motion"]
    names = ["t"]
    for name in ("theta", "omega", "alpha", "tau", "loaded_tau"):
        names += f"{name}1", f"{name}2"
    assert table.columns == names
    for trace, name in zip(drawn["data"], names[1:5] + names[7:], strict=True):
        np.testing.assert_allclose(typed(trace["x"]), np.arange(1001) / 500, rtol=1e-5)
        np.testing.assert_allclose(typed(trace["y"]), table[name], rtol=1e-5, atol=1e-6)
    lines = [shape["y0"] for shape in drawn["layout"]["shapes"]]
    sides = [*np.transpose(told["limits"]["range"]), [-3, 3], [-3, 3]]
    sides += 2 * [[-1.9, 1.9], [-0.95, 0.95]]
    np.testing.assert_allclose(lines, np.ravel(sides))


def test_the_joint_trajectory_is_what_a_controller_takes(folder: Path) -> None:
    from ruamel.yaml import YAML

    message = YAML(typ="safe").load((folder / "joint_trajectory.yaml").read_text(encoding="utf-8"))
    assert message["joint_names"] == ["a", "b"]
    table = pl.read_csv(folder / "trajectory.csv")
    times = [
        p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"]
        for p in message["points"]
    ]
    assert np.all(np.diff(times) > 0)
    assert times[-1] == 2.0
    rows = np.round(np.array(times) * 500).astype(int)
    for field, name in (
        ("positions", "theta"),
        ("velocities", "omega"),
        ("accelerations", "alpha"),
    ):
        values = np.array([point[field] for point in message["points"]])
        np.testing.assert_allclose(
            values, table[rows].select(f"{name}1", f"{name}2").to_numpy(), atol=1e-8
        )


def test_the_campaign_can_be_rehearsed(folder: Path, tmp_path: Path) -> None:
    arguments = [
        "synth",
        "case1",
        "--motion",
        str(folder),
        "--rate",
        "500",
        "-o",
        str(tmp_path),
        *SENSORS,
    ]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    plan_of = pl.read_csv(folder / "trajectory.csv")
    for role in ("unloaded", "loaded"):
        log = read_log(tmp_path / f"case1-{role}.mcap")
        assert len(log) == 1001
        # the true arm is the believed one: what is left is the sensors' noise
        error = log.theta[0] - plan_of["theta1"].to_numpy()
        assert np.sqrt(np.mean(error**2)) == pytest.approx(1e-3, rel=0.1)


REFUSED = [
    (["case1", *SENSORS, "--speed", "3", "--torque", "2"], "--range: it must be given"),
    (["case1", *LIMITS], "--position-noise: case1 does not tell"),
    (["case1", *SENSORS, *LIMITS, "--range=-60:60,-60:60"], "from 1e-06 to 6.283, or inf"),
    (
        ["case1", *SENSORS, *LIMITS, "--range=-0.2:0.2,-0.1:0.1", "--torque", "0.2,0.2"],
        "--torque: even at rest, wherever within --range, torque, loaded of joint 1",
    ),
    (
        ["case1", *SENSORS, *LIMITS, "--set", "tip_height=0.1"],
        "--set tip_height: even at rest, wherever within --range, tip height, takes",
    ),
    (
        ["case1", *SENSORS, *LIMITS, "--set", "tip_height=5"],
        "--set tip_height: expected less than the arm's reach",
    ),
    (["case1", *SENSORS, *LIMITS, "--for", "k1, k9"], "--for k9: expected some of k1"),
    (["case1", *SENSORS, *LIMITS, "--runs", "1,0", "--for", "m_p"], "there are no loaded runs"),
    (["case1", *SENSORS, *LIMITS, "--joints", "one"], "tuple should have at least 2 items"),
    (["nocase", *SENSORS, *LIMITS], "no such case"),
    (
        ["case1", *SENSORS, "--range", "inf", "--speed", "inf", "--torque", "inf"],
        "--range: without any limit no motion is the best",
    ),
]


@pytest.mark.parametrize(("arguments", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_what_makes_no_sense_is_refused_in_one_line(
    arguments: list[str], words: str, tmp_path: Path
) -> None:
    code, text = run(*arguments, "-o", str(tmp_path))
    assert code == 2
    assert words in text
    assert "\n" not in text
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_rate_at_which_noise_hides_the_torque_is_refused(tmp_path: Path) -> None:
    code, text = run(
        *("case1", *LIMITS, *SENSORS, "--rate", "1e5", "--duration", "0.5", "-o", str(tmp_path))
    )
    assert code == 2
    assert text.startswith("--rate: at 100000 Hz the noise of the angles, differentiated")
    assert "\n" not in text
    assert list(tmp_path.iterdir()) == []
