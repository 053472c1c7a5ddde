"""Changes at once: an arm, a gearbox or a convention that was replaced between two logs of a robot.

======  =====================================================  =========
symbol  name                                                   shape
======  =====================================================  =========
y       estimates in time order, wild ones drawn in            (P, N)
w       1 / std², 0 where there is no estimate                 (P, N)
gain    what two means explain beyond one, by the first log     (N,)
        after the change, in shares of the scatter about them
======  =====================================================  =========

All parameters of a robot change between the same two logs. Without a change the gain at one place
follows χ² with P degrees of freedom; the best of N places is held against N times that. A slow
drift is no change: what a line explains must be less. What comes before a change and after it are
two histories, tested for drift and for outliers apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.significance import CERTAIN, sigmas

if TYPE_CHECKING:
    import polars as pl

FloatArray = NDArray[np.float64]

ALPHA = CERTAIN  # in a robot's life
FEWEST = 4  # logs before a change and after it
CLEAR = sigmas(CERTAIN)  # of its step, for a parameter to be named
_WILD = 6.0  # robust standard deviations, which a single log's estimate counts at most
_MAD = 1.4826
_LEAST = 1e-300


@dataclass(frozen=True, eq=False)
class Change:
    """Between logs `place` - 1 and `place` of those that were given.

    P, and by parameter its step and the step's error.
    """

    place: int
    p: float
    step: FloatArray
    std: FloatArray


def with_stints(jobs: pl.DataFrame, parameters: Sequence[str]) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The jobs with a column ``stint``, the number of changes before each log, and the changes.

    Parameters
    ----------
    jobs : pl.DataFrame
        As `algid.fleet.history.read_jobs` gives them. A log without a time is of the first stint.
    parameters : names of columns, beside those of their standard deviations

    Returns
    -------
    jobs : pl.DataFrame
    changes : pl.DataFrame
        A row a change and parameter that changed clearly: robot, before and after (times of the
        logs on either side), job (the first one after it), parameter, step and step_std (in the
        parameter's unit), share (the step over the estimate before), p (of the change).
    """
    import polars as pl

    ordered = jobs.sort("robot", "time", nulls_last=False, maintain_order=True)
    dated = ordered["time"].is_not_null().to_numpy()
    robots = ordered["robot"].rle_id().to_numpy()
    y = np.stack([_numbers(ordered[name]) for name in parameters])
    std = np.stack([_numbers(ordered[f"{name}_std"]) for name in parameters])
    known = np.isfinite(y) & (std > 0)
    w = np.where(known, 1 / np.where(known, std, 1.0) ** 2, 0.0)
    y = np.where(w > 0, y, 0.0)
    stint = np.zeros(len(ordered), dtype=np.int32)
    rows: list[dict[str, object]] = []
    edges = np.flatnonzero(np.diff(robots, prepend=-1, append=-1))
    t = ordered["time"].dt.epoch("ms").to_numpy().astype(np.float64)
    for first, last in pairwise(edges.tolist()):
        own = np.arange(first, last)[dated[first:last]]
        for change in _changes(t[own], y[:, own], w[:, own]):
            at = own[change.place]
            stint[own[change.place :]] += 1
            rows += _rows_of(ordered, change, at, own[change.place - 1], parameters, y)
    kinds: dict[str, Any] = dict.fromkeys(("robot", "job", "parameter"), pl.String())
    kinds |= dict.fromkeys(("before", "after"), jobs.schema["time"])
    kinds |= dict.fromkeys(("step", "step_std", "share", "p"), pl.Float64())
    frame = pl.DataFrame(rows, schema=kinds)
    return ordered.with_columns(stint=pl.Series(stint)), frame


def _numbers(column: pl.Series) -> FloatArray:
    return np.asarray(column.fill_null(float("nan")).to_numpy(), dtype=np.float64)


def _rows_of(
    jobs: pl.DataFrame,
    change: Change,
    at: int,
    before: int,
    parameters: Sequence[str],
    y: FloatArray,
) -> Iterator[dict[str, object]]:
    sizes = np.abs(change.step) / np.maximum(change.std, _LEAST)
    sizes = np.where(np.isfinite(change.std), sizes, 0.0)
    for place in np.argsort(-sizes):
        if sizes[place] < CLEAR and place != sizes.argmax():
            continue
        level = abs(y[place, before]) or np.nan
        yield {
            "robot": jobs["robot"][int(at)],
            "before": jobs["time"][int(before)],
            "after": jobs["time"][int(at)],
            "job": jobs["job"][int(at)],
            "parameter": parameters[place],
            "step": float(change.step[place]),
            "step_std": float(change.std[place]),
            "share": float(change.step[place] / level),
            "p": change.p,
        }


def _changes(t: FloatArray, y: FloatArray, w: FloatArray) -> list[Change]:
    """The changes of one robot, in time order; each part is looked at again by itself."""
    change = change_of(t, y, w)
    if change is None:
        return []
    at = change.place
    late = _changes(t[at:], y[:, at:], w[:, at:])
    later = [Change(one.place + at, one.p, one.step, one.std) for one in late]
    return [*_changes(t[:at], y[:, :at], w[:, :at]), change, *later]


def change_of(t: FloatArray, y: FloatArray, w: FloatArray) -> Change | None:
    """The clearest change of a robot's estimates; None where chance or a drift explains it.

    Parameters
    ----------
    t : (N,) float64, increasing, any unit
    y : (P, N) float64, any units
    w : (P, N) float64
        Weights, 1 / std²; 0 where there is no estimate.
    """
    from scipy.special import gammaincc

    n = t.size
    if n < 2 * FEWEST:
        return None
    y = _calmed(y, w)
    total, moment = w.sum(axis=1, keepdims=True), (w * y).sum(axis=1, keepdims=True)
    y = np.where(w > 0, y - moment / np.maximum(total, _LEAST), 0.0)
    left, sums = np.cumsum(w, axis=1)[:, :-1], np.cumsum(w * y, axis=1)[:, :-1]
    right = total - left
    both = (left > 0) & (right > 0)
    explained = np.where(
        both, sums**2 * (1 / np.maximum(left, _LEAST) + 1 / np.maximum(right, _LEAST)), 0.0
    )
    squares = (w * y * y).sum(axis=1, keepdims=True)
    freedom = np.maximum((w > 0).sum(axis=1, keepdims=True) - 2, 1)
    scale = np.maximum((squares - explained) / freedom, 1.0)
    gain = (explained / scale).sum(axis=0)
    place = FEWEST + int(gain[FEWEST - 1 : n - FEWEST].argmax())
    best = gain[place - 1]
    p = min((n - 1) * float(gammaincc(y.shape[0] / 2, best / 2)), 1.0)
    if p >= ALPHA or _line(t, y, w, squares, freedom) > best:
        return None
    at = place - 1
    step = np.where(both[:, at], -sums[:, at] / np.maximum(left[:, at], _LEAST), 0.0)
    step += np.where(both[:, at], -sums[:, at] / np.maximum(right[:, at], _LEAST), 0.0)
    information = left[:, at] * right[:, at] / np.maximum(total[:, 0], _LEAST)
    std = np.where(both[:, at], np.sqrt(scale[:, at] / np.maximum(information, _LEAST)), np.inf)
    return Change(place, p, step, std)


def _calmed(y: FloatArray, w: FloatArray) -> FloatArray:
    """The estimates, no single one further from the median than `_WILD` of the usual distances."""
    known = np.where(w > 0, y, np.nan)
    estimated = (w > 0).any(axis=1, keepdims=True)
    known = np.where(estimated, known, 0.0)
    middle = np.nanmedian(known, axis=1, keepdims=True)
    usual = _MAD * np.nanmedian(np.abs(known - middle), axis=1, keepdims=True)
    return np.where(w > 0, np.clip(y, middle - _WILD * usual, middle + _WILD * usual), 0.0)


def _line(
    t: FloatArray, y: FloatArray, w: FloatArray, squares: FloatArray, freedom: FloatArray
) -> float:
    """What a line by parameter explains beyond a mean, in shares of the scatter about it."""
    total = np.maximum(w.sum(axis=1, keepdims=True), _LEAST)
    off = t - (w * t).sum(axis=1, keepdims=True) / total
    spread = (w * off * off).sum(axis=1, keepdims=True)
    explained = (w * off * y).sum(axis=1, keepdims=True) ** 2 / np.maximum(spread, _LEAST)
    scale = np.maximum((squares - explained) / freedom, 1.0)
    return float((explained / scale).sum())
