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
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import gammaincc, stdtrit

from algid.base.significance import CERTAIN, sigmas
from algid.fleet.outliers import MAD

FloatArray = NDArray[np.float64]

ALPHA = CERTAIN  # in a robot's life
FEWEST = 4  # logs before a change and after it
CLEAR = sigmas(CERTAIN)  # of its step, for a parameter to be named
_WILD = 6.0  # robust standard deviations, which a single log's estimate counts at most
_LEAST = 1e-300


Change = tuple[int, FloatArray, FloatArray]
"""Between the logs before this place and from it on: the step of each parameter, and its error."""


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
        A row a change and parameter that changed clearly, columns as
        `algid.fleet.outliers.outliers`: job and time are those of the first log after it, `before`
        is the time of the last one before, the value is the step with `half` its 95 % interval,
        expected the estimate before.
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
    found: list[tuple[object, ...]] = []
    for own in np.split(dated, np.flatnonzero(np.diff(robots)) + 1):
        quantile = float(stdtrit(max(own.size - 2, 1), 0.975))
        for at, step, error in _changes(t[own], y[:, own], w[:, own]):
            before, after = own[at - 1 : at + 1].tolist()
            stint[own[at:]] += 1
            sizes = step / np.maximum(error, _LEAST)  # no error is infinite
            clear = np.argsort(-abs(sizes))[: max(1, np.count_nonzero(abs(sizes) >= CLEAR))]
            for place in clear.tolist():
                row = ordered["robot"][after], ordered["job"][after], parameters[place], "step"
                times = ordered["time"][after], ordered["time"][before]
                numbers = step[place], quantile * error[place], y[place, before], sizes[place]
                found.append((*row, *times, *numbers))
    schema: dict[str, Any] = {
        **dict.fromkeys(("robot", "job", "parameter", "kind"), pl.String),
        **dict.fromkeys(("time", "before"), jobs.schema["time"]),
        **dict.fromkeys(("value", "half", "expected", "sigmas"), pl.Float64),
    }
    steps = pl.DataFrame(found, schema=schema, orient="row")
    return ordered.with_columns(stint=pl.Series(stint)), steps


def _changes(t: FloatArray, y: FloatArray, w: FloatArray) -> list[Change]:
    """The changes of one robot, in time order; each part is looked at again by itself."""
    change = change_of(t, y, w)
    if change is None:
        return []
    at = change[0]
    later = _changes(t[at:], y[:, at:], w[:, at:])
    moved = [(at + place, by, std) for place, by, std in later]
    return [*_changes(t[:at], y[:, :at], w[:, :at]), change, *moved]


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
    return place, step, std


def _calmed(y: FloatArray, w: FloatArray) -> FloatArray:
    """The estimates, no single one further from the median than `_WILD` of the usual distances."""
    known = np.where(w > 0, y, np.nan)
    estimated = (w > 0).any(axis=1, keepdims=True)
    known = np.where(estimated, known, 0.0)
    middle = np.nanmedian(known, axis=1, keepdims=True)
    usual = MAD * np.nanmedian(np.abs(known - middle), axis=1, keepdims=True)
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
