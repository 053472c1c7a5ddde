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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import gammaincc

from algid.base.significance import CERTAIN, sigmas

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
    ordered = jobs.sort("robot", "time", nulls_last=False, maintain_order=True)
    y = ordered.select(parameters).fill_null(np.nan).to_numpy().T
    std = ordered.select(f"{name}_std" for name in parameters).fill_null(np.nan).to_numpy().T
    known = np.isfinite(y) & (std > 0)
    w = np.where(known, 1 / np.where(known, std, 1.0) ** 2, 0.0)
    y = np.where(known, y, 0.0)
    t = ordered["time"].dt.epoch("ms").to_numpy().astype(np.float64)
    dated = np.flatnonzero(ordered["time"].is_not_null())
    robots = ordered["robot"].rle_id().to_numpy()[dated]
    stint = np.zeros(len(ordered), dtype=np.int32)
    found: list[dict[str, object]] = []
    for own in np.split(dated, np.flatnonzero(np.diff(robots)) + 1):
        for change in _changes(t[own], y[:, own], w[:, own]):
            before, at = own[change.place - 1 : change.place + 1].tolist()
            stint[own[change.place :]] += 1
            sizes = np.abs(change.step) / np.maximum(change.std, _LEAST)  # no std is infinite
            for place in np.argsort(-sizes)[: max(1, np.count_nonzero(sizes >= CLEAR))].tolist():
                step, level = change.step[place], abs(y[place, before]) or np.nan
                found.append(
                    {
                        "robot": ordered["robot"][at],
                        "before": ordered["time"][before],
                        "after": ordered["time"][at],
                        "job": ordered["job"][at],
                        "parameter": parameters[place],
                        "step": step,
                        "step_std": change.std[place],
                        "share": step / level,
                        "p": change.p,
                    }
                )
    schema: dict[str, Any] = {
        **dict.fromkeys(("robot", "job", "parameter"), pl.String),
        **dict.fromkeys(("before", "after"), jobs.schema["time"]),
        **dict.fromkeys(("step", "step_std", "share", "p"), pl.Float64),
    }
    return ordered.with_columns(stint=pl.Series(stint)), pl.DataFrame(found, schema=schema)


def _changes(t: FloatArray, y: FloatArray, w: FloatArray) -> list[Change]:
    """The changes of one robot, in time order; each part is looked at again by itself."""
    change = change_of(t, y, w)
    if change is None:
        return []
    at = change.place
    late = _changes(t[at:], y[:, at:], w[:, at:])
    later = [replace(one, place=one.place + at) for one in late]
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
    n = t.size
    if n < 2 * FEWEST:
        return None
    y = _calmed(y, w)
    total, moment = w.sum(axis=1, keepdims=True), (w * y).sum(axis=1, keepdims=True)
    y = np.where(w > 0, y - moment / np.maximum(total, _LEAST), 0.0)
    left, sums = np.cumsum(w, axis=1)[:, :-1], np.cumsum(w * y, axis=1)[:, :-1]
    # what the difference of the two means is known by: of information left and right, both needed
    pooled = left * (total - left) / np.maximum(total, _LEAST)
    explained = np.where(pooled > 0, sums**2 / np.maximum(pooled, _LEAST), 0.0)
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
    both, known = pooled[:, at] > 0, np.maximum(pooled[:, at], _LEAST)
    step = np.where(both, -sums[:, at] / known, 0.0)
    std = np.where(both, np.sqrt(scale[:, at] / known), np.inf)
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
