"""Torques that are cut off: counted, told and left out, and kept where that is accepted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.identification.recordings import Recordings, open_sources
from algid.inspection.channels import saturation
from algid.inspection.checks import examine, inspect_log
from algid.log import Log
from algid.notices import has_code, of_codes
from tests.inspection.test_checks import moving_log

LIMIT = 18.0


def cut_off() -> Log:
    """A log of 6,000 samples, whose sensors reach the end of their range at 18 N m."""
    log = moving_log()
    return replace(log, tau=np.clip(log.tau, -LIMIT, LIMIT))


def surveyed(log: Log) -> Recordings:
    return Recordings(open_sources(log, None))


def told(survey: Recordings) -> list[str]:
    return [one.text for one in of_codes(survey.noticed()[0], "CLIPPED_TORQUE")]


def test_samples_beyond_a_sensor_s_range_are_left_out_and_counted() -> None:
    log = cut_off()
    (limit,) = saturation(log).limits
    beyond = limit.beyond(log.tau)
    survey = surveyed(log)
    pieces = list(survey.segments(survey.logs[0]))
    assert sum(map(len, pieces)) < np.count_nonzero(~beyond)
    assert not any(limit.beyond(piece.tau).any() for piece in pieces)
    (text,) = told(survey)
    assert text.startswith(f"tau{limit.joint + 1} is cut off at 17.9")
    assert f"{np.count_nonzero(beyond):,} samples" in text
    assert survey.whole(survey.logs[0]).rows == len(log)


def test_they_are_lost_data_and_used_where_that_is_accepted() -> None:
    log = cut_off()
    found = inspect_log(log).findings
    (notice,) = of_codes(found, "CLIPPED_TORQUE")
    assert not has_code(found, "SATURATED_EFFORT")  # its limit is not true
    assert notice.lossy
    assert "--accept CLIPPED_TORQUE" in notice.advice
    reading = replace(log.origin.reading, accepted=("CLIPPED_TORQUE",))
    accepted = surveyed(replace(log, origin=replace(log.origin, reading=reading)))
    assert sum(map(len, accepted.segments(accepted.logs[0]))) == len(log)
    assert told(accepted) == []


def test_an_external_torque_is_not_judged() -> None:
    assert saturation(cut_off(), effort="external").limits == ()
    log = moving_log()
    held = replace(log, tau=np.where(np.arange(len(log)) // 1000 == 2, 0.25, log.tau))
    for effort, blamed in ((None, True), ("external", False)):
        assert has_code(examine(held, lambda: None, effort=effort), "SENSOR_FAULT") == blamed


def test_a_limit_that_the_motion_confirms_is_a_note() -> None:
    """The highest torque is one value for 3 % of the samples, by its noise alone."""
    log = moving_log()
    top = np.quantile(log.tau[0], 0.97)
    peak = log.tau[0] >= top
    # the peak as the converter of a coarse sensor has it: what the arm gets is within its step
    tau = np.vstack([np.where(peak, log.tau[0][peak].mean(), log.tau[0]), log.tau[1]])
    (found,) = of_codes(inspect_log(replace(log, tau=tau)).findings, "SATURATED_EFFORT")
    assert found.note
    assert "the motion agrees" in found.text


@pytest.mark.parametrize("limit", [4.0, 8.0, 14.0])
def test_a_limit_that_leaves_little_of_the_motion_is_confirmed_by_nothing(limit: float) -> None:
    log = moving_log()
    found = inspect_log(replace(log, tau=np.clip(log.tau, -limit, limit))).findings
    doubts = of_codes(found, "SATURATED_EFFORT")
    assert doubts
    assert not any(one.note for one in doubts)
