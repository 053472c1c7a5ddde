"""Time that starts again within a log: all its runs, or one alone, against separate files."""

from __future__ import annotations

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
from algid.readers.clock import in_order
from algid.readers.table import SampleTable, stack

MS = 1_000_000


def table(stamps: IntArray, values: FloatArray) -> SampleTable:
    return SampleTable(stamps, {"theta1": values})


def read(parts: list[SampleTable], only: int | None = None) -> SampleTable:
    """What comes of the tables, in time order."""
    return stack(list(in_order("log", iter(parts), [], only, runs=True)))


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
        table(own, kept)
        for own, kept in zip(np.split(stamps, cuts), np.split(values, cuts), strict=True)
    ]
    edges = np.cumsum([0, *sizes])
    together = read(parts)
    assert np.array_equal(together.columns["theta1"], values)
    jumps = np.flatnonzero(np.diff(together.stamp_ns) > 6 * MS) + 1
    assert jumps.tolist() == edges[1:-1].tolist()
    for number in range(len(sizes)):
        own = slice(edges[number], edges[number + 1])
        alone = read(parts, number + 1)
        assert np.array_equal(alone.columns["theta1"], values[own])
        assert np.array_equal(np.diff(alone.stamp_ns), np.diff(stamps[own]))


def test_a_run_that_goes_far_back_is_found_before_one_behind_it() -> None:
    """The rows of the second run that lie before all that is known of the first are no overlap."""
    steps = ((1642, MS), (1100, MS), (1100, 3 * MS), (1100, MS))
    runs = [np.arange(size) * step for size, step in steps]
    behind = np.concatenate(runs[1:])
    parts = [table(runs[0], runs[0] * 1.0), table(behind, behind * 2.0)]
    for number, run in enumerate(runs, start=1):
        assert len(read(parts, number)) == run.size


def test_late_blocks_start_no_run() -> None:
    order = np.concatenate([np.arange(2000), np.arange(2400, 2800), np.arange(2000, 2400)])
    order = np.concatenate([order, np.arange(2800, 6000)])
    for cut in (2390, 2410, 2790, 2850):
        parts = [table(part * MS, part * 1.0) for part in (order[:cut], order[cut:])]
        assert read(parts).columns["theta1"].tolist() == list(range(6000))


def two_runs(folder: Path) -> tuple[FloatArray, FloatArray, Path]:
    t = np.arange(4000) / 500
    rows = {name: np.sin((1 + place) * t) for place, name in enumerate(("theta1", "theta2"))}
    rows |= {name: np.cos((1 + place) * t) for place, name in enumerate(("tau1", "tau2"))}
    back = np.where(t < 5, t, t - 5)
    pq.write_table(pa.table({"t": back, **rows}), folder / "log.parquet")
    return t, rows["theta1"], folder / "log.parquet"


def test_a_file_of_two_runs_and_each_alone(tmp_path: Path) -> None:
    t, theta1, path = two_runs(tmp_path)
    whole = read_log(path)
    assert np.array_equal(whole.theta[0], theta1)
    for number, own in ((1, t < 5), (2, t >= 5)):
        alone = read_log(path, Profile(segment=number))
        assert np.array_equal(alone.theta[0], theta1[own])
        assert alone.origin.reading.segment == number
        (said,) = alone.notices
        assert said.text == f"time starts again 1 time: of 2 runs number {number} is read alone"
        assert len(inspect(path, segment=number).notices) == 1
    with pytest.raises(
        LogError, match=r"no segment 3: its time makes 2 runs; the last one: --set segment=2"
    ):
        read_log(path, Profile(segment=3))
    with pytest.raises(SettingError, match="segment: expected greater than or equal to 1"):
        inspect(path, segment=0)


@pytest.mark.parametrize("lost", [0, 60])
def test_the_pause_between_runs_is_no_gap(lost: int, tmp_path: Path) -> None:
    _, _, path = two_runs(tmp_path)
    rows = pq.read_table(path)
    pq.write_table(pa.concat_tables([rows[:900], rows[900 + lost :]]), path)
    found = inspect(path)
    assert found.clock is not None
    assert found.clock.gaps == (1 if lost else 0)
    assert found.clock.longest_gap == pytest.approx((lost + 1) / 500 if lost else 0.0)
    assert "GAPS" in [one.code for one in found.notices]
    assert ("GAPS" in [one.code for one in found.findings]) == bool(lost)


def test_a_clock_set_back_by_more_than_a_short_log_so_far_starts_a_run() -> None:
    first, second = np.arange(500, 800) * MS, np.arange(0, 2000) * MS
    stamps = np.concatenate([first, second])
    told = list[Notice]()
    found = stack(list(in_order("log", iter([table(stamps, 1.0 * stamps)]), told, runs=True)))
    assert len(found) == stamps.size
    assert [one.code for one in told] == ["GAPS"]
