"""What stands out in the life of each robot: steps, drifts, outliers, payloads unlike their labels.

======  =====================================================  =======
symbol  name                                                   shape
======  =====================================================  =======
t       time since the robot's first log, in months            (N,)
y       estimates in time order, each in its unit              (P, N)
w       1 / std², 0 where there is no estimate                 (P, N)
gain    what two means explain beyond one, by the first log    (N,)
        after the change, in shares of the scatter about them
======  =====================================================  =======

**Steps.** An arm, a gearbox or a convention that was replaced changes all parameters between the
same two logs. Without a change the gain at one place follows χ² with P degrees of freedom; the best
of N places is held against N times that. A slow drift is no change: what a line explains must be
less. What comes before a change and after it are two stints, tested for drift and outliers apart.

**Drifts.** A window is `SPAN` months long and ends with each month, so that a year holds twelve
tests a parameter. The slope's error is the one that the intervals give, or the larger one that the
scatter about the line shows; its t test alarms below `ALPHA`. With seven parameters that is 12 × 7
× 0.0009 = 0.076 false alarms a robot-year where estimates scatter independently.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from scipy.special import gammaincc, stdtr, stdtrit

from algid.arm import FloatArray
from algid.base.progress import Progress
from algid.base.significance import CERTAIN, LEVEL, sigmas

Change = tuple[int, FloatArray, FloatArray]
"""Between the logs before this place and from it on: the step of each parameter, and its error."""

CHANGED = CERTAIN  # the p value of a step, in a robot's life
BESIDE = 4  # logs before a step and after it
WILD = 6.0  # robust standard deviations, which a single log's estimate counts at most
CLEAR = sigmas(CERTAIN)  # of a step, for a parameter to be named; of a payload unlike its label
SPAN = 3  # months
ALPHA = LEVEL  # the p value of a drift
FEWEST = 8  # logs in a window that is tested
OUTLYING = 6.0  # robust standard deviations
MAD = 1.4826  # from the median of absolute deviations to a standard deviation


def followed(
    jobs: pl.DataFrame, parameters: Sequence[str], progress: Progress | None = None
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Means and slopes over `SPAN` months, and what was found.

    Parameters
    ----------
    jobs : pl.DataFrame
        As `algid.fleet.history.read_jobs` gives them.
    parameters : names of columns, beside those of their standard deviations
    progress : callable
        Hears how many robots have been followed.

    Returns
    -------
    windows : pl.DataFrame
        A row a robot, stint (the number of steps before), month and parameter: `end` is the time of
        the last of `logs` logs; mean, mean_std, slope, slope_std (a month) and p, NaN where not
        tested; drift.
    findings : pl.DataFrame
        Drifts, each robot's and parameter's latest, steps, and logs that stand out, of each kind
        the clearest first: kind; robot; job and time, of a drift those of its latest log, of a step
        those of the first log after it; before, the time of the last log before a step; value, with
        `half` its 95 % interval; expected, which it is judged by; its distance in sigmas.
    """
    lines, steps, stints = list[Any](), list[Any](), list[int]()
    ordered = jobs.sort("robot", "time", nulls_last=False, maintain_order=True)
    robots = ordered.partition_by("robot", maintain_order=True)
    for place, own in enumerate(robots):
        if progress is not None:
            progress("following", place, len(robots))
        y, std = (
            own.select(f"{name}{end}" for name in parameters).fill_null(np.nan).to_numpy().T
            for end in ("", "_std")
        )
        w = np.where(np.isfinite(y) & (std > 0), std, np.inf) ** -2.0
        y = np.where(w > 0, y, 0.0)
        t, month = own["t"].to_numpy(), own["month"].to_numpy()  # NaN of a log without a time
        undated, robot, times = own["time"].null_count(), own["robot"][0], own["time"]
        stint, quantile = np.zeros(t.size, int), stdtrit(max(t.size - undated - 2, 1), 0.975)
        for at, step, error in changes(t[undated:], y[:, undated:], w[:, undated:]):
            after = undated + at
            stint[after:] += 1
            far = _ratio(step, error)
            most = max(1, np.count_nonzero(abs(far) >= CLEAR))
            for k in np.argsort(-abs(far))[:most].tolist():
                log = "step", robot, own["job"][after], parameters[k], times[after]
                numbers = step[k], quantile * error[k], y[k, after - 1], far[k]
                steps.append((*log, times[after - 1], *numbers))
        for number, last in sorted(set(zip(stint[undated:], month[undated:], strict=True))):
            inside = (stint == number) & (month > last - SPAN) & (month <= last)
            logs = np.count_nonzero(w[:, inside], axis=1)
            end = times[int(np.flatnonzero(inside)[-1])]
            numbers = line(t[inside], y[:, inside], w[:, inside])
            lines.append((robot, int(number), parameters, int(last), end, logs, *numbers))
        stints += stint.tolist()

    stamp = jobs.schema["time"]
    series = dict.fromkeys(("mean", "mean_std", "slope", "slope_std"), pl.List(pl.Float64))
    schema: dict[str, Any] = {
        "robot": pl.String, "stint": pl.Int32, "parameter": pl.List(pl.String), "month": pl.Int32,
        "end": stamp, "logs": pl.List(pl.Int64), **series,
    }  # fmt: skip
    windows = pl.DataFrame(lines, schema=schema, orient="row")
    windows = windows.explode("parameter", "logs", *series).filter(pl.col("logs") > 0)
    logs, slope, slope_std = windows.select("logs", "slope", "slope_std").to_numpy().T
    tested = (logs >= FEWEST) & np.isfinite(slope_std)
    slope, slope_std = np.where(tested, (slope, slope_std), np.nan)
    p = 2 * stdtr(np.maximum(logs - 2, 1), -abs(slope / slope_std))
    tests = {"slope": slope, "slope_std": slope_std, "p": p, "drift": p < ALPHA}
    windows = windows.with_columns(pl.Series(name, of) for name, of in tests.items())

    last = windows.filter("drift").sort("month").group_by("robot", "parameter").last()
    last = last.join(ordered.group_by("robot").agg(pl.col("job").last()), on="robot")
    drifts = last.sort("p", "robot", "parameter").with_columns(
        kind=pl.lit("drift"),
        time="end",
        value="slope",
        half=pl.col("slope_std") * stdtrit(pl.col("logs") - 2.0, 0.975),
        expected="mean",
        sigmas=pl.col("slope") / pl.col("slope_std"),
    )
    schema = dict.fromkeys(("kind", "robot", "job", "parameter"), pl.String)
    schema |= dict.fromkeys(("time", "before"), stamp)
    schema |= dict.fromkeys(("value", "half", "expected", "sigmas"), pl.Float64)
    found = [drifts, pl.DataFrame(steps, schema=schema, orient="row")]
    found.append(standing_out(ordered.with_columns(stint=pl.Series(stints)), parameters))
    return windows, pl.concat(found, how="diagonal_relaxed").select(list(schema))


def standing_out(jobs: pl.DataFrame, parameters: Sequence[str]) -> pl.DataFrame:
    """Outliers of each stint, and payloads unlike ``label_payload`` (kg), the furthest first.

    Distances are in standard deviations of the estimate, times the usual of such distances where
    that is above one. Of payloads that is the lower median: of two logs the one that agrees with
    its label shows how well they can.
    """
    log, parts = ("robot", "stint", "job", "time", "label_payload"), []
    for name in (*parameters, "m_p"):
        part = jobs.select(*log, parameter=pl.lit(name), value=name, std=f"{name}_std")
        parts.append(part.filter(pl.col("std") > 0, pl.col("value").is_finite()))
    every, history = pl.concat(parts), ("robot", "stint", "parameter")
    labelled = every.filter(pl.col("label_payload").is_not_null(), parameter="m_p")
    away, middle = pl.col("sigmas"), pl.col("sigmas").quantile(0.5, "lower").over("robot")
    found = []
    for kind, rows, expected, usual, limit in (
        (
            "outlier",
            every.filter(pl.col("parameter") != "m_p"),
            pl.col("value").median().over(history),
            away.abs().median().over(history),
            OUTLYING,
        ),
        (
            "payload",
            labelled,
            pl.col("label_payload"),
            (away - middle).abs().quantile(0.5, "lower").over("robot"),
            CLEAR,
        ),
    ):
        off = (pl.col("value") - pl.col("expected")) / pl.col("std")
        rows = rows.with_columns(expected=expected).with_columns(sigmas=off)
        rows = rows.with_columns(away / (MAD * usual).clip(lower_bound=1.0), kind=pl.lit(kind))
        found.append(rows.filter(away.abs() > limit))
    return pl.concat(found).sort(away.abs(), descending=True)


def changes(t: FloatArray, y: FloatArray, w: FloatArray) -> list[Change]:
    """The changes of one robot, in time order; each part is looked at again by itself.

    Parameters
    ----------
    t : (N,) float64, increasing, any unit
    y : (P, N) float64, any units
    w : (P, N) float64
        Weights, 1 / std²; 0 where there is no estimate.
    """
    n = t.size
    if n < 2 * BESIDE:
        return []
    known = np.where(w > 0, y, np.nan)
    middle = _medians(known)
    reach = WILD * MAD * _medians(abs(known - middle))
    calm = np.where(w > 0, np.clip(y, middle - reach, middle + reach), 0.0)
    total = w.sum(axis=1, keepdims=True)
    calm = np.where(w > 0, calm - _ratio((w * calm).sum(axis=1, keepdims=True), total), 0.0)
    # what the difference of the two means is known by: of information left and right, both needed
    left, sums = np.cumsum(w, axis=1)[:, :-1], np.cumsum(w * calm, axis=1)[:, :-1]
    pooled = _ratio(left * (total - left), total)
    explained = _ratio(sums**2, pooled)
    squares = (w * calm**2).sum(axis=1, keepdims=True)
    freedom = np.maximum(np.count_nonzero(w, axis=1, keepdims=True) - 2, 1)
    scale = np.maximum((squares - explained) / freedom, 1.0)
    gain = (explained / scale).sum(axis=0)
    at = BESIDE - 1 + int(gain[BESIDE - 1 : n - BESIDE].argmax())
    p = (n - 1) * float(gammaincc(len(y) / 2, gain[at] / 2))
    _, _, slope, slope_std = line(t, calm, w)
    if p >= CHANGED or np.nansum((slope / slope_std) ** 2) > gain[at]:
        return []
    step, error = -_ratio(sums[:, at], pooled[:, at]), _error(pooled[:, at] / scale[:, at])
    cut = at + 1
    later = changes(t[cut:], y[:, cut:], w[:, cut:])
    moved = [(cut + place, of, std) for place, of, std in later]
    return [*changes(t[:cut], y[:, :cut], w[:, :cut]), (cut, step, error), *moved]


def line(
    t: FloatArray, y: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean, its error, slope and its error (P,), each of weighted least squares.

    Errors are those of the weights, times the root of the residual's χ² per degree of freedom where
    that is above one. Of logs of one instant the slope has no error: NaN.
    """
    total = w.sum(axis=1)
    mean = _ratio((w * y).sum(axis=1), total)
    off, left = t - _ratio(w @ t, total)[:, None], y - mean[:, None]
    spread = (w * off**2).sum(axis=1)
    spread = np.where(spread > 1e-9 * total, spread, 0.0)
    slope = _ratio((w * off * left).sum(axis=1), spread)
    squares = (w * (left - slope[:, None] * off) ** 2).sum(axis=1)
    freedom = np.count_nonzero(w, axis=1) - 1 - (spread > 0)
    scale = np.maximum(squares / np.maximum(freedom, 1), 1.0)
    return mean, _error(total / scale), slope, _error(spread / scale)


def _error(information: FloatArray) -> FloatArray:
    """Standard deviations of so much information, NaN of none."""
    return 1 / np.sqrt(np.where(information > 0, information, np.nan))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """`above` over `below`, 0 where that is 0."""
    out = np.zeros(np.broadcast_shapes(above.shape, below.shape))
    return np.divide(above, below, out=out, where=below > 0)


def _medians(known: FloatArray) -> FloatArray:
    """The median (P, 1) of each row, 0 of one without a number."""
    empty = np.isnan(known).all(axis=1, keepdims=True)
    return np.asarray(np.nanmedian(np.where(empty, 0.0, known), axis=1, keepdims=True))
