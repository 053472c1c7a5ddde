"""What the conventions say, against closed forms and written-out words."""

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

from algid.api.inspect import draft_profile
from algid.estimators.conventions import AS_READ, Convention
from algid.inspection.checks import inspect_log
from algid.inspection.conventions import judged, mend, mends, recorded
from algid.inspection.figures import dynamic_figures
from algid.log import Log, Origin, Reading
from algid.notices import Notice, Remedy
from algid.profile import Profile, load_profile, with_settings
from algid.readers import read_log
from algid.readers.table import CHANNELS, JOINT_CHANNELS
from tests.cli.commands import profile_from
from tests.inspection.test_checks import K, moving_log, noticed
from tests.readers.logs import EPOCH_NS, noise_log
from tests.readers.mcaps import ANY, write_mcap
from tests.readers.ways import States, sent, written


def test_conventions_are_judged_over_all_stretches() -> None:
    """None of ten stretches of 1 s shows a convention by itself."""
    log = moving_log(20_000)
    kept = (log.t % 2.0) > 1.0
    log = Log(log.stamp_ns[kept], log.theta[:, kept], log.tau[:, kept], log.origin)
    right = judged(log)
    assert right is not None
    assert (right.alone, right.best.convention) == (True, AS_READ)
    flipped = replace(log, tau=-log.tau)
    found = mend(flipped.origin, judged(flipped))
    assert found is not None
    assert found.remedies[0].settings == {"tau1.sign": -1, "tau2.sign": -1}
    alone = log.part(0, int(np.argmax(np.diff(log.stamp_ns))) + 1)
    assert judged(alone) is None


def test_logs_of_one_arm_are_judged_together_and_where_they_disagree_alone() -> None:
    right = moving_log()
    wrong = replace(right, tau=-right.tau)
    right_parts, wrong_parts = ((one.origin, recorded(one)) for one in (right, wrong))
    for logs, mended in (((wrong_parts, wrong_parts), [True, True]),
                         ((right_parts, wrong_parts), [False, True])):  # fmt: skip
        found = mends(logs)
        assert [one is not None for one in found] == mended
        assert all(
            one.remedies[0].settings == {"tau1.sign": -1, "tau2.sign": -1} for one in found if one
        )


CONVENTIONAL = {"FLIPPED_SIGN", "WRONG_ZERO", "GRAVITY_COMPENSATED", "WRONG_CONVENTION"}
SLOW = moving_log(20_000, 0.05)
"""It tells where gravity pulls, and hardly more."""


@pytest.mark.parametrize(
    ("degrees", "gain", "code", "settings"),
    [
        (0, 1, None, {}),
        (30, 1, None, {}),
        (0, -1, "FLIPPED_SIGN", {"tau1.sign": -1, "tau2.sign": -1}),
        (180, 1, "FLIPPED_SIGN", {"signs": [-1, -1]}),
        (90, 1, "WRONG_ZERO", {"zero": "hanging"}),
        (-90, 1, "WRONG_ZERO", {"zero": "upright"}),
        (90, -1, "WRONG_ZERO", {"zero": "hanging", "tau1.sign": -1, "tau2.sign": -1}),
        (70, 1, "WRONG_ZERO", {"offsets": pytest.approx([math.radians(-70), 0], abs=0.01)}),
    ],
)
def test_a_slow_log_tells_where_gravity_pulls(
    degrees: float, gain: int, code: str | None, settings: dict[str, Any]
) -> None:
    turned = SLOW.theta + np.array([[math.radians(degrees)], [0.0]])
    log = replace(SLOW, theta=turned, tau=gain * SLOW.tau, omega=None)
    found = {one.code: one for one in noticed(log)}
    assert found.keys() & CONVENTIONAL == ({code} if code else set())
    if code:
        assert found[code].remedies[0].settings == settings
        turn = found[code].numbers.get("turn", degrees)
        assert turn == pytest.approx(degrees, abs=0.5)


def test_torques_without_weight_and_of_noise() -> None:
    light = moving_log(20_000, 0.5, np.where([0, 1, 0, 1, 0, 0, 0], 0.0, K))
    (found,) = [one for one in noticed(light) if one.code in CONVENTIONAL]
    assert found.code == "GRAVITY_COMPENSATED"
    driver = "for such a driver: --effort gravity-compensated"
    assert found.advice == f"{driver}; for a horizontal plane: --gravity 0"
    # slow and reversed it leaves open what is wrong, and is not called weightless
    slow = moving_log(20_000, 0.1, np.where([0, 1, 0, 1, 0, 0, 0], 0.0, K))
    assert not CONVENTIONAL & {one.code for one in noticed(replace(slow, tau=-slow.tau))}
    noise = replace(light, tau=np.random.default_rng(3).standard_normal(light.tau.shape))
    assert not CONVENTIONAL & {one.code for one in noticed(noise)}


def test_figures_of_a_log_are_those_of_its_arm() -> None:
    log = moving_log()
    found = dynamic_figures(judged(log))
    assert found is not None
    assert (found.weight1, found.weight2) == pytest.approx((K[3], K[1]), rel=2e-3)
    assert found.inertia == pytest.approx(K[2] + K[4], rel=0.02)
    assert found.explained == pytest.approx(1, abs=1e-4)
    assert 1 < found.condition < 100


def judgement(
    convention: Convention, *, broken: dict[str, float] | None = None, alone: bool = True
) -> Any:
    """What a log may say: that `convention` is the right one, and what the one that it was read by
    breaks.
    """
    as_read = SimpleNamespace(
        broken=broken or {}, left=np.array([0.123, 0.456]), constants={"k4": 1.0}
    )
    return SimpleNamespace(
        as_read=as_read,
        best=SimpleNamespace(
            convention=convention,
            family=replace(convention, zero=(0.0, 0.0)),
            zero=convention.zero,
            left=np.array([0.001, 0.0123]),
        ),
        alone=alone,
    )


def read_by(reading: Reading | None = None) -> Origin:
    return Origin("arm.csv", "csv", {}, reading=reading or Reading())


def mended(convention: Convention, reading: Reading | None = None) -> Notice:
    found = mend(read_by(reading), judgement(convention))
    assert found is not None
    return found


DEGREES = 180 / math.pi
HALF = math.pi / 2
ANGLES_SWAPPED = '--set theta1.source="theta2" --set theta2.source="theta1"'
TORQUES_SWAPPED = '--set tau1.source="tau2" --set tau2.source="tau1"'


@pytest.mark.parametrize(
    ("convention", "flags"),
    [
        (Convention(signs=(-1, 1)), "--set theta1.sign=-1"),
        (Convention(torque_signs=(1, -1)), "--set tau2.sign=-1"),
        (Convention(signs=(1, -1), torque_signs=(1, -1)), "--set signs=[1, -1]"),
        (Convention(swapped=True, torques_swapped=True), f"{ANGLES_SWAPPED} {TORQUES_SWAPPED}"),
        (Convention(torques_swapped=True), TORQUES_SWAPPED),
        (Convention(swapped=True), ANGLES_SWAPPED),
        (Convention(absolute=1), "--second-angle absolute"),
        (
            Convention(absolute=1, zero=(0.5, 0.25)),
            "--second-angle absolute --set offsets=[0.5, 0.75]",
        ),
        (Convention(base=1), "--set drive=base"),
        (Convention(scale=(DEGREES, 1.0)), "--set theta1.unit=deg"),
        (Convention(scale=(1.0, 1 / (2 * math.pi))), "--set theta2.unit=rev"),
        (Convention(scale=(1.0, 7.00001)), "--set theta2.gear_ratio=7.00001"),
        (Convention(zero=(-HALF, 0.0)), "--zero hanging"),
        (Convention(zero=(HALF, 0.0)), "--zero upright"),
        (Convention(zero=(0.0, HALF)), "--set offsets=[0.0, 1.5708]"),
        (Convention(zero=(0.0, 4.0)), "--set offsets=[0.0, -2.28319]"),
    ],
)
def test_what_is_wrong_is_said_by_the_flags_that_mend_it(
    convention: Convention, flags: str
) -> None:
    found = mended(convention)
    assert " ".join(found.remedies[0].flags) == flags
    assert found.numbers["wrong"] == list(found.remedies[0].settings)


def test_what_contradicts_is_the_worst_that_is_broken() -> None:
    broken = {"k1 > 0": -5.4, "k3 > 0": -60.2, "k5 > 0": -7.0}
    found = mend(read_by(), judgement(Convention(base=1), broken=broken))
    assert found is not None
    assert found.numbers["contradiction"] == "k3 > 0 is broken by 60 σ"
    unexplained = mended(Convention(base=1)).numbers["contradiction"]
    assert unexplained == "45.6 % of a torque stays unexplained, 1.2 % otherwise"


NAMES = ("q\U0001f600", 'say "hi"', "back\\slash", "bell\x7f", "θ₁ rad")


@pytest.mark.parametrize("name", NAMES)
def test_a_flag_takes_a_column_whatever_it_is_called(name: str) -> None:
    log = moving_log(200)
    columns = ("t", name, "q2", "tau1", "tau2")
    frame = pl.DataFrame(dict(zip(columns, (log.t, *log.theta, *log.tau), strict=True)))
    flags = Remedy({"theta1.source": name, "theta2.source": "q2"}).flags
    profile = profile_from({"set": [*flags[1::2]]})  # each behind its --set
    assert profile is not None
    assert profile.theta1.source == name
    assert np.array_equal(read_log(frame, profile).theta, log.theta)


@pytest.mark.parametrize("name", NAMES)
def test_a_draft_reads_its_log_whatever_its_joints_are_called(name: str, tmp_path: Path) -> None:
    """TOML has no halves of characters, as JSON has."""
    states = sent(noise_log(10), name=[name, "elbow"], topic=f"/{name}")
    path = written("cdr", tmp_path, States(states))
    text = draft_profile(inspect_log(path))
    content = tomllib.loads(text)
    assert (content["topic"], content["joints"]) == (f"/{name}", [name, "elbow"])
    (tmp_path / "algid.toml").write_text(text, encoding="utf-8")
    found = read_log(path, load_profile(tmp_path / "algid.toml"))
    assert found.origin.mapping["theta1"] == f"/{name}: position[{name}]"
    assert "STATED_UNUSED" not in {notice.code for notice in found.notices}


def test_a_draft_reads_signals_of_several_topics_whatever_these_are_called(tmp_path: Path) -> None:
    texts = {"enc": b'{"q":[1,2]}', "a: b": b'{"tau":[3,4]}'}
    messages = [(one, EPOCH_NS + step * 10**6, texts[one]) for step in range(9) for one in texts]
    write_mcap(tmp_path / "arm.mcap", messages, ANY)
    own: dict[str, Any] = {"topic": "enc", "tau1.topic": "a: b", "tau2.topic": "a: b"}
    for name, place in zip(JOINT_CHANNELS, ("q[0]", "q[1]", "tau[0]", "tau[1]"), strict=True):
        own[f"{name}.source"] = place
    given = with_settings(Profile(), own)
    (tmp_path / "algid.toml").write_text(draft_profile(inspect_log(tmp_path / "arm.mcap", given)))
    found = read_log(tmp_path / "arm.mcap", load_profile(tmp_path / "algid.toml"))
    assert (found.theta[:, 0].tolist(), found.tau[:, 0].tolist()) == ([1, 2], [3, 4])


def test_a_draft_of_a_log_that_cannot_be_read_says_why_and_names_what_is_there(
    tmp_path: Path,
) -> None:
    (tmp_path / "arm.csv").write_text("when,angle \u200ba,angle b\n0,1,2\n1,2,3\n")
    text = draft_profile(inspect_log(tmp_path / "arm.csv"))
    assert tomllib.loads(text) == {name: {} for name in CHANNELS}
    assert text.splitlines()[13].startswith("# ")
    assert str(tmp_path / "arm.csv") in text
    assert "# in the log: angle \\u200ba (int64)" in text
    assert '# source = "NAME"' in text
