"""A track's tables and figures against stretches made by hand, without any log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from algid.notices import Notice
from algid.report.render import page
from algid.results import LogSummary
from algid.tracks.figures import MOST_MARKS, POINTS, payload_figure
from algid.tracks.page import track_document
from algid.tracks.payload import Stretch, Track
from algid.tracks.result import TrackResult
from algid.tracks.tables import (
    change_table,
    fixed,
    half_text,
    mass_text,
    quality_tables,
    stretch_table,
    verdict,
)
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


@given(st.floats(-50, 50), st.floats(1e-8, 10))
def test_a_mass_is_written_to_the_second_digit_of_its_error(value: float, std: float) -> None:
    text = fixed(value, std)
    decimals = len(text.partition(".")[2])
    assert float(text) == pytest.approx(value, abs=0.5000001 * 10.0**-decimals)
    assert decimals == 0 or std >= 0.999 * 10.0**-decimals  # no more digits than the error leaves
    assert decimals == 9 or std * 10**decimals > 9.99  # and no fewer than two of its own
    assert text not in ("-0", "-0.0", "-0.00")


def test_a_mass_without_an_error_has_three_decimals_and_zero_no_sign() -> None:
    assert [fixed(0.12345, std) for std in (0.0, float("nan"), float("inf"))] == ["0.123"] * 3
    assert fixed(-0.00004, 0.001) == "0.0000"
    assert fixed(-1.0, 30.0) == "-1"


def test_a_payload_that_may_be_nothing_is_zero_with_one_digit_of_its_error() -> None:
    """No mass of −0.000028 kg where there is none."""
    nothing, something = Stretch(0.0, 1.0, -2.8e-5, 5.1e-5), Stretch(0.0, 1.0, 2.8e-4, 5.1e-5)
    assert (mass_text(nothing), half_text(nothing)) == ("0", "0.0001")
    assert (mass_text(something), half_text(something)) == ("0.000280", "0.000100")


def test_changes_have_their_sign_and_the_nearest_true_moment() -> None:
    made = track([0.1, 0.35, 0.2], schedule=((0.0, 0.1), (1.02, 0.35), (1.9, 0.2)))
    rows = change_table(made).rows
    assert [row[2] for row in rows] == ["+0.2500", "-0.1500"]
    between = [("1.000", "[0.900, 1.100]"), ("2.000", "[1.900, 2.100]")]
    assert [(row[1], row[4]) for row in rows] == between
    # what the arm held at the start is no change
    assert [row[5] for row in rows] == [
        "1.020",
        "1.900",
    ]
    assert "Truth at, s" not in change_table(track([0.1, 0.2])).columns
    uneven = track([0.1, 0.2])
    coarse = replace(uneven.track.stretches[1], std=0.04)
    made = replace(
        uneven, track=replace(uneven.track, stretches=[uneven.track.stretches[0], coarse])
    )
    assert change_table(made).rows[0][2] == "+0.100"  # as fine as the coarser of both


def test_stretches_stand_against_the_schedule() -> None:
    made = track([0.1, 0.35], schedule=((0.0, 0.09), (1.0, 0.35)))
    rows = {row[0]: row for row in stretch_table(made).rows}
    assert rows["1"] == (
        *("1", "0.000", "1.000", "0.1000", "0.0020", "kg", "OK", "0.0900", "0.0100"),
    )
    assert rows["2"][-2:] == ("0.3500", "0.0000")
    assert list(stretch_table(track([0.1])).columns)[-1] == "Status"


def test_a_report_shows_changes_and_holes_where_there_are_any() -> None:
    assert verdict(track([0.1])).grade == "good"
    still = track(
        [0.1], notices=(Notice("UNEVEN_STAMPS", "it jitters"), Notice("CUT", "cut", note=True))
    )
    assert [one.code for one in verdict(still).reasons] == ["UNEVEN_STAMPS"]
    assert [one.code for one in verdict(still).notes] == ["CUT"]
    titles = [[one.title for one in track_document(still).tables(away)] for away in (False, True)]
    folded = ["Fit", "Logs", "Channels", "Settings", "Provenance"]
    assert titles == [["Payload by stretch"], folded]
    moving = track([0.1, 0.3])
    holey = replace(moving, track=replace(moving.track, holes=np.array([[0.25, 0.5]])))
    document = track_document(holey)
    titles = [[one.title for one in document.tables(away)] for away in (False, True)]
    assert titles == [
        ["Payload by stretch", "Changes"],
        [*folded[:3], "Times without samples", *folded[3:]],
    ]
    assert quality_tables(holey)[-1].rows == (("0.250", "0.500"),)
    log, channels = quality_tables(holey)[1:3]
    assert list(log.columns) == [
        "Log",
        "Format",
        "Samples",
        "Duration, s",
        "Rate, Hz",
    ]
    assert channels.rows == (("theta1", "q1"), ("tau1", "t1"))
    assert "<li>it jitters</li>" in page(track_document(still), shared_library=True)
    assert document.facts == "arm of arm.algid · 3.000 s of log at 1000 Hz · 3,000 samples"


def test_the_figure_steps_where_the_payload_does() -> None:
    made = track([0.1, 0.35, 0.2], schedule=((0.0, 0.1), (1.02, 0.35), (1.9, 0.2), (9.0, 5.0)))
    plot = payload_figure(made)
    data, layout = plot.figure.data, plot.figure.layout
    (stretch,), (truth,) = named(data, "mass of each stretch"), named(data, "true schedule")
    np.testing.assert_allclose(typed(stretch["x"]), [0, 1, 1, 2, 2, 3])
    np.testing.assert_allclose(typed(stretch["y"]), [0.1, 0.1, 0.35, 0.35, 0.2, 0.2], rtol=1e-6)
    np.testing.assert_allclose(typed(truth["x"]), [0, 0, 0, 1.02, 1.02, 1.9, 1.9, 3], rtol=1e-6)
    np.testing.assert_allclose(typed(truth["y"]), [0, 0, 0.1, 0.1, 0.35, 0.35, 0.2, 0.2], rtol=1e-6)
    marks = [(one["x0"], one["x1"]) for one in layout["shapes"] if one["type"] == "rect"]
    assert marks == [(0.9, 1.1)] * 2 + [(1.9, 2.1)] * 2  # in both panels
    (noise,) = [one for one in layout["shapes"] if one["type"] == "line"]
    assert (noise["y0"], noise["yref"]) == (1.0, "y2")
    low, high = layout["yaxis"]["range"]
    assert low < 0.1 < 0.35 < high < 0.5  # what the log does not reach is not shown
    bands = named(data, "its 95 % band")
    assert len(bands) == 3  # one closed area a stretch
    ends = np.concatenate([typed(one["y"]) for one in bands])
    assert (ends.min(), ends.max()) == pytest.approx(
        (0.1 - 1.96 * 0.001, 0.35 + 1.96 * 0.001), rel=1e-4
    )
    (left,) = named(data, "residual")
    assert typed(left["y"])[:50] == pytest.approx(made.track.left[:50], rel=1e-6)
    assert plot.note == f"Median of the residual over the noise: {np.median(made.track.left):.2f}."


def test_a_long_track_keeps_its_extremes_and_breaks_at_holes() -> None:
    made = track([0.1, 0.35] * 70)
    m_p = made.track.m_p.copy()
    m_p[40], m_p[90] = 0.9, -0.4
    made = replace(made, track=replace(made.track, m_p=m_p))
    assert made.track.t.size > 2 * POINTS / 2
    data = payload_figure(made).figure.data
    (curve,) = [one for one in data if one["name"].startswith("m_p(t)")]
    y = typed(curve["y"])
    assert y.size < made.track.t.size
    assert (np.nanmin(y), np.nanmax(y)) == pytest.approx((-0.4, 0.9))
    ends = np.concatenate([typed(one["y"]) for one in named(data, "its 95 % band")])
    assert ends.max() == pytest.approx(0.9 + 1.96 * 0.001, rel=1e-4)
    assert ends.min() == pytest.approx(-0.4 - 1.96 * 0.001, rel=1e-4)
    still = track([0.1])
    t = still.track.t + np.where(still.track.t > 0.5, 3.0, 0.0)
    holey = replace(still, track=replace(still.track, t=t))
    (curve,) = [
        one for one in payload_figure(holey).figure.data if one["name"].startswith("m_p(t)")
    ]
    assert np.count_nonzero(np.isnan(typed(curve["y"]))) == 2  # in the hole, and at the end


def test_many_changes_do_not_hide_the_payload() -> None:
    few, many = track([0.1, 0.2] * (MOST_MARKS // 2)), track([0.1, 0.2] * (MOST_MARKS // 2 + 1))
    assert len(few.track.changes) < MOST_MARKS < len(many.track.changes)
    for made, marked in ((few, True), (many, False)):
        shapes = payload_figure(made).figure.layout["shapes"]
        assert any(one["type"] == "rect" for one in shapes) is marked


def test_a_jolt_leaves_the_frame_and_a_still_arm_does_too() -> None:
    made = track([0.1, 0.35] * 3)
    m_p, std = made.track.m_p.copy(), made.track.std.copy()
    m_p[40] = 90.0  # a jolt: one sample in three hundred
    std[10:20] = 40.0  # the arm stood still
    plot = payload_figure(replace(made, track=replace(made.track, m_p=m_p, std=std)))
    low, high = plot.figure.layout["yaxis"]["range"]
    assert -1 < low < 0.1 < 0.35 < high < 2
