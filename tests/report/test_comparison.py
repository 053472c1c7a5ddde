from __future__ import annotations

from dataclasses import replace

import pytest

from algid.log import ChannelReading, Reading
from algid.report.comparison import compare
from algid.results import Estimate, Result
from tests.report.folders import estimate
from tests.report.test_terminal import printed


def test_the_difference_is_over_both_standard_deviations(result: Result) -> None:
    one = result.model_copy(
        update={"parameters": {"k6": estimate(1.0, 0.3, "N m s/rad")}, "payload": {}}
    )
    two = result.model_copy(
        update={"parameters": {"k6": estimate(2.0, 0.4, "N m s/rad")}, "payload": {}}
    )
    found = compare([one, two], ["before", "after"])
    assert found.sigma["k6"][0] == pytest.approx(2.0, rel=1e-12)  # 1 over hypot(0.3, 0.4)
    assert found.largest_sigma == pytest.approx(2.0, rel=1e-12)
    assert found.estimates.rows == (
        ("k6", "N m s/rad", "1.00 ± 0.30", "2.00 ± 0.40", "+100", "+2.0"),
    )


def test_only_settings_that_differ_are_shown(result: Result) -> None:
    other = result.model_copy(
        update={"settings": {**result.settings, "window": 4.0}, "estimator": "weak"}
    )
    rows = compare([result, other], ["a", "b"]).settings.rows
    assert rows == (("estimator", "refined", "weak"), ("window", "–", "4"))
    assert (
        compare([result, result], ["a", "b"]).settings.note
        == "Every setting is the same, and every log was read the same way."
    )


READ = Reading(
    channels={"theta1": ChannelReading("q1", "deg"), "omega1": ChannelReading("v", "rad")}
)


def test_logs_that_are_read_alike_and_commands_are_no_difference(result: Result) -> None:
    """A channel is one cell, and a log that only one result has is one row."""

    def made(reading: Reading, role: str, command: str) -> Result:
        log = result.log.model_copy(update={"reading": reading, "role": "unloaded"})
        other = log.model_copy(update={"role": role, "path": f"{role}.csv"})
        settings = {**result.settings, "command": command}
        return result.model_copy(update={"log": log, "more_logs": [other], "settings": settings})

    turned = replace(
        READ,
        zero="hanging",
        channels={**READ.channels, "theta1": ChannelReading("q1", "deg", "flag", -1.0, 0.5)},
    )
    rows = compare(
        [made(READ, "loaded", "one"), made(turned, "unloaded", "another")], ["a", "b"]
    ).settings.rows
    assert rows == (
        ("unloaded log: theta1", "q1, deg", "q1, deg, times -1, +0.5"),
        ("unloaded log: zero", "horizontal", "hanging"),
        ("loaded log", "loaded.csv", "–"),
    )
    apart = compare(
        [made(READ, "unloaded", ""), made(replace(READ, channels={}), "unloaded", "")], ["a", "b"]
    ).settings.rows
    assert ("unloaded log: omega1", "v, rad/s", "–") in apart


def test_the_unit_of_results_one_below_the_other_stands_under_the_name(result: Result) -> None:
    upright = compare([result] * 3, ["a", "b", "c"]).estimates.upright
    assert upright is not None
    assert [row[0] for row in upright.rows[:6]] == ["k1", "kg m²", "", "k2", "N m", ""]
    printed_rows = printed(upright, 80)
    assert "N m s/rad" in printed_rows


def test_a_parameter_that_only_one_has_is_shown_without_a_difference(result: Result) -> None:
    paper = result.model_copy(
        update={"parameters": {"kx": Estimate(estimate=1.0, unit="kg")}, "payload": {}}
    )
    found = compare([result, paper])
    assert found.sigma["kx"] == (None,)
    assert found.sigma["k1"] == (None,)
    assert found.labels == ("1 case1-unloaded.mcap", "2 case1-unloaded.mcap")


def test_three_results_are_measured_against_the_first(result: Result) -> None:
    found = compare([result] * 3)
    assert found.sigma["k1"] == (0.0, 0.0)


def test_one_result_cannot_be_compared(result: Result) -> None:
    with pytest.raises(ValueError, match="at least two results, got 1"):
        compare([result])
    with pytest.raises(ValueError, match="must name 2 results, got 1"):
        compare([result, result], ["a"])


@pytest.mark.parametrize("count", [2, 3, 6])
def test_any_number_of_results_is_readable_in_a_pipe(result: Result, count: int) -> None:
    labels = [f"robot-{place}/2026-05-0{place}" for place in range(1, count + 1)]
    other = {**result.settings, "window": 4.0, "model": "coulomb,offset,rotor"}
    several = [result, *[result.model_copy(update={"settings": other})] * (count - 1)]
    found = compare(several, labels)
    for table in found.tables():
        text = printed(table, 80)
        cells = {cell for row in table.rows for cell in row if cell}
        for cell in [*cells, *labels]:
            assert all(word in text for word in cell.split()), cell
    k1 = found.estimates.rows[0][2]
    assert printed(found.estimates, 80).count(k1) >= count
