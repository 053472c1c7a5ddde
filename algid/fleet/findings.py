"""What stands out in the life of each robot: steps, drifts, outliers, payloads unlike their labels.

======  =====================================================  =======
symbol  name                                                   shape
======  =====================================================  =======
t       time since the robot's first log, in months            (N,)
y       estimates in time order, NaN where there is none       (P, N)
w       1 / std², 0 where there is no estimate                 (P, N)
gain    what two means explain beyond one, by the first log    (N,)
        after the change, in shares of the scatter about them
======  =====================================================  =======

**Steps.** An arm, a gearbox or a convention that was replaced changes all parameters between the
same two logs. Without a change the gain at one place follows χ² with P degrees of freedom, or a
times that of P / a, where the parameters of a log err alike, as by a warm motor: a = Σ r² / P, of
their correlations r from log to log (Box 1954). The best of N places is held against N times that.
A slow drift is no change: what a line explains must be less. What comes before a change and after
it are two stints, tested for drift and outliers apart.

**Drifts.** A window is `SPAN` months long and ends with each month, so that a year holds twelve
tests a parameter. The slope's error is the one that the intervals give, or the larger one that the
scatter about the line shows; its t test alarms below `ALPHA`. With seven parameters that is 12 × 7
× 0.0009 = 0.076 false alarms a robot-year where estimates scatter independently.

**Outliers.** An estimate is judged by the median of its stint, a payload by its label. Distances
are in standard deviations, times the usual of such distances where that is above one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl
from scipy.special import gammaincc, stdtr, stdtrit

from algid.arm import FloatArray
from algid.base.progress import Progress
from algid.base.significance import CERTAIN, LEVEL, sigmas

KINDS = ("drift", "step", "payload", "outlier")
"""Of findings, in their order."""
CHANGED = CERTAIN  # the p value of a step, in a robot's life
BESIDE = 4  # logs before a step and after it
CLEAR = sigmas(CERTAIN)  # of a step, for a parameter to be named; of a payload unlike its label
SPAN = 3  # months
ALPHA = LEVEL  # the p value of a drift
FEWEST = 8  # logs in a window that is tested
OUTLYING = 6.0  # robust standard deviations; a step counts no log as further away
FINDING = (
    *("kind", "robot", "job", "parameter", "time", "before"),
    *("value", "half", "expected", "sigmas"),
)
ROUNDING = 1e-9  # of all information: less is none
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
        A row a robot, stint (the number of steps before), month and parameter, as `line` gives it;
        p and drift, null where not tested.
    findings : pl.DataFrame
        In the order of `KINDS`, of each the clearest first: kind; robot; job and time, of a drift
        those of its last log, of a step those of the first log after it; before, the time of the
        last log before a step; value, of a drift or a step with `half` its 95 % interval; expected,
        which it is judged by; its distance in sigmas. Of a parameter's drifts the latest is there.
    """
    stints = list[int]()
    jobs = jobs.sort("robot", "time", nulls_last=False, maintain_order=True)
    robots = jobs.partition_by("robot", maintain_order=True)
    for place, own in enumerate(robots):
        if progress is not None:
            progress("following", place, len(robots))
        dated = own.drop_nulls("time")
        y, std = (
            dated.select(f"{name}{end}" for name in parameters).fill_null(np.nan).to_numpy().T
            for end in ("", "_std")
        )
        w = np.where(np.isfinite(y) & (std > 0), std, np.inf) ** -2.0
        at = changes(dated["t"].to_numpy(), np.where(w > 0, y, np.nan), w)
        # logs without a time come first
        stints.extend(
            np.searchsorted(at, np.arange(dated.height - own.height, dated.height), "right")
        )

    jobs = jobs.with_columns(stint=pl.Series(stints, dtype=pl.Int32))
    log, lines, means, found = ("robot", "stint", "job", "time", "t", "month"), [], [], []
    for name in (*parameters, "m_p"):  # one by one, for the memory's sake
        own = jobs.select(
            *log, parameter=pl.lit(name), value=name, std=f"{name}_std", expected="label_payload"
        ).filter(pl.col("std") > 0, pl.col("value").is_finite())
        if name == "m_p":
            found.append(standing_out(own, "payload"))
            continue
        own = own.with_columns(expected=pl.col("value").median().over("robot", "stint"))
        found.append(standing_out(own, "outlier"))
        own = own.drop_nulls("t")
        means.append(line(own, "robot", "stint"))
        ends = own.with_columns(month=pl.int_ranges("month", pl.col("month") + SPAN))
        ends = ends.explode("month").join(own, on=["robot", "stint", "month"], how="semi")
        lines.append(line(ends, "robot", "stint", "month"))

    logs, far = pl.col("logs"), pl.col("value") / pl.col("error")
    p = 2 * stdtr(logs - 2.0, -(pl.col("slope") / pl.col("slope_std")).abs())
    windows = pl.concat(lines).sort("robot", "stint", "parameter", "month")
    windows = windows.with_columns(pl.when(logs >= FEWEST).then(pl.col("slope", "slope_std")))
    windows = windows.with_columns(p=p).with_columns(drift=pl.col("p") < ALPHA)
    drifts = windows.filter("drift").unique(["robot", "parameter"], keep="last")
    drifts = drifts.with_columns(
        kind=pl.lit("drift"),
        value="slope",
        error="slope_std",
        expected="mean",
        time="end",
        job="latest",
    )
    every = pl.concat(means).sort("stint")
    before = every.select(pl.all().shift().over("robot", "parameter"))
    steps = every.with_columns(
        kind=pl.lit("step"),
        value=every["mean"] - before["mean"],
        error=(every["mean_std"] ** 2 + before["mean_std"] ** 2).sqrt(),
        expected=before["mean"],
        before=before["end"],
        logs=logs + before["logs"],
    )
    clear = (far.abs() >= CLEAR) | (far.abs() == far.abs().max().over("robot", "stint"))
    found += drifts, steps.filter(clear)
    half = pl.col("error") * stdtrit(logs - 2.0, 0.975)
    findings = pl.concat(found, how="diagonal_relaxed").with_columns(
        half=half, sigmas=pl.coalesce(far, "sigmas")
    )
    order = pl.col("kind").cast(pl.Enum(KINDS)), -pl.col("sigmas").abs(), "robot", "parameter"
    return windows, findings.select(*FINDING).sort(order)


def line(own: pl.DataFrame, *by: str) -> pl.DataFrame:
    """Lines by weighted least squares, of each group of one parameter's estimates.

    Errors are those of the weights, times the root of the residual's χ² per degree of freedom where
    that is above one.

    Parameters
    ----------
    own : pl.DataFrame
        A row an estimate in time order: parameter, job, time, t, value, std; expected, a number
        near the values of a group.
    by : columns of a group

    Returns
    -------
    pl.DataFrame
        A row a group: parameter; `job` and `time` of its first log, `latest` and `end` of the
        last of `logs` logs; mean, mean_std; slope, slope_std a month, null of logs of one instant.
    """
    # sums alone are taken group by group: polars does those at once, and means of means one by one
    t, y, w = pl.col("t"), pl.col("value") - pl.col("expected"), pl.col("std") ** -2.0
    sums = own.group_by(*by, "parameter", maintain_order=True).agg(
        pl.col("job", "time", "expected").first(),
        end=pl.col("time").last(),
        latest=pl.col("job").last(),
        logs=pl.len().cast(pl.Int64),
        w=w.sum(),
        t=(w * t).sum(),
        y=(w * y).sum(),
        tt=(w * t**2).sum(),
        ty=(w * t * y).sum(),
        yy=(w * y**2).sum(),
    )
    w, t, y = pl.col("w"), pl.col("t") / pl.col("w"), pl.col("y") / pl.col("w")
    spread, cross = pl.col("tt") - w * t**2, pl.col("ty") - w * t * y
    spread = pl.when(spread > ROUNDING * w).then(spread)
    residual = pl.col("yy") - w * y**2 - (cross**2 / spread).fill_null(0.0)
    scale = (residual / (pl.col("logs") - 2).clip(1)).clip(1.0)
    return sums.select(
        *(*by, "parameter", "job", "time", "end", "latest", "logs"),
        mean=pl.col("expected") + y,
        mean_std=(scale / w).sqrt(),
        slope=cross / spread,
        slope_std=(scale / spread).sqrt(),
    )


def standing_out(own: pl.DataFrame, kind: str) -> pl.DataFrame:
    """Outliers of each stint, or payloads unlike what is expected.

    The usual distance is the median of distances from their median, of payloads the lower one: of
    two logs the one that agrees with its label shows how well they can.
    """
    far = pl.col("sigmas")
    off = (pl.col("value") - pl.col("expected")) / pl.col("std")
    apart = (far - far.quantile(0.5, "lower").over("robot", "stint")).abs()
    usual = apart.quantile(0.5, "lower" if kind == "payload" else "linear").over("robot", "stint")
    judged = own.with_columns(sigmas=off, kind=pl.lit(kind)).drop_nulls("sigmas")
    judged = judged.with_columns(far / (MAD * usual).clip(1.0))
    return judged.filter(far.abs() > (CLEAR if kind == "payload" else OUTLYING))


def changes(t: FloatArray, y: FloatArray, w: FloatArray) -> list[int]:
    """Places of the first logs after changes of one robot; each part is looked at again by itself.

    Parameters
    ----------
    t : (N,) float64, increasing, any unit
    y : (P, N) float64, any units
        NaN where there is no estimate.
    w : (P, N) float64
        Weights, 1 / std²; 0 where there is no estimate.
    """
    n, known = t.size, w.any(axis=1)
    if n < 2 * BESIDE or not known.any():
        return []
    y, w = y[known], w[known]
    off = y - np.nanmedian(y, axis=1, keepdims=True)
    reach = OUTLYING * MAD * np.nanmedian(abs(off), axis=1, keepdims=True)
    calm = np.clip(np.nan_to_num(off), -reach, reach)
    total = w.sum(axis=1, keepdims=True)
    calm -= (w * calm).sum(axis=1, keepdims=True) / total
    # what the difference of the two means is known by: of information left and right, both needed
    left, sums = np.cumsum(w, axis=1)[:, :-1], np.cumsum(w * calm, axis=1)[:, :-1]
    pooled = left * (total - left) / total
    explained = sums**2 / np.maximum(pooled, ROUNDING * total)
    squares = (w * calm**2).sum(axis=1, keepdims=True)
    freedom = np.maximum(np.count_nonzero(w, axis=1, keepdims=True) - 2, 1)
    scale = np.maximum((squares - explained) / freedom, 1.0)
    gain = (explained / scale).sum(axis=0)
    at = BESIDE - 1 + int(gain[BESIDE - 1 : n - BESIDE].argmax())
    # how alike parameters err from log to log, as chance alone has them do a little
    apart = np.diff(np.sqrt(w) * calm)
    apart /= np.linalg.norm(apart, axis=1, keepdims=True).clip(ROUNDING)
    alike = ((apart @ apart.T) ** 2).sum() / len(y) - 1.5 * len(y) / n
    half = 0.5 / max(alike, 1.0)
    p = (n - 1) * float(gammaincc(half * len(y), half * gain[at]))
    # what a line explains of the same scatter
    off = t - w @ t[:, None] / total
    spread = np.maximum((w * off**2).sum(axis=1), ROUNDING * total[:, 0])
    sloped = (w * off * calm).sum(axis=1) ** 2 / spread
    if p >= CHANGED or (sloped / scale[:, at]).sum() > gain[at]:
        return []
    cut = at + 1
    later = changes(t[cut:], y[:, cut:], w[:, cut:])
    return [*changes(t[:cut], y[:, :cut], w[:, :cut]), cut, *(cut + place for place in later)]
