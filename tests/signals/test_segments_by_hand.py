"""Segments of stamps small enough to check by eye: where a log is cut, what is dropped, what is
put in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from algid.log import Log, Origin
from algid.signals.segments import (
    Segment,
    pieces,
    segments,
    spread_pieces,
    stretches,
)

MS = 1_000_000  # ns


def log_at(ms: list[float], *, omega: bool = False) -> Log:
    """Samples at `ms`; each signal is its own straight line through time."""
    stamp_ns = np.array([round(one * MS) for one in ms], dtype=np.int64)
    t = stamp_ns * 1e-9
    signals = [np.stack([a * t + b, b * t - a]) for a, b in ((2.0, 1.0), (-3.0, 0.5), (0.25, 4.0))]
    return Log(
        stamp_ns, signals[0], signals[1], Origin("log", "test", {}), signals[2] if omega else None
    )


def found(log: Log | list[float], *, omega: bool = False) -> list[Segment]:
    """The stretches, each joined to one segment."""
    return stretches([log if isinstance(log, Log) else log_at(log, omega=omega)])


def test_a_log_without_samples_has_no_segments() -> None:
    empty = log_at([0, 1, 2, 3]).part(0, 0)
    assert list(segments([])) == []
    assert list(segments([empty, empty])) == []


@pytest.mark.parametrize(("gap", "starts"), [(5.0, [0.0]), (5.1, [0.0, 0.0141])])
def test_a_log_is_cut_where_more_than_five_periods_lack_samples(
    gap: float, starts: list[float]
) -> None:
    stretches = found([*range(10), *(9 + gap + n for n in range(12))])
    assert [one.start for one in stretches] == pytest.approx(starts, abs=1e-12)
    assert [one.dt for one in stretches] == pytest.approx([1e-3] * len(starts), rel=1e-12)


@pytest.mark.parametrize("since", [0, 1_700_000_000_000_000_000])
def test_fewer_than_four_samples_between_gaps_are_left_out(since: int) -> None:
    log = log_at([*range(200), 240, 241, 242, *range(300, 400), 450, 451, 452, 453])
    stretches = found(replace(log, stamp_ns=log.stamp_ns + since))
    assert [one.start for one in stretches] == pytest.approx([0.0, 0.300, 0.450], abs=1e-12)
    assert [len(one) for one in stretches] == [200, 100, 4]


@pytest.mark.parametrize(("off", "taken"), [(0.0009, True), (0.0011, False)])
def test_a_stamp_within_a_thousandth_of_a_period_lies_on_the_grid(off: float, taken: bool) -> None:
    ms = [float(n) for n in range(30)]
    ms[17] += off
    log = log_at(ms)
    # no line: what is put in between differs
    bent = replace(log, theta=log.theta**3 + np.arange(30) ** 2)
    (whole,) = found(bent)
    assert np.array_equal(whole.theta[:, 17], bent.theta[:, 17]) is taken


LOST = [float(n) for n in range(30) if n not in (12, 13)]
LATE = [0.0, *(n + 0.2 for n in range(1, 11)), 11.0]


@pytest.mark.parametrize(
    ("ms", "at", "nodes"),
    [
        (LOST, 12, [10.0, 11.0, 14.0, 15.0]),
        (LOST, 13, [10.0, 11.0, 14.0, 15.0]),
        (LOST, 11, LOST[10:14]),
        (LATE, 1, LATE[:4]),
        (LATE, 10, LATE[8:]),
    ],
    ids=["lost", "lost too", "there", "first", "last"],
)
def test_a_sample_put_in_between_is_that_of_the_cubic_through_four_neighbours(
    ms: list[float], at: int, nodes: list[float]
) -> None:
    """SciPy's polynomial through them; at the ends of a stretch through the four there."""
    theta = np.random.default_rng(0).standard_normal((2, len(ms)))
    (whole,) = found(replace(log_at(ms), theta=theta))
    assert whole.dt == pytest.approx(1e-3, rel=1e-9)
    cubic = BarycentricInterpolator(np.array(nodes), theta[:, [ms.index(n) for n in nodes]].T)
    np.testing.assert_allclose(whole.theta[:, at], cubic(float(at)), atol=1e-9)


def test_the_period_is_the_mean_of_the_steps_near_the_usual_one() -> None:
    """Stamps in whole tenths of a millisecond, 1.0 and 1.1 by turns.

    a gap of 4 ms counts for nothing.
    """
    steps = [1.0, 1.1] * 50 + [4.0] + [1.0, 1.1] * 50
    (whole,) = found(np.concatenate([[0.0], np.cumsum(steps)]).tolist())
    assert whole.dt == pytest.approx(1.05e-3, rel=1e-9)


def of_lengths(lengths: list[list[int]]) -> Iterator[Segment]:
    """Stretches given as the lengths of the segments they come in.

    a sample's value is its number in all.
    """
    number = 0
    for place, parts in enumerate(lengths):
        for order, length in enumerate(parts):
            values = np.tile(np.arange(number, number + length, dtype=np.float64), (2, 1))
            yield Segment(100.0 * place + 0.1 * number, 0.1, values, values, None, order > 0)
            number += length


@pytest.mark.parametrize(
    ("lengths", "expected"),
    [
        ([[4]], [[4]]),
        ([[10]], [[10]]),
        ([[14]], [[14]]),  # a rest below half a piece joins the last one
        ([[15]], [[10, 5]]),
        ([[25]], [[10, 10, 5]]),
        ([[24]], [[10, 14]]),
        ([[7, 7, 7, 7]], [[10, 10, 8]]),
        ([[30, 3]], [[10, 10, 13]]),
        ([[12], [3], [9, 9]], [[12], [3], [10, 8]]),
    ],
)
def test_pieces_have_the_lengths_that_they_promise(
    lengths: list[list[int]], expected: list[list[int]]
) -> None:
    cut: list[list[int]] = []
    for piece in pieces(of_lengths(lengths), 10):
        if piece.continues:
            cut[-1].append(len(piece))
        else:
            cut.append([len(piece)])
    assert cut == expected


def test_pieces_are_spread_evenly_over_a_log_that_has_many() -> None:
    all_of_it, whole = spread_pieces(of_lengths([[5] * 4]), 3, 5)
    assert whole
    assert [piece.continues for piece in all_of_it] == [False, True, True, True]
    some, whole = spread_pieces(of_lengths([[5] * 50]), 3, 5)
    assert not whole
    assert 3 <= len(some) <= 6
    assert len({round(step, 6) for step in np.diff([piece.start for piece in some])}) == 1
    assert not any(piece.continues for piece in some)
