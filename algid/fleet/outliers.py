"""Logs that stand out of a robot's history: outlying estimates, payloads unlike their labels."""

from __future__ import annotations

import polars as pl

from algid.base.significance import CERTAIN, sigmas

OUTLYING = 6.0  # robust standard deviations
MISLABELLED = sigmas(CERTAIN)  # one false alarm in a million logs
MAD = 1.4826  # from the median of absolute deviations to a standard deviation


def outliers(jobs: pl.DataFrame, parameter: str, by: tuple[str, ...] = ("robot",)) -> pl.DataFrame:
    """Estimates of `parameter` far from the robot's median, in the larger of two scatters.

    These are the estimate's own standard deviation and the scatter of the history.

    Parameters
    ----------
    jobs : pl.DataFrame
        As `algid.fleet.history.read_jobs` gives them.
    parameter : str
        A column of `jobs`, beside that of its standard deviation.
    by : tuple of str
        Columns that tell the histories apart, that of the robot among them.

    Returns
    -------
    pl.DataFrame
        kind, robot, job, time, parameter, value, expected, sigmas.
    """
    known = jobs.filter((pl.col(f"{parameter}_std") > 0) & pl.col(parameter).is_finite())
    median = pl.col(parameter).median().over(*by)
    distances = pl.col("sigmas").abs().median().over(*by)
    return _far(known, parameter, median, distances, OUTLYING, "outlier")


def mislabelled(jobs: pl.DataFrame) -> pl.DataFrame:
    """Payloads that differ from ``label_payload`` (kg) by more than their intervals explain.

    Columns as `outliers`.

    Where a robot's payloads scatter about each other by more than their intervals say, that
    scatter counts. Medians are the lower ones, so that of two logs the one that agrees with its
    label shows how well they can.
    """
    labelled = jobs.filter((pl.col("m_p_std") > 0) & pl.col("label_payload").is_not_null())
    sigmas = pl.col("sigmas")
    middle = sigmas.quantile(0.5, interpolation="lower").over("robot")
    distances = (sigmas - middle).abs().quantile(0.5, interpolation="lower").over("robot")
    return _far(labelled, "m_p", pl.col("label_payload"), distances, MISLABELLED, "payload")


def _far(
    rows: pl.DataFrame, name: str, expected: pl.Expr, distances: pl.Expr, limit: float, kind: str
) -> pl.DataFrame:
    """Rows that are further than `limit` from what is `expected`.

    Distances are in standard deviations of the estimate, times the usual of the `distances` where
    that is above one.
    """
    away = rows.with_columns(expected=expected).with_columns(
        sigmas=(pl.col(name) - pl.col("expected")) / pl.col(f"{name}_std")
    )
    scaled = pl.col("sigmas") / (MAD * distances).clip(lower_bound=1.0)
    far = away.with_columns(sigmas=scaled).filter(pl.col("sigmas").abs() > limit)
    names = {"kind": pl.lit(kind), "parameter": pl.lit(name), "value": pl.col(name)}
    return far.select("robot", "job", "time", "expected", "sigmas", **names)
