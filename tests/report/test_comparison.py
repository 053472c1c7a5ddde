from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import OutputError
from algid.base.significance import NORMAL
from algid.log import ChannelReading, Reading
from algid.report.comparison import Comparison, compare, verdict, write_comparison
from algid.results import Estimate, Result
from tests.report.folders import estimate
from tests.report.pages import Page, typed
from tests.report.test_terminal import printed


def test_intervals_are_those_of_identify_and_the_difference_is_over_both(result: Result) -> None:
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
        ("k6", "before", "1.00 ± 0.59", "N m s/rad", "–", "–"),
        ("k6", "after", "2.00 ± 0.78", "N m s/rad", "+2.0", "+100"),
    )


def test_students_intervals_make_a_difference_smaller(result: Result) -> None:
    """Two estimates of one number, half intervals h apart by √2 h: chance alone at 5 %."""
    wide = estimate(1.0, 0.1, "N m s/rad").model_copy(update={"ci95": (0.7, 1.3)})
    off = wide.model_copy(
        update={"estimate": 1.0 + 0.3 * 2**0.5, "ci95": (0.7 + 0.3 * 2**0.5, 1.3 + 0.3 * 2**0.5)}
    )
    one, two = (result.model_copy(update={"parameters": {"k6": k6}}) for k6 in (wide, off))
    assert compare([one, two]).sigma["k6"][0] == pytest.approx(NORMAL, rel=1e-12)


def test_only_settings_that_differ_are_shown(result: Result) -> None:
    other = result.model_copy(
        update={"settings": {**result.settings, "window": 4.0}, "estimator": "weak"}
    )
    rows = compare([result, other], ["a", "b"]).settings.rows
    assert rows == (
        ("estimator", "a", "refined"), ("estimator", "b", "weak"),
        ("window", "a", "–"), ("window", "b", "4"),
    )  # fmt: skip
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
        ("unloaded log: theta1", "a", "q1, deg"),
        ("unloaded log: theta1", "b", "q1, deg, times -1, +0.5"),
        ("unloaded log: zero", "a", "horizontal"),
        ("unloaded log: zero", "b", "hanging"),
        ("loaded log", "a", "loaded.csv"),
        ("loaded log", "b", "–"),
    )
    apart = compare(
        [made(READ, "unloaded", ""), made(replace(READ, channels={}), "unloaded", "")], ["a", "b"]
    ).settings.rows
    assert ("unloaded log: omega1", "a", "v, rad/s") in apart
    assert ("unloaded log: omega1", "b", "–") in apart


def test_a_parameter_that_only_one_has_is_shown_without_a_difference(result: Result) -> None:
    paper = result.model_copy(
        update={"parameters": {"kx": Estimate(estimate=1.0, unit="kg")}, "payload": {}}
    )
    found = compare([result, paper])
    assert found.sigma["kx"] == (None,)
    assert found.sigma["k1"] == (None,)
    assert found.labels == ("1 case1-unloaded.mcap", "2 case1-unloaded.mcap")


def test_json_has_every_number_and_every_setting_that_differs(result: Result) -> None:
    other = result.model_copy(update={"estimator": "weak", "payload": {}})
    content = json.loads(compare([result, other], ["a", "b"]).as_json())
    k1 = result.parameters["k1"]
    assert content["labels"] == ["a", "b"]
    assert content["parameters"]["k1"] == {
        "estimate": [k1.estimate] * 2, "std": [k1.std] * 2,
        "ci95": [list(k1.ci95 or ())] * 2, "sigma": [None, 0.0],
    }  # fmt: skip
    assert content["parameters"]["m_p"]["estimate"][1] is None
    assert content["settings"] == {"estimator": ["refined", "weak"]}


def apart(result: Result, *sigmas: float) -> Comparison:
    """Results whose k1 and, by a hair less, k2 lie so many combined σ from the first one's."""
    several = [result]
    for sigma in sigmas:
        moved = dict(result.parameters)
        for name, far in (("k1", sigma), ("k2", (1 - 1e-9) * sigma)):
            one = moved[name]
            assert one.estimate is not None
            assert one.std is not None
            off = one.estimate + far * np.sqrt(2) * one.std
            moved[name] = one.model_copy(update={"estimate": off})
        several.append(result.model_copy(update={"parameters": moved}))
    return compare(several, [f"<{place}>" for place in range(len(several))])


def test_the_page_draws_each_distance_beside_what_chance_explains(
    result: Result, tmp_path: Path
) -> None:
    found = apart(result, 1.0, -5.0)
    path = tmp_path / "compare.html"
    write_comparison(found, path, force=False)
    with pytest.raises(OutputError):
        write_comparison(found, path, force=False)
    page = Page(path.read_text(encoding="utf-8"))
    first, second = page.figures["distances"]["data"]
    assert first["y"][:2] == ["k1", "k2"]
    assert typed(first["x"])[:3] == pytest.approx([1.0, 1.0, 0.0])
    assert typed(second["x"])[:2] == pytest.approx([-5.0, -5.0])
    assert first["marker"]["symbol"] != second["marker"]["symbol"]
    assert first["name"] == "&lt;1&gt;"
    layout = page.figures["distances"]["layout"]
    assert layout["xaxis"]["range"] == pytest.approx([-5.5, 5.5])
    assert layout["shapes"][0]["x1"] == -layout["shapes"][0]["x0"] == pytest.approx(1.96, abs=1e-3)
    assert "Estimates side by side" in page.tables
    assert "<1>" not in page.prose


def test_the_verdict_names_what_chance_does_not_explain(result: Result) -> None:
    far = verdict(apart(result, 1.0, -5.0))
    assert far.grade == "reservations"
    assert far.headline.startswith(
        "k1 of <2> (-5.0 σ) and k2 of <2> (-5.0 σ) differ by more than 3"
    )
    near = verdict(apart(result, 1.0))
    assert near.grade == "good"
    assert near.headline == "9 of 9 differences within 1.96 σ; the largest is k1 of <1> (+1.0 σ)"
    bare = result.model_copy(update={"payload": {}, "parameters": {}})
    assert verdict(compare([bare, result])).headline == "no parameter has error bars in two results"


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
