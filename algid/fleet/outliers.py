"""Logs that stand out of a robot's history: outlying estimates, payloads unlike their labels."""

from __future__ import annotations

import polars as pl

from algid.base.significance import CERTAIN, sigmas

OUTLYING = 6.0  # robust standard deviations
MISLABELLED = sigmas(CERTAIN)  # one false alarm in a million logs
_MAD = 1.4826  # from the median of absolute deviations to a standard deviation


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
    std = pl.col(f"{parameter}_std")
    scaled = jobs.filter((std > 0) & pl.col(parameter).is_finite()).with_columns(
        pl.col(parameter).median().over(*by).alias("expected")
    )
    scaled = scaled.with_columns(((pl.col(parameter) - pl.col("expected")) / std).alias("sigmas"))
    scatter = (_MAD * pl.col("sigmas").abs().median().over(*by)).clip(lower_bound=1.0)
    far = scaled.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > OUTLYING)
    return _as_findings(far, "outlier", parameter)


def mislabelled(jobs: pl.DataFrame) -> pl.DataFrame:
    """Payloads that differ from ``label_payload`` (kg) by more than their intervals explain.

    Columns as `outliers`.

    Where a robot's payloads scatter about each other by more than their intervals say, that
    scatter counts. Medians are the lower ones, so that of two logs the one that agrees with its
    label shows how well they can.
    """
    labelled = jobs.filter(
        (pl.col("m_p_std") > 0) & pl.col("label_payload").is_not_null()
    ).with_columns(
        pl.col("label_payload").alias("expected"),
        ((pl.col("m_p") - pl.col("label_payload")) / pl.col("m_p_std")).alias("sigmas"),
    )
    middle = pl.col("sigmas").quantile(0.5, interpolation="lower").over("robot")
    centred = (pl.col("sigmas") - middle).abs().quantile(0.5, interpolation="lower")
    scatter = (_MAD * centred.over("robot")).clip(lower_bound=1.0)
    wrong = labelled.with_columns(pl.col("sigmas") / scatter).filter(
        pl.col("sigmas").abs() > MISLABELLED
    )
    return _as_findings(wrong, "payload", "m_p")


def _as_findings(rows: pl.DataFrame, kind: str, name: str) -> pl.DataFrame:
    return rows.select(
        pl.lit(kind).alias("kind"),
        "robot",
        "job",
        "time",
        pl.lit(name).alias("parameter"),
        pl.col(name).alias("value"),
        "expected",
        "sigmas",
    )
