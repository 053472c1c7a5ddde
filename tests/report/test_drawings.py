"""Small drawings in tables: every point where its number is."""

from __future__ import annotations

import re

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.report.drawings import (
    SPARK_EDGE,
    SPARK_HEIGHT,
    SPARK_WIDTH,
    Course,
    bars,
    forest,
    sparklines,
)
from algid.results import Estimate


def points(drawing: str, kind: str) -> FloatArray:
    found = re.search(rf'class="{kind}" points="([^"]*)"', drawing)
    assert found is not None
    return np.array([[float(part) for part in pair.split(",")] for pair in found[1].split()])


def course(values: list[float], half: float, marked: bool = False, first: float = 0.0) -> Course:
    t = first + np.arange(len(values), dtype=np.float64)
    return Course(
        t, np.array(values), np.full(len(values), half), f"{values[0]} to {values[-1]}", marked
    )


def test_courses_share_one_scale_of_time_and_of_change() -> None:
    drawn = sparklines(
        {"a": course([1.0, 2.0, 3.0], 0.5), "b": course([10.0, 10.0], 0.75, first=1.0)}
    )
    # the 0.9 quantile of two rows: 0.75, and a change of 1 with its band
    reach = 0.1 * 0.75 + 0.9 * 1.5
    pixels = (SPARK_HEIGHT / 2 - SPARK_EDGE) / reach
    line = points(drawn["a"], "course")
    np.testing.assert_allclose(line[:, 0], [SPARK_EDGE, SPARK_WIDTH / 2, SPARK_WIDTH - SPARK_EDGE])
    np.testing.assert_allclose(
        line[:, 1], SPARK_HEIGHT / 2 - np.array([-1.0, 0.0, 1.0]) * pixels, atol=0.051
    )
    band = points(drawn["a"], "band")
    upper, lower = band[:3], band[:2:-1]
    np.testing.assert_allclose(upper[:, 0], lower[:, 0])
    # clipped at the frame
    np.testing.assert_allclose(lower[:, 1] - upper[:, 1], [2 * 0.5 * pixels] * 3, atol=0.9)
    np.testing.assert_allclose(
        points(drawn["b"], "course"), [[SPARK_WIDTH / 2, 12.0], [SPARK_WIDTH - SPARK_EDGE, 12.0]]
    )
    last = re.search(r'class="last" cx="([\d.]+)" cy="([\d.]+)"', drawn["a"])
    assert last is not None
    assert (float(last[1]), float(last[2])) == pytest.approx(tuple(line[-1]))


def test_a_marked_course_fits_the_frame_and_a_wild_one_does_not_flatten_the_rest() -> None:
    steady = {f"r{place}": course([1.0, 1.1, 1.0, 1.1], 0.01) for place in range(20)}
    wild = course([1.0, 50.0, 1.0, 1.0], 0.1)
    for marked in (False, True):
        drawn = sparklines(
            {**steady, "wild": Course(wild.t, wild.value, wild.half, wild.says, marked)}
        )
        height = float(np.ptp(points(drawn["r0"], "course")[:, 1]))
        assert (height < 1.0) is marked
        assert ('class="spark marked"' in drawn["wild"]) is marked
        inside = points(drawn["wild"], "course")[:, 1]
        assert inside.min() >= 0
        assert inside.max() <= SPARK_HEIGHT


def test_a_lone_value_has_its_band_as_a_bar_and_nothing_is_drawn_of_nothing() -> None:
    drawn = sparklines({"lone": course([2.0], 0.5), "none": course([1.0], 0.1, first=5.0)})
    np.testing.assert_allclose(np.ptp(points(drawn["lone"], "band"), axis=0)[0], 2.0)
    empty = Course(np.empty(0), np.empty(0), np.empty(0), "")
    assert sparklines({"a": empty}) == {}
    # no change at all: no division by it
    assert set(sparklines({"a": empty, "b": course([1.0, 1.0], 0.0)})) == {"b"}


def test_what_a_drawing_says_is_text() -> None:
    nasty = '"><script>'
    says = Course(np.arange(2.0), np.arange(2.0), np.zeros(2), nasty)
    estimate = Estimate(estimate=1.0, std=0.1, ci95=(0.8, 1.2), unit="m")
    for drawing in (*sparklines({nasty: says}).values(), *bars({nasty: 1.0}).values()):
        assert "<script" not in drawing
    assert "<script" not in forest({nasty: estimate}).rows[nasty]


@pytest.mark.parametrize(
    ("halves", "limit"),
    [
        ((0.0,), 1.0),  # nothing is uncertain
        ((0.1,), 0.2),
        ((0.18,), 0.5),  # with room: 0.207
        ((4.0, 4.3), 5.0),
        ((4.0, 4.4), 10.0),  # with room: 5.06
        ((99.0,), 100.0),
        ((1.0, 1.0, 90.0), 5.0),  # 2.5 times the median
    ],
)
def test_the_scale_is_the_next_round_number(halves: tuple[float, ...], limit: float) -> None:
    group = {
        f"k{place}": Estimate(
            estimate=1.0, std=0.1, ci95=(1 - half / 100, 1 + half / 100), unit="m"
        )
        for place, half in enumerate(halves)
    }
    drawn = forest(group)
    assert drawn.limit == pytest.approx(limit)
    assert drawn.heading == f"within ± {limit:.1g} %".replace("1e+02", "100").replace("1e+01", "10")


def test_an_interval_without_an_end_or_about_zero() -> None:
    half_open = Estimate(estimate=1.0, std=0.1, ci95=(None, 2.0), unit="m")
    none = Estimate(estimate=None, std=None, ci95=(0.0, 1.0), unit="m")
    zero = Estimate(estimate=0.0, std=0.1, ci95=(-0.2, 0.2), unit="m")
    drawn = forest(
        {"open": half_open, "none": none, "zero": zero}, truth={"zero": 0.1}, logs={"zero": [0.05]}
    )
    assert set(drawn.rows) == {"zero"}
    assert 'aria-label="zero: wider than its value"' in drawn.rows["zero"]
    assert forest({}).rows == {}


def test_small_changes_are_drawn_as_small_as_they_are() -> None:
    (tiny,) = bars({"a": 0.1}).values()
    width = re.search(r'<rect class="more" x="60.0" y="2" width="([\d.]+)"', tiny)
    assert width is not None
    # one percent reaches the edge, less two pixels
    assert float(width[1]) == pytest.approx(0.1 * 58, abs=0.05)
    (whole,) = bars({"a": -250.0}).values()
    assert 'x="2.0" y="2" width="58.0"' in whole
    assert 'aria-label="a: -250.00"' in whole
    assert bars({}) == {}
