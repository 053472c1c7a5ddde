from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import OutputError
from algid.log import ChannelReading, Reading
from algid.report.comparison import Comparison, compare, verdict, write_comparison
from algid.results import Estimate, Result
from tests.report.folders import estimate
from tests.report.pages import Page, typed


def with_k6(result: Result, one: Estimate) -> Result:
    return result.model_copy(update={"parameters": {"k6": one}, "payload": {}})


def test_a_difference_is_over_both_intervals(result: Result) -> None:
    one, two = estimate(1.0, 0.3, "N m s/rad"), estimate(2.0, 0.4, "N m s/rad")
    found = compare([with_k6(result, one), with_k6(result, two)], ["before", "after"])
    assert found.sigma[1, 0] == pytest.approx(2.0, rel=1e-12)  # 1 over hypot(0.3, 0.4)
    assert found.largest_sigma == pytest.approx(2.0, rel=1e-12)
    assert found.tables()[0].rows == [
        ("k6", "before", "1.00 ± 0.59", "–", "N m s/rad", "OK", "0"),
        ("k6", "after", "2.00 ± 0.78", "+2.0", "N m s/rad", "OK", "100"),
    ]
    content = json.loads(found.as_json())
    assert content["parameters"]["k6"]["estimate"] == [1.0, 2.0]
    assert content["parameters"]["k6"]["sigma"] == [None, pytest.approx(2.0)]


def test_only_what_was_set_or_read_otherwise_is_shown(result: Result) -> None:
    channels = {"theta1": ChannelReading("q1", "deg"), "tau1": ChannelReading("i", "A")}
    read = Reading(channels=channels)
    turned = replace(read, channels=channels | {"theta1": ChannelReading("q1", "rad", "flag")})

    def made(reading: Reading, **settings: object) -> Result:
        log = result.log.model_copy(update={"reading": reading})
        update = {"log": log, "settings": {**result.settings, **settings}}
        return result.model_copy(update=update)

    several = [made(read, command="a"), made(turned, command="b", window=4.0)]
    several[1] = several[1].model_copy(update={"estimator": "weak"})
    found = compare(several, ["a", "b"])
    assert found.settings == {
        "window": ["–", "4.0"],
        "estimator": ["refined", "weak"],
        "unloaded log.channels.theta1.unit": ["deg", "rad"],
    }
    assert [row[0] for row in found.tables()[1].rows] == [
        name for name in found.settings for _ in several
    ]
    assert compare([result, result], ["a", "b"]).tables()[1].note.startswith("Every setting")


def test_logs_that_a_result_does_not_have_are_not_read_otherwise(result: Result) -> None:
    def beside(*units: str) -> Result:
        loaded = [
            result.log.model_copy(
                update={
                    "role": "loaded",
                    "reading": Reading(channels={"tau1": ChannelReading("i", unit)}),
                }
            )
            for unit in units
        ]
        return result.model_copy(update={"more_logs": loaded})

    assert compare([beside("A"), beside()], ["a", "b"]).settings == {}
    differ = compare([beside("A"), beside(), beside("mA")], ["a", "b", "c"]).settings
    assert differ == {"loaded log.channels.tau1.unit": ["A", "–", "mA"]}


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
    (chance,) = page.figures["distances"]["layout"]["shapes"]
    assert [chance["x0"], chance["x1"]] == pytest.approx([-1.96, 1.96], abs=1e-3)
    assert typed(first["x"])[:3] == pytest.approx([1.0, 1.0, 0.0])
    assert typed(second["x"])[:2] == pytest.approx([-5.0, -5.0])
    assert first["marker"]["symbol"] != second["marker"]["symbol"]
    assert first["name"] == "&lt;1&gt;"
    assert "Estimates side by side" in page.tables
    assert "<1>" not in page.prose


def test_the_verdict_names_the_largest_and_whether_chance_explains_it(result: Result) -> None:
    far, near = verdict(apart(result, 1.0, -5.0)), verdict(apart(result, 1.0))
    assert far.grade == "reservations"
    assert far.headline == "the largest of 18 differences is k1 of <2> (-5.0 σ)"
    assert near.grade == "good"
    assert near.headline == "the largest of 9 differences is k1 of <1> (+1.0 σ)"
