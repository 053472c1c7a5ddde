"""A track's tables and figures against stretches made by hand, without any log."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from algid.results import LogSummary
from algid.tracks.page import (
    POINTS,
    change_table,
    payload_figure,
    stretch_table,
    verdict,
)
from algid.tracks.result import Stretch, Track, TrackResult
from tests.report.pages import named, typed

LOG = LogSummary(
    path="logs/pick.csv",
    sha256="0" * 64,
    role="loaded",
    format="csv",
    rows=3000,
    duration=3.0,
    rate=1000.0,
    mapping={"theta1": "q1", "tau1": "t1"},
)


def track(masses: list[float], std: float = 0.001, **changes: object) -> TrackResult:
    """A second of each mass; a change lies a tenth of a second either side."""
    t = np.arange(0.01, len(masses), 0.02)
    stretch = np.minimum(t.astype(np.int64), len(masses) - 1)
    m_p = np.array(masses)[stretch]
    found = Track(
        t=t,
        m_p=m_p,
        std=np.full(t.size, std),
        left=np.ones(t.size),
        stretch=stretch,
        stretches=[
            Stretch(float(place), place + 1.0, mass, std) for place, mass in enumerate(masses)
        ],
        changes=np.array(
            [[place, place - 0.1, place + 0.1] for place in range(1, len(masses))]
        ).reshape(-1, 3),
        holes=np.zeros((0, 2)),
        explained=0.999,
        colour=1.0,
        tip_equivalent=0.05,
    )
    made = TrackResult(
        track=found,
        log=LOG,
        arm="arm.algid",
        arm_sha256="1" * 64,
        settings={"l1": 0.2},
        version="1",
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def test_changes_have_their_sign_and_the_nearest_true_moment() -> None:
    made = track([0.1, 0.35, 0.2], schedule=((0.0, 0.1), (0.98, 0.35), (1.9, 0.2)))
    rows = change_table(made).rows
    assert [row[2] for row in rows] == ["+0.2500", "-0.1500"]
    between = [("1.000", "[0.900, 1.100]"), ("2.000", "[1.900, 2.100]")]
    assert [(row[1], row[4]) for row in rows] == between
    # what the arm held at the start is no change
    assert [row[5] for row in rows] == [
        "0.980",
        "1.900",
    ]
    heads = change_table(track([0.1, 0.2])).heads
    assert "Truth at, s" not in [heading for _, heading, _ in heads]
    uneven = track([0.1, 0.2])
    coarse = replace(uneven.track.stretches[1], std=0.04)
    made = replace(
        uneven, track=replace(uneven.track, stretches=[uneven.track.stretches[0], coarse])
    )
    assert change_table(made).rows[0][2] == "+0.100"  # as fine as the coarser of both


def test_a_long_track_keeps_its_extremes_and_breaks_at_holes() -> None:
    made = track([0.1, 0.35] * 70)
    m_p = made.track.m_p.copy()
    m_p[40], m_p[90] = 0.9, -0.4
    made = replace(made, track=replace(made.track, m_p=m_p))
    assert made.track.t.size > 2 * POINTS / 2
    data = payload_figure(made).data
    (curve,) = [one for one in data if one["name"].startswith("m_p(t)")]
    y = typed(curve["y"])
    assert y.size < made.track.t.size
    assert (np.nanmin(y), np.nanmax(y)) == pytest.approx((-0.4, 0.9))
    (steps,) = named(data, "mass of each stretch")
    assert typed(steps["x"])[:4].tolist() == [0, 1, 1, 2]
    assert typed(steps["y"])[:4].tolist() == pytest.approx([0.1, 0.1, 0.35, 0.35])
    ends = np.concatenate([typed(one["y"]) for one in named(data, "its 95 % band")])
    assert ends.max() == pytest.approx(0.9 + 1.96 * 0.001, rel=1e-4)
    assert ends.min() == pytest.approx(-0.4 - 1.96 * 0.001, rel=1e-4)
    known = track([0.1, 0.35], schedule=((0.0, 0.1), (1.1, 0.4)))
    (true,) = named(payload_figure(known).data, "true schedule")
    np.testing.assert_allclose(typed(true["x"]), [0.0, 0.0, 1.1, 2.0], rtol=1e-6)
    np.testing.assert_allclose(typed(true["y"]), [0.0, 0.1, 0.4, 0.4], rtol=1e-6)
    low, high = payload_figure(known).layout["yaxis"]["range"]
    assert -0.05 < low < 0.0 < 0.4 < high < 0.45  # all that is drawn, and little more
    still = track([0.1])
    t = still.track.t + np.where(still.track.t > 0.5, 3.0, 0.0)
    holey = replace(still, track=replace(still.track, t=t))
    (curve,) = [one for one in payload_figure(holey).data if one["name"].startswith("m_p(t)")]
    assert np.count_nonzero(np.isnan(typed(curve["y"]))) == 2  # in the hole, and at the end


HALF = "the least certain to ± 0.0020 kg (95 %)"


@pytest.mark.parametrize(
    ("masses", "changes", "grade", "words"),
    [
        ([0.1], {}, "good", "the payload does not change: 0.1000 ± 0.0020 kg throughout."),
        ([0, 0.3], {}, "good", f"changes 1 time at 1.00 s, weighing 0 and 0.3000 kg, {HALF}."),
        ([0.1, 0.3] * 3, {}, "good", f"changes 5 times, in 6 stretches, {HALF}."),
        ([0.1], {"explained": 0.49}, "failed", "explain only 49 % of the torque: is it this arm"),
        ([0.1], {"explained": 0.89}, "reservations", "but arm and payload explain only 89 % of"),
        ([0.1], {"explained": 0.91}, "good", ""),
        ([0.1], {"colour": 4.1, "explained": 0.95}, "reservations", "has errors of 2.0 times its"),
        ([0.1], {"colour": 3.9}, "good", ""),
        ([0.1], {"colour": 1.1e4}, "reservations", "has errors of 105 times its"),
        (
            [0.1],
            {"colour": 1.1e4, "explained": 0.98},
            "failed",
            "arm and payload miss the torque by 105 times its sensors' noise: is it this arm",
        ),
        ([-0.1, 0.3], {}, "failed", "Failed: 1 of 2 stretches with a negative mass"),
        ([0.3, 0.3, -0.1], {}, "reservations", "but stretch 3: negative payload mass"),
        ([0], {"tip_equivalent": 1e-4}, "failed", "the arm moves too little to weigh anything"),
        ([1, 0], {"tip_equivalent": 1e-4}, "reservations", "stretch 2 moves too little to be"),
    ],
)
def test_the_verdict_is_that_of_what_is_explained_of_errors_and_of_stretches(
    masses: list[float], changes: dict[str, Any], grade: str, words: str
) -> None:
    made = track(masses)
    found = verdict(replace(made, track=replace(made.track, **changes)))
    assert found.grade == grade
    assert words in found.sentence
    known = track(masses, schedule=((0.0, masses[0]), (1.0, 9.0)))
    number, *span, mass, half, unit, _, true, off = stretch_table(known).rows[0]
    assert (number, *span, half, unit) == ("1", "0.000", "1.000", "0.0020", "kg")
    assert (float(mass), float(true), float(off)) == (masses[0], masses[0], 0.0)
