"""Time order and alignment: against numpy's sort, closed forms of linear interpolation, and at
their very limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from algid import inspect
from algid.arm import FloatArray
from algid.base.errors import LogError, SettingError
from algid.log import IntArray
from algid.notices import Notice
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.table import SampleTable, stack

MS = 1_000_000
HORIZON = 1024


def table(stamps: Sequence[int] | IntArray, **columns: FloatArray) -> SampleTable:
    own = np.asarray(stamps, np.int64)
    return SampleTable(own, columns or {"theta1": np.arange(own.size, dtype=float)})


def ordered(
    *tables: SampleTable, only: int | None = None, runs: bool = False
) -> tuple[SampleTable, list[Notice]]:
    """What comes out, as one table, and what is said: stamps rise within and across the tables."""
    told = list[Notice]()
    found = stack(list(in_order(iter(tables), told, only, runs=runs)))
    assert np.all(np.diff(found.stamp_ns) > 0)
    return found, told


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_late_and_repeated_samples_in_any_tables(data: st.DataObject) -> None:
    """Neighbours swapped and stamps repeated at random: numpy's unique tells what must come out,
    and how many go.
    """
    steps = data.draw(st.lists(st.integers(0, 3), min_size=40, max_size=80))
    stamps = np.cumsum([step or (place % 3 != 0) for place, step in enumerate(steps)])
    for place in data.draw(st.sets(st.integers(0, stamps.size // 8 - 1))):
        stamps[8 * place : 8 * place + 2] = stamps[8 * place : 8 * place + 2][::-1]
    values = np.arange(stamps.size, dtype=float)
    cuts = sorted(data.draw(st.sets(st.integers(1, stamps.size - 1), max_size=4)))
    parts = [
        table(own, q=kept)
        for own, kept in zip(np.split(stamps, cuts), np.split(values, cuts), strict=True)
    ]
    unique, first = np.unique(stamps, return_index=True)
    try:
        found, told = ordered(*parts)
    except LogError:  # a table so short that one swap is a quarter of it
        assert min(map(len, parts)) < 10
        return
    assert found.stamp_ns.tolist() == unique.tolist()
    assert found.columns["q"].tolist() == values[first].tolist()
    said = {notice.key: int(notice.text.split()[0]) for notice in told}
    assert said.get("UNEVEN_STAMPS:repeated", 0) == stamps.size - unique.size
    assert ("UNEVEN_STAMPS:late" in said) == bool(np.any(np.diff(stamps) < 0))


@pytest.mark.parametrize(("late", "fits"), [(HORIZON, True), (HORIZON + 1, False)])
def test_a_sample_may_come_late_by_the_horizon_and_no_more(late: int, fits: bool) -> None:
    stamps = np.arange(4 * HORIZON) * MS
    moved = np.concatenate(
        [stamps[:10], stamps[11 : 11 + late], stamps[10:11], stamps[11 + late :]]
    )
    if fits:
        assert ordered(table(moved))[0].stamp_ns.tolist() == stamps.tolist()
    else:
        with pytest.raises(
            LogError, match=f"backwards by {late * 1e-3:.6g} s behind stamp {stamps[10 + late]} ns"
        ):
            ordered(table(moved))


@pytest.mark.parametrize(("apart", "fits"), [(1, True), (16, True), (17, False)])
def test_all_samples_may_come_a_few_places_late(apart: int, fits: bool) -> None:
    """Two threads that write to one file, of which one is behind all along."""
    stamps = np.arange(2000)
    moved = stamps + np.where(stamps % 2, 2 * apart + 0.5, 0.0)
    order = np.argsort(moved, kind="stable")
    assert np.abs(np.argsort(order) - stamps).max() == apart
    if fits:
        found, told = ordered(table(order[:900]), table(order[900:]))
        assert found.stamp_ns.tolist() == stamps.tolist()
        assert [notice.code for notice in told] == ["UNEVEN_STAMPS"]
    else:
        with pytest.raises(LogError, match="time goes backwards"):
            ordered(table(order))


@pytest.mark.parametrize("cut", [None, 6])
def test_a_repeated_stamp_is_a_loss_where_its_values_are_others(cut: int | None) -> None:
    """In a table, and across two."""
    stamps, values = [0, 1, 2, 3, 4, 5, 5, 6, 7, 8], np.array([0, 1, 2, 3, 4, 5, 5, 6, 7, 8.0])
    for other, text in (
        (5.0, "1 sample repeats a stamp; the first of each was kept"),
        (5.5, "1 sample repeats a stamp; the first of each was kept; 1 with other values is lost"),
    ):
        values[6] = other
        parts = [slice(0, cut), *([slice(cut, None)] if cut else [])]
        _, (said,) = ordered(*(table(stamps[part], q=values[part]) for part in parts))
        assert (said.text, said.lossy) == (text, other != 5.0)


def test_memory_is_bounded_where_tables_overlap() -> None:
    """Each table reaches a little into the one before, so that all are merged, and still none is
    held back for long.
    """
    stamps = np.arange(40_000)
    parts = np.split(stamps, range(4000, 40_000, 4000))
    for one, other in pairwise(parts):
        one[-1], other[0] = other[0], one[-1]
    sizes = [len(found) for found in in_order((table(part) for part in parts), [])]
    assert sum(sizes) == stamps.size
    assert max(sizes) <= 8000


def series(stamps: IntArray, **columns: FloatArray) -> Series:
    return Series("/other", table(stamps, **columns))


def test_samples_three_periods_apart_are_bridged_and_no_further() -> None:
    # a gap of three periods, and one of 3.1
    stamps = np.array([0, 10, 20, 30, 60, 70, 80, 111, 121, 131]) * MS
    other = series(stamps, tau1=stamps * 1.0)
    assert other.period == 10 * MS
    ends = {-1: False, 0: True, 30 * MS + 1: True, 60 * MS - 1: True, 80 * MS: True}
    ends |= {80 * MS + 1: False, 111 * MS - 1: False, 111 * MS: True}
    ends |= {131 * MS: True, 131 * MS + 1: False}
    asked = np.array([*ends])
    assert other.at(asked)[0].tolist() == [*ends.values()]
    torn = series(np.array([0, 9, 10, 11, 12]) * MS, tau1=np.zeros(5))
    assert torn.at(np.array([0, 1, 9 * MS]))[0].tolist() == [True, False, True]
    assert series(stamps[:2], tau1=np.ones(2)).error() == "tau1 0"


@settings(max_examples=20, deadline=None)
@given(shift=st.integers(-(10**15), 10**18), cut=st.integers(0, 60))
def test_alignment_does_not_depend_on_the_clock_or_the_tables(shift: int, cut: int) -> None:
    own, theirs = np.arange(60) * MS, 10 * MS + np.arange(12) * (3 * MS)
    line = 2.0 + 1e-9 * (theirs - theirs[0])
    other = Series("/other", table(theirs + shift, tau1=line))
    parts = [table(part + shift, theta1=part * 1.0) for part in (own[:cut], own[cut:])]
    told = list[Notice]()
    found = stack(list(aligned(iter(parts), [other], told)))
    inside = (own >= theirs[0]) & (own <= theirs[-1])
    assert (found.stamp_ns - shift).tolist() == own[inside].tolist()
    assert found.columns["theta1"].tolist() == own[inside].tolist()
    assert np.allclose(found.columns["tau1"], 2.0 + 1e-9 * (own[inside] - theirs[0]), rtol=1e-14)
    texts = {notice.case: notice for notice in told}
    assert (
        texts["not covered"].text
        == f"{60 - inside.sum()} samples were dropped, where another topic or file has none"
    )
    assert texts["not covered"].lossy
    assert texts["interpolated"].text.startswith(
        "'/other' (333.333 Hz) was interpolated; error, root mean square"
    )


def test_a_topic_is_read_whole_in_order_or_refused() -> None:
    found = whole_topic(
        "/other",
        ["tau1"],
        iter([table(range(0, 20, 2)), table([]), table([17, 21, 22, 23])]),
        [],
    )
    assert found.table.stamp_ns.tolist() == [*range(0, 17, 2), 17, 18, 21, 22, 23]
    with pytest.raises(
        LogError,
        match=r"topic '/other' holds no sample of tau1; .*--set tau1.topic=NAME",
    ):
        whole_topic("/other", ["tau1", "tau2"], iter([table([])]), [])


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_runs_are_found_wherever_tables_are_cut(data: st.DataObject) -> None:
    """Runs of any length, pace and start, as long as time goes back between them."""
    sizes = data.draw(st.lists(st.integers(1100, 3000), min_size=2, max_size=4))
    runs, start = [], 0
    for size in sizes:
        step = data.draw(st.sampled_from([MS, 3 * MS]))
        runs.append(start + np.arange(size) * step)
        start = data.draw(st.integers(0, 5)) * 100 * MS  # every run reaches beyond 1.1 s
    stamps = np.concatenate(runs)
    values = np.random.default_rng(1).normal(size=stamps.size)
    cuts = sorted(data.draw(st.sets(st.integers(1, stamps.size - 1), max_size=5)))
    parts = [
        table(own, theta1=kept)
        for own, kept in zip(np.split(stamps, cuts), np.split(values, cuts), strict=True)
    ]
    edges = np.cumsum([0, *sizes])
    together, _ = ordered(*parts, runs=True)
    assert np.array_equal(together.columns["theta1"], values)
    jumps = np.flatnonzero(np.diff(together.stamp_ns) > 6 * MS) + 1
    assert jumps.tolist() == edges[1:-1].tolist()
    for number in range(len(sizes)):
        own = slice(edges[number], edges[number + 1])
        alone, _ = ordered(*parts, only=number + 1, runs=True)
        assert np.array_equal(alone.columns["theta1"], values[own])
        assert np.array_equal(np.diff(alone.stamp_ns), np.diff(stamps[own]))


def test_a_run_that_goes_far_back_is_found_before_one_behind_it() -> None:
    """The rows of the second run that lie before all that is known of the first are no overlap."""
    steps = ((1642, MS), (1100, MS), (1100, 3 * MS), (1100, MS))
    runs = [np.arange(size) * step for size, step in steps]
    behind = np.concatenate(runs[1:])
    parts = [table(runs[0]), table(behind)]
    for number, run in enumerate(runs, start=1):
        assert len(ordered(*parts, only=number, runs=True)[0]) == run.size


def test_late_blocks_start_no_run() -> None:
    order = np.concatenate([np.arange(2000), np.arange(2400, 2800), np.arange(2000, 2400)])
    order = np.concatenate([order, np.arange(2800, 6000)])
    for cut in (2390, 2410, 2790, 2850):
        parts = [table(part * MS, theta1=part * 1.0) for part in (order[:cut], order[cut:])]
        assert ordered(*parts, runs=True)[0].columns["theta1"].tolist() == list(range(6000))


def two_runs(folder: Path) -> Path:
    t = np.arange(4000) / 500
    rows = {name: np.sin((1 + place) * t) for place, name in enumerate(("theta1", "theta2"))}
    rows |= {name: np.cos((1 + place) * t) for place, name in enumerate(("tau1", "tau2"))}
    back = np.where(t < 5, t, t - 5)
    pq.write_table(pa.table({"t": back, **rows}), folder / "log.parquet")
    return folder / "log.parquet"


def test_a_run_of_a_file_is_read_alone(tmp_path: Path) -> None:
    path = two_runs(tmp_path)
    alone = read_log(path, Profile(segment=1))
    assert len(alone) == 2500
    assert alone.origin.reading.segment == 1
    (said,) = alone.notices
    assert said.text == "time starts again 1 time: of 2 runs number 1 is read alone"
    assert len(inspect(path, segment=1).notices) == 1
    with pytest.raises(
        LogError, match=r"no segment 3: its time makes 2 runs; the last one: --set segment=2"
    ):
        read_log(path, Profile(segment=3))
    with pytest.raises(SettingError, match="segment: expected greater than or equal to 1"):
        inspect(path, segment=0)


@pytest.mark.parametrize("lost", [0, 60])
def test_the_pause_between_runs_is_no_gap(lost: int, tmp_path: Path) -> None:
    path = two_runs(tmp_path)
    rows = pq.read_table(path)
    pq.write_table(pa.concat_tables([rows[:900], rows[900 + lost :]]), path)
    found = inspect(path)
    assert found.clock.gaps == (1 if lost else 0)
    assert found.clock.longest_gap == pytest.approx((lost + 1) / 500 if lost else 0.0)
    assert "GAPS" in [one.code for one in found.notices]
    assert ("GAPS" in [one.code for one in found.findings]) == bool(lost)


def test_a_clock_set_back_by_more_than_a_short_log_so_far_starts_a_run() -> None:
    first, second = np.arange(500, 800) * MS, np.arange(0, 2000) * MS
    stamps = np.concatenate([first, second])
    found, told = ordered(table(stamps), runs=True)
    assert len(found) == stamps.size
    assert [one.code for one in told] == ["GAPS"]


@pytest.mark.parametrize(("repeats", "fits"), [(20, True), (21, False)])
def test_half_of_the_stamps_may_repeat(repeats: int, fits: bool) -> None:
    stamps = np.concatenate([np.arange(40 - repeats), np.full(repeats, 39 - repeats)])
    if fits:
        _, (said,) = ordered(table(stamps))
        assert said.text.startswith("20 samples repeat a stamp; the first of each was kept; 20 ")
    else:
        with pytest.raises(LogError, match="time stands still: 21 of 40 stamps as the one before"):
            ordered(table(stamps))
