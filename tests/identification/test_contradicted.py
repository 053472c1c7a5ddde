"""What no result to use comes out of: gravity turned, other joints that swing, broken bounds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import algid
from algid.identification.by_likelihood import run_fit
from algid.identification.outcome import judged, outcome_of
from algid.identification.recordings import Recordings, open_source
from algid.log import Log
from algid.notices import Notice, has_code
from algid.settings import Settings
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from tests.golden.scenes import ARM, geared, log_of, times
from tests.inspection.test_checks import moving_log


@cache
def _rubbing() -> Log:
    """Gears that rub: the likelihood does not hold, and friction hides much of physics."""
    return geared()[0][0]


def _file(folder: Path, log: Log, turn: float) -> Path:
    """The log in a file, its θ1 from another zero, `turn` degrees off."""
    first = log.theta - np.radians([[turn], [0.0]])
    path = folder / "turned.csv"
    columns = np.column_stack([log.stamp_ns * 1e-9, *first, *log.tau])
    np.savetxt(path, columns, delimiter=",", header="t,theta1,theta2,tau1,tau2", comments="")
    return path


def test_gravity_that_is_turned_by_the_final_fit_fails_and_names_the_offset(
    tmp_path: Path,
) -> None:
    path = _file(tmp_path, _rubbing(), -35.0)
    found = algid.identify(path, report=False)
    assert found.verdict.failed
    wrong = next(one for one in found.notices if one.code == "WRONG_ZERO")
    offset = wrong.remedies[0].settings["offsets"][0]
    assert np.degrees(offset) == pytest.approx(-35.0, abs=3.0)
    mended = algid.identify(path, report=False, **wrong.remedies[0].settings)
    assert not mended.verdict.failed
    accepted = algid.identify(path, report=False, accept=("WRONG_ZERO",))
    assert accepted.verdict.grade == "reservations"
    assert accepted.complete
    said: list[dict[str, Any]] = [{"zero": "horizontal"}, {"offsets": (0.0, 0.0)}]
    for stated in (*said, {"theta1": {"offset": 0.0}}):
        assert not algid.identify(path, report=False, estimator="weak", **stated).verdict.failed


def test_a_base_that_is_tilted_a_little_stays_a_phase(tmp_path: Path) -> None:
    found = algid.identify(_file(tmp_path, _rubbing(), 15.0), report=False)
    assert not found.verdict.failed
    assert {"PHASES"} <= {one.code for one in found.notices}


@pytest.mark.parametrize(("reach", "fails"), [(0.4, False), (0.7, True)])
def test_other_joints_that_swing_fail_unless_they_are_accepted(
    reach: float, fails: bool, tmp_path: Path
) -> None:
    t = times(duration=3.0)
    motion = simulate(ARM.constants(), wide_multi_sine(ARM, 3), t)
    log = log_of(motion, motion.tau, 3)
    wrist = 0.5 * reach * np.sin(5 * t)
    path = tmp_path / "six.csv"
    columns = np.column_stack([t, *log.theta, wrist, *log.tau, 0 * wrist])
    names = ("shoulder", "elbow", "wrist")
    header = ["t", *(f"{name}_pos" for name in names), *(f"{name}_effort" for name in names)]
    np.savetxt(path, columns, delimiter=",", header=",".join(header), comments="")
    found = algid.identify(path, report=False, joints=("shoulder", "elbow"))
    assert "OTHER_JOINTS" in {one.code for one in found.notices}
    assert found.verdict.failed is fails
    assert found.verdict.reasons[0].code == "OTHER_JOINTS"
    accepted = algid.identify(
        path, report=False, joints=("shoulder", "elbow"), accept=("OTHER_JOINTS",)
    )
    assert accepted.verdict.grade == "reservations"
    assert accepted.complete


def test_a_broken_bound_fails_unless_it_is_accepted(tmp_path: Path) -> None:
    """Both torques the other way round: no inertia is negative."""
    log = _rubbing()
    path = _file(tmp_path, replace(log, tau=-log.tau), 0.0)
    assert algid.identify(path, report=False).verdict.failed
    accept = ("BROKEN_BOUND", "WRONG_CONVENTION")
    accepted = algid.identify(path, report=False, accept=accept)
    assert accepted.verdict.grade == "reservations"
    assert "BROKEN_BOUND" in {one.code for one in accepted.verdict.reasons}


def test_a_convention_that_is_wrong_in_several_logs_fails_with_what_mends_them() -> None:
    log = moving_log(4000)
    swapped = replace(log, theta=log.theta[::-1].copy(), tau=log.tau[::-1].copy(), omega=None)
    halves = [swapped.part(0, 2000), swapped.part(2000, 4000)]
    found = algid.identify(halves, estimator="weak", model="plain")
    (reason,) = found.verdict.reasons
    assert (found.verdict.grade, reason.code) == ("failed", "WRONG_CONVENTION")
    assert reason.remedy.settings["theta1.source"] == "theta2"


@pytest.mark.parametrize(("model", "stands"), [("auto", False), ("plain", True)])
def test_a_fit_that_chose_its_terms_has_the_last_word_on_gravity(model: str, stands: bool) -> None:
    """What one log's check says of it is passed over: a wrong zero would show in the sine parts."""
    log = open_source(moving_log(3000), "unloaded")
    log.notices += (Notice("FLIPPED_SIGN", numbers={"weight": -1.0}),)
    survey = Recordings([log])
    fit = run_fit(survey, Settings(estimator="weak", model=model))
    assert has_code(judged(outcome_of(fit), survey).notices, "FLIPPED_SIGN") is stands
