"""From tables to blocks of a log: what is cut, left out, refused and told, and that
blocks add up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.log import Log, join
from algid.notices import Notice
from algid.profile import Profile
from algid.readers.flat import open_offered
from algid.readers.log_reader import TableReader
from algid.readers.table import CHANNELS, Offered, SampleTable, TopicField

MS = 1_000_000
MAPPING = {name: f"column {name}" for name in CHANNELS[:4]}


def tables(
    told: list[Notice], sizes: tuple[int, ...], channels: dict[str, FloatArray]
) -> Iterator[SampleTable]:
    """Tables of so many rows, 1 kHz; each channel counts the samples unless it is given."""
    first = 0
    for number, size in enumerate(sizes):
        rows = np.arange(first, first + size)
        columns = {name: channels.get(name, np.arange(sum(sizes)) * 1.0)[rows] for name in MAPPING}
        told.append(Notice(f"TABLE{number}", f"table {number}", lossy=number == 1))
        yield SampleTable(rows * MS, columns)
        first += size


def reader(
    *sizes: int, settings: dict[str, Any] | None = None, **channels: FloatArray
) -> TableReader:
    profile = Profile.model_validate(settings or {})
    fields = {name: TopicField(name) for name in MAPPING.values()}
    fields["t"] = TopicField("t", is_clock=True)
    offered = Offered(
        "csv",
        fields,
        MAPPING | {"t": "t"},
        lambda *given: tables(given[2], sizes, channels),
        None,
        notices=(Notice("FIRST", "first"),),
    )
    return open_offered("log.csv", offered, profile)


def codes(log: Log) -> list[str]:
    return [notice.code for notice in log.notices]


@pytest.mark.parametrize("rows", [1, 3, 7, 100])
def test_blocks_are_as_large_as_asked_and_add_up(rows: int) -> None:
    found = list(reader(5, 1, 9).blocks(rows))
    assert max(map(len, found)) <= rows
    whole = join(found)
    assert whole.stamp_ns.tolist() == [place * MS for place in range(15)]
    assert np.array_equal(whole.theta, np.stack([np.arange(15.0)] * 2))
    assert sorted(codes(whole)) == ["FIRST", "TABLE0", "TABLE1", "TABLE2"]
    assert sorted(codes(reader(5, 0, 9, 0).whole())) == ["FIRST", *(f"TABLE{n}" for n in range(4))]


@pytest.mark.parametrize("sizes", [(), (0,), (1,), (1, 0)])
def test_a_log_of_fewer_than_two_samples_is_refused_with_what_was_lost(
    sizes: tuple[int, ...],
) -> None:
    count = "1 sample" if 1 in sizes else "0 samples"
    worst = "table 1" if len(sizes) == 2 else "first"
    with pytest.raises(LogError, match=rf"log.csv: {count}; a log needs two at least \({worst}\)$"):
        reader(*sizes).whole()


@pytest.mark.parametrize("sizes", [(10,), (2, 3, 5), (6, 4)])
def test_a_log_is_cut_where_the_user_says(sizes: tuple[int, ...]) -> None:
    """Both ends stay; times count from the first sample, whatever its stamp."""
    for settings, kept, text in (
        (
            {"start": 0.003, "end": 0.006},
            range(3, 7),
            "6 samples before 0.003 s or behind 0.006 s left out, as configured",
        ),
        (
            {"start": 0.0035},
            range(4, 10),
            "4 samples before 0.0035 s or behind the end left out, as configured",
        ),
        (
            {"end": 0.0088},
            range(9),
            "1 sample before 0 s or behind 0.0088 s left out, as configured",
        ),
    ):
        log = reader(*sizes, settings=settings).whole()
        assert (log.stamp_ns // MS).tolist() == list(kept)
        (said,) = [notice for notice in log.notices if notice.code == "CUT"]
        assert (said.text, said.note, said.lossy) == (text, True, False)
    with pytest.raises(LogError, match="0 samples; a log needs two at least"):
        reader(*sizes, settings={"start": 5}).whole()


@pytest.mark.parametrize(
    ("wrong", "found"),
    [(np.nan, "nan"), (-np.inf, "-inf"), (1e30, "1e\\+30"), (-3e200, "-3e\\+200")],
)
def test_numbers_that_are_none_are_refused_or_left_out(wrong: float, found: str) -> None:
    values = np.zeros(10)
    values[7] = wrong
    with pytest.raises(
        LogError,
        match=rf"tau2 \(column tau2\) in sample 8: expected a finite number .* found {found};",
    ):
        reader(4, 6, tau2=values).whole()
    log = reader(4, 6, tau2=values, settings={"accept": ["NOT_FINITE"]}).whole()
    assert (log.stamp_ns // MS).tolist() == [0, 1, 2, 3, 4, 5, 6, 8, 9]
    (said,) = [notice for notice in log.notices if notice.code == "NOT_FINITE"]
    assert (said.text, said.lossy) == ("1 sample holds a number that is not finite; left out", True)
    # the torque of a joint without motor may be anything
    assert len(reader(4, 6, tau2=values, settings={"passive": 2}).whole()) == 10


@pytest.mark.parametrize("share", [0.0, 0.005, 0.02])
def test_a_torque_of_a_joint_called_passive_is_warned_of(share: float) -> None:
    """Once, from the first samples; the other joint's own column in its place is none."""
    other = np.sin(np.arange(200))
    log = reader(100, 100, tau1=other, tau2=share * other, settings={"passive": 2})
    blocks = list(log.blocks(100))
    found = [notice for block in blocks for notice in block.notices]
    told = [notice for notice in found if notice.code == "PASSIVE_TORQUE"]
    assert [notice.numbers["percent"] for notice in told] == (
        [pytest.approx(2.0)] if share == 0.02 else []
    )
    assert not any(block.tau[1].any() for block in blocks)
    shared = replace(log.origin, mapping={**MAPPING, "tau2": MAPPING["tau1"]})
    assert "PASSIVE_TORQUE" not in codes(replace(log, origin=shared).whole())
