"""What a rough fit and the conventions say, against closed forms and written-out words."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest

from algid.arm import Arm, inverse_dynamics
from algid.estimators.conventions import Convention
from algid.inspection.conventions import Mend, advised, is_right, judged, mend
from algid.inspection.draft import draft_profile
from algid.inspection.dynamics import DynamicFigures, dynamic_figures, gravity_findings
from algid.log import Log, Origin, Reading
from algid.profile import load_profile
from algid.readers import read_log
from algid.readers.table import CHANNELS
from tests.cli.commands import profile_from
from tests.inspection.test_checks import moving_log
from tests.readers.logs import EPOCH_NS
from tests.readers.mcaps import joint_state, write_mcap

ARM = Arm(6, 3, 0.15, 0.1, 0.3, 0.2, 0.1, 0.02, 1.5, 0.3)
K = ARM.constants()


def swung(turn: float = 0.0, gain: float = 1.0, weight: bool = True, rate: float = 400.0) -> Log:
    """Slow closed-form motion with eq. (1)'s torque.

    θ1 is read `turn` too large, the torque `gain` times.
    """
    t = np.arange(round(20 * rate)) / rate
    theta = np.stack(
        [np.sin(0.9 * t) + 0.3 * np.sin(2.3 * t), 1.1 * np.sin(1.3 * t) + 0.4 * np.cos(1.9 * t)]
    )
    omega = np.stack(
        [
            0.9 * np.cos(0.9 * t) + 0.69 * np.cos(2.3 * t),
            1.43 * np.cos(1.3 * t) - 0.76 * np.sin(1.9 * t),
        ]
    )
    alpha = np.stack(
        [
            -0.81 * np.sin(0.9 * t) - 1.587 * np.sin(2.3 * t),
            -1.859 * np.sin(1.3 * t) - 1.444 * np.cos(1.9 * t),
        ]
    )
    k = K.copy()
    if not weight:
        k[[1, 3]] = 0
    tau = gain * inverse_dynamics(k, theta, omega, alpha)
    stamps = np.rint(t * 1e9).astype(np.int64)
    return Log(stamps, theta + np.array([[turn], [0.0]]), tau, Origin("arm.csv", "csv", {}))


def figures_of(log: Log) -> DynamicFigures:
    found = dynamic_figures(log)
    assert found is not None
    return found


@pytest.mark.parametrize("rate", [100.0, 400.0])
def test_a_rough_fit_finds_the_weights_of_the_arm(rate: float) -> None:
    found = figures_of(swung(rate=rate))
    # smoothing over 90 ms takes (ω 0.09)²/24 or so of each harmonic, 0.2 % at 2.3 rad/s, of angles
    # and torques alike
    assert found.weight1 == pytest.approx(K[3], rel=2e-3)
    assert found.weight2 == pytest.approx(K[1], rel=2e-3)
    assert found.inertia == pytest.approx(K[2] + K[4], rel=0.02)
    assert found.explained > 0.9999
    assert found.turn == pytest.approx(0, abs=1)
    assert found.gravity_share > 0.1
    assert gravity_findings(found) is None


@pytest.mark.parametrize("uneven", ["gaps", "jitter"])
def test_a_rough_fit_goes_by_the_stamps(uneven: str) -> None:
    """Averaged as if they were even, the samples of these logs turn gravity by more than 2°."""
    log, rng = swung(), np.random.default_rng(6)
    if uneven == "gaps":
        kept = np.ones(len(log), dtype=bool)
        for start in rng.uniform(1, 19, 8):
            kept[(log.t > start) & (log.t < start + rng.uniform(0.05, 0.5))] = False
    else:  # a recorder that drops six samples of ten
        kept = rng.random(len(log)) > 0.6
    log = replace(log, stamp_ns=log.stamp_ns[kept], theta=log.theta[:, kept], tau=log.tau[:, kept])
    found = figures_of(log)
    assert found.turn == pytest.approx(0, abs=1)
    assert found.weight1 == pytest.approx(K[3], rel=0.01)
    assert found.explained > 0.999


def test_conventions_are_judged_over_all_stretches() -> None:
    """None of ten stretches of 1 s shows a convention by itself."""
    log = swung()
    kept = (log.t % 2.0) > 1.0
    log = replace(log, stamp_ns=log.stamp_ns[kept], theta=log.theta[:, kept], tau=log.tau[:, kept])
    assert is_right(judged(log))
    flipped = replace(log, tau=-log.tau)
    found = mend(flipped, judged(flipped))
    assert found is not None
    assert found.settings == {"tau1": {"sign": -1}, "tau2": {"sign": -1}}
    alone = log.part(0, int(np.argmax(np.diff(log.stamp_ns))) + 1)
    assert judged(alone) is None


@pytest.mark.parametrize(
    ("degrees", "told"),
    [(0, None), (30, None), (60, "WRONG_ZERO"), (-90, "WRONG_ZERO"), (170, "FLIPPED_SIGN")],
)
def test_gravity_is_found_turned_as_far_as_the_zero_is(degrees: float, told: str | None) -> None:
    """cos(θ1 read - δ) pulls where algid expects cos(θ1 read): δ of the turn."""
    found = figures_of(swung(math.radians(degrees)))
    assert math.remainder(found.turn - degrees, 360) == pytest.approx(0, abs=1.5)
    suspicion = gravity_findings(found)
    assert (None if suspicion is None else suspicion.notice.code) == told


@pytest.mark.parametrize(
    ("degrees", "gain", "settings"),
    [
        (0, -1, {"tau1.sign": -1, "tau2.sign": -1}),
        (180, 1, {"signs": [-1, -1]}),
        (90, 1, {"zero": "hanging"}),
        (-90, 1, {"zero": "upright"}),
        (90, -1, {"zero": "hanging", "tau1.sign": -1, "tau2.sign": -1}),
    ],
)
def test_inertia_tells_torques_that_are_turned_from_an_arm_seen_from_behind(
    degrees: float, gain: int, settings: dict[str, Any]
) -> None:
    log = swung(math.radians(degrees), gain=gain)
    suspicion = gravity_findings(figures_of(log))
    assert suspicion is not None
    (remedy,) = advised(log, suspicion).remedies
    assert remedy.settings == settings


def test_an_advice_that_helps_nothing_is_not_given() -> None:
    """Torques of noise: whatever the suspicion, no convention shows an arm in them."""
    log = swung()
    noise = replace(log, tau=np.random.default_rng(3).standard_normal(log.tau.shape))
    suspicion = gravity_findings(figures_of(swung(gain=-1)))
    assert suspicion is not None
    assert suspicion.guesses
    assert advised(noise, suspicion).remedies == ()
    weightless = gravity_findings(figures_of(swung(weight=False)))
    assert weightless is not None
    assert len(advised(swung(weight=False), weightless).remedies) == 2
    assert advised(noise, weightless).remedies == ()


def test_an_arm_without_weight_and_one_that_stands_still() -> None:
    found = figures_of(swung(weight=False))
    assert found.gravity_share == pytest.approx(0, abs=1e-3)
    told = gravity_findings(found)
    assert told is not None
    assert told.notice.code == "GRAVITY_COMPENSATED"
    still = replace(swung(), theta=np.zeros((2, 8000)), tau=np.zeros((2, 8000)))
    figures = figures_of(still)
    assert figures.condition == math.inf
    assert figures.seen == pytest.approx(0, abs=1e-12)
    assert gravity_findings(figures) is None


def test_noise_is_not_gravitys() -> None:
    log = swung(weight=False)
    noise = (
        np.random.default_rng(3).standard_normal(log.tau.shape)
        * 2
        * log.tau.std(axis=1, keepdims=True)
    )
    found = figures_of(replace(log, tau=log.tau + noise))
    assert 0.2 < found.explained < 0.9
    # four columns of some thousands explain one in a thousand by chance
    assert 0 <= found.gravity_share < 0.01


SURE = DynamicFigures(
    condition=10,
    explained=0.99,
    weight1=6,
    weight2=2,
    turn=0,
    gravity_share=0.5,
    seen=0.5,
    inertia=0.5,
)
LIGHT = replace(SURE, weight1=0.0, weight2=0.1, gravity_share=0.001)
UP, ASIDE = replace(SURE, turn=170), replace(SURE, turn=-90)


@pytest.mark.parametrize(
    ("figures", "code"),
    [
        (SURE, None),
        (LIGHT, "GRAVITY_COMPENSATED"),
        (replace(LIGHT, gravity_share=0.0099), "GRAVITY_COMPENSATED"),
        (replace(LIGHT, gravity_share=0.0101), None),
        (replace(LIGHT, seen=0.151), "GRAVITY_COMPENSATED"),
        (replace(LIGHT, seen=0.149), None),
        (replace(LIGHT, weight1=0.39, weight2=0.51), "GRAVITY_COMPENSATED"),  # 0.642 < 1.3 × 0.5
        (replace(LIGHT, weight1=0.39, weight2=0.53), None),  # 0.658
        (replace(LIGHT, inertia=-0.5), "GRAVITY_COMPENSATED"),
        (UP, "FLIPPED_SIGN"),
        (replace(UP, turn=-136), "FLIPPED_SIGN"),
        (replace(UP, turn=134), "WRONG_ZERO"),
        (ASIDE, "WRONG_ZERO"),
        (replace(ASIDE, turn=46), "WRONG_ZERO"),
        (replace(ASIDE, turn=44), None),
        (replace(UP, seen=0.014), None),
        (replace(UP, seen=0.016), "FLIPPED_SIGN"),
        (replace(ASIDE, gravity_share=0.019), None),
        (replace(ASIDE, gravity_share=0.021), "WRONG_ZERO"),
        (replace(ASIDE, explained=0.5, gravity_share=0.049), None),
        (replace(ASIDE, explained=0.5, gravity_share=0.051), "WRONG_ZERO"),
        # a sound arm of links that spin at 200 rad/s, of `make false-alarms`
        (replace(ASIDE, turn=-104, explained=0.398, gravity_share=0.0226, seen=0.77), None),
        (replace(UP, condition=1.1e6), None),
        (replace(UP, condition=0.9e6), "FLIPPED_SIGN"),
        (replace(UP, explained=0.29), None),
        (replace(UP, explained=0.31), "FLIPPED_SIGN"),
    ],
)
def test_each_limit_of_what_is_said_of_gravity(figures: DynamicFigures, code: str | None) -> None:
    suspicion = gravity_findings(figures)
    assert (None if suspicion is None else suspicion.notice.code) == code


def judgement(
    convention: Convention, *, broken: dict[str, float] | None = None, alone: bool = True
) -> Any:
    """What a log may say: that `convention` is the right one, and what the one that it was read by
    breaks.
    """
    as_read = SimpleNamespace(broken=broken or {}, left=np.array([0.123, 0.456]))
    return SimpleNamespace(
        as_read=as_read,
        best=SimpleNamespace(convention=convention, left=np.array([0.001, 0.0123])),
        alone=alone,
    )


def read_by(reading: Reading | None = None, mapping: dict[str, str] | None = None) -> Log:
    log = moving_log(10)
    return replace(
        log, origin=Origin("arm.csv", "csv", mapping or {}, reading=reading or Reading())
    )


def mended(convention: Convention, reading: Reading | None = None) -> Mend:
    found = mend(read_by(reading), judgement(convention))
    assert found is not None
    return found


DEGREES = 180 / math.pi
HALF = math.pi / 2
TORQUES_SWAPPED = '--set tau1.source="tau2" --set tau2.source="tau1"'


@pytest.mark.parametrize(
    ("convention", "words", "flags"),
    [
        (Convention(signs=(-1, 1)), "the sign of θ1 is wrong", "--set theta1.sign=-1"),
        (Convention(torque_signs=(1, -1)), "the sign of τ2 is wrong", "--set tau2.sign=-1"),
        (
            Convention(signs=(1, -1), torque_signs=(1, -1)),
            "joint 2 counts the other way round",
            "--set signs=[1, -1]",
        ),
        (
            Convention(swapped=True, torques_swapped=True),
            "the joints are swapped",
            f'--set theta1.source="theta2" --set theta2.source="theta1" {TORQUES_SWAPPED}',
        ),
        (
            Convention(torques_swapped=True),
            "the torques of the joints are swapped",
            TORQUES_SWAPPED,
        ),
        (
            Convention(swapped=True),
            "the angles of the joints are swapped",
            '--set theta1.source="theta2" --set theta2.source="theta1"',
        ),
        (
            Convention(absolute=True),
            "θ2 counts from the horizontal or the vertical, not from link 1",
            "--second-angle absolute",
        ),
        (Convention(base=True), "the second motor stands at the base", "--set drive=base"),
        (Convention(scale=(DEGREES, 1.0)), "θ1 is in degrees", "--set theta1.unit=deg"),
        (Convention(scale=(1.0, 1 / (2 * math.pi))), "θ2 is in turns", "--set theta2.unit=rev"),
        (
            Convention(scale=(1.0, 7.00001)),
            "θ2 is the motor's angle, 7 times the joint's",
            "--set theta2.gear_ratio=7.00001",
        ),
        (Convention(zero=(-HALF, 0.0)), "θ1 is zero hanging straight down", "--zero hanging"),
        (Convention(zero=(HALF, 0.0)), "θ1 is zero upright", "--zero upright"),
        (
            Convention(zero=(0.0, HALF)),
            "the zero of θ2 is off by 90°",
            "--set offsets=[0.0, 1.5708]",
        ),
        (
            Convention(zero=(0.2, -0.3)),
            "the zero of θ1 is off by 11.46° and the zero of θ2 is off by -17.19°",
            "--set offsets=[0.2, -0.3]",
        ),
    ],
)
def test_what_is_wrong_is_said_in_words_and_in_flags_that_are_taken(
    convention: Convention, words: str, flags: str
) -> None:
    found = mended(convention)
    assert found.words == words
    assert " ".join(found.remedy.flags) == flags
    assert found.another == (convention.zero != (0.2, -0.3))  # below 45° a phase
    pairs = zip(found.remedy.flags[::2], found.remedy.flags[1::2], strict=True)
    given: dict[str, Any] = {"set": []}
    for flag, text in pairs:
        if flag == "--set":
            given["set"].append(text)
        else:
            given[flag.removeprefix("--").replace("-", "_")] = text
    profile = profile_from(given)
    assert profile is not None
    plain = profile.model_dump(exclude_unset=True)
    assert {
        name: [*value] if isinstance(value, tuple) else value for name, value in plain.items()
    } == found.settings


def test_what_contradicts_is_the_worst_that_is_broken() -> None:
    broken = {"k1 > 0": -5.4, "k3 > 0": -60.2, "k5 > 0": -7.0}
    found = mend(read_by(), judgement(Convention(base=True), broken=broken))
    assert found is not None
    assert found.contradiction == "k3 > 0 is broken by 60 σ"
    unexplained = mended(Convention(base=True)).contradiction
    assert unexplained == "45.6 % of a torque stays unexplained, 1.2 % otherwise"


NAMES = ("q\U0001f600", 'say "hi"', "back\\slash", "bell\x7f", "θ₁ rad")


@pytest.mark.parametrize("name", NAMES)
def test_a_flag_takes_a_column_whatever_it_is_called(name: str, tmp_path: Path) -> None:
    log = moving_log(200)
    rows = {
        "t": log.t,
        name: log.theta[0],
        "q2": log.theta[1],
        "tau1": log.tau[0],
        "tau2": log.tau[1],
    }
    pl.DataFrame(rows).write_parquet(tmp_path / "arm.parquet")
    profile = profile_from({"set": [f"theta1.source={name}", "theta2.source=q2"]})
    assert profile is not None
    assert profile.theta1.source == name
    assert np.array_equal(read_log(tmp_path / "arm.parquet", profile).theta, log.theta)


@pytest.mark.parametrize("name", NAMES)
def test_a_draft_reads_its_log_whatever_its_joints_are_called(name: str, tmp_path: Path) -> None:
    """TOML has no halves of characters, as JSON has."""
    stamps = [EPOCH_NS + step * 1_000_000 for step in range(10)]
    states = [joint_state(one, [name, "elbow"], [1, 2], [], [3, 4]).done() for one in stamps]
    write_mcap(
        tmp_path / "arm.mcap", [(f"/{name}", *one) for one in zip(stamps, states, strict=True)]
    )
    text = draft_profile(tmp_path / "arm.mcap")
    content = tomllib.loads(text)
    assert (content["topic"], content["joints"]) == (f"/{name}", [name, "elbow"])
    (tmp_path / "algid.toml").write_text(text, encoding="utf-8")
    found = read_log(tmp_path / "arm.mcap", load_profile(tmp_path / "algid.toml"))
    assert found.origin.mapping["theta1"] == f"/{name}: position[{name}]"


def test_a_draft_of_a_log_that_cannot_be_read_says_why_and_names_what_is_there(
    tmp_path: Path,
) -> None:
    (tmp_path / "arm.csv").write_text("when,angle \u200ba,angle b\n0,1,2\n1,2,3\n")
    text = draft_profile(tmp_path / "arm.csv")
    assert tomllib.loads(text) == {name: {} for name in CHANNELS}
    assert text.splitlines()[13].startswith("# ")
    assert str(tmp_path / "arm.csv") in text
    assert "# in the log: angle \ufffda (int64)" in text
    assert '# source = "NAME"' in text
