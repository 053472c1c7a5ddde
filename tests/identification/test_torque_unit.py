"""A unit of torque is advised where the fit shows an arm in it."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest.mock import patch

import pytest

from algid.arm import CONSTANT_NAMES
from algid.identification.identify import identify
from algid.log import ChannelReading, Log, Reading
from algid.notices import Notice
from algid.results import Result, read_result
from algid.results.verdict import again
from algid.writers import write_log
from tests.cli.commands import call
from tests.identification.test_torque_scale import CASE, CONSTANT, currents


@cache
def log_of(factor: float = 1.0, *, loaded: bool = False) -> Log:
    """A log whose torques are `factor` times those in N m."""
    log = currents(loaded=loaded)
    return replace(log, tau=factor * CONSTANT * log.tau, omega=None)


def heavy(result: Result) -> list[Notice]:
    return [one for one in result.notices if one.key == "OTHER_UNIT:heavy"]


def test_the_unit_that_is_advised_ends_in_an_answer_as_typed(tmp_path: Path) -> None:
    file, out = tmp_path / "arm.csv", tmp_path / "arm.algid"
    write_log(file, log_of(1e3))
    words = ["algid", "identify", str(file), "--no-report", "-o", str(tmp_path)]
    with patch.object(sys, "argv", words):  # the result keeps the call
        call(*words[1:])
    (asked,) = heavy(read_result(out))
    (remedy,) = asked.remedies
    done = call(*shlex.split(again(read_result(out), remedy.flags))[1:])
    assert done.code == 0, done.err
    result = read_result(out)
    assert not heavy(result)
    for name, true in zip(CONSTANT_NAMES, CASE.arm.constants(), strict=True):
        found = result.parameters[name]
        assert found.estimate is not None
        assert found.std is not None
        assert abs(found.estimate - true) < 4 * found.std


@pytest.mark.parametrize(
    ("factor", "channels"),
    [
        (1e7, {}),  # a thousandth of it is no arm either
        (1e3, {name: ChannelReading(name, "mN m", "flag", 1e-3) for name in ("tau1", "tau2")}),
        (1e3, {name: ChannelReading(name, "A", "flag", 0.1) for name in ("tau1", "tau2")}),
        (1e3, {"tau1": ChannelReading("tau1", "N m", "flag", 1.0, offset=0.1)}),
    ],
    ids=["heavier still", "read so", "currents", "offset in N m"],
)
def test_a_unit_that_leaves_no_arm_is_asked_for_and_not_advised(
    factor: float, channels: Mapping[str, ChannelReading]
) -> None:
    log = log_of(factor)
    log = replace(log, origin=replace(log.origin, reading=Reading(channels=channels)))
    (asked,) = heavy(identify(log, report=False))
    assert not asked.remedies
    assert asked.clause.endswith(": check the torque unit")


def test_a_unit_that_an_earlier_result_contradicts_is_not_advised() -> None:
    """The arm was as heavy before: the logs of both are in one unit, whichever it is."""
    earlier = identify(log_of(1e3), report=False)
    result = identify(None, log_of(1e3, loaded=True), parameters=earlier, report=False)
    assert [one.remedies for one in heavy(result)] == [()]
