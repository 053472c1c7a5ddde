"""Single logs that stand out: outliers of a robot's history, and payloads that are not what their labels say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from algid.fleet.windows import parameters_in

if TYPE_CHECKING:
    import polars as pl

OUTLYING = 6.0  # robust standard deviations
MISLABELLED = 5.0  # standard deviations: one false alarm in 1.7 million logs
_MAD = 1.4826  # from the median of absolute deviations to a standard deviation


def outliers(jobs: pl.DataFrame) -> pl.DataFrame:
    """Estimates far from their robot's median, in the larger of their own and the history's scatter.

    Columns: kind, robot, job, time, parameter, value, expected, sigmas.
    """
    import polars as pl

    found = [_far(jobs, name) for name in parameters_in(jobs)]
    return pl.concat(found) if found else _nothing(jobs)


def _far(jobs: pl.DataFrame, name: str) -> pl.DataFrame:
    import polars as pl

    scaled = jobs.filter((pl.col(f"{name}_std") > 0) & pl.col(name).is_finite()).with_columns(
        pl.col(name).median().over("robot").alias("expected")
    )
    scaled = scaled.with_columns(((pl.col(name) - pl.col("expected")) / pl.col(f"{name}_std")).alias("sigmas"))
    scatter = (_MAD * pl.col("sigmas").abs().median().over("robot")).clip(lower_bound=1.0)
    far = scaled.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > OUTLYING)
    return _as_findings(far, "outlier", name)


def mislabelled(jobs: pl.DataFrame) -> pl.DataFrame:
    """Payloads that differ from ``label_payload`` (kg) by more than their intervals explain; columns as `outliers`."""
    import polars as pl

    if not {"label_payload", "m_p", "m_p_std"} <= set(jobs.columns) or jobs["label_payload"].dtype != pl.Float64:
        return _nothing(jobs)
    told = jobs.filter((pl.col("m_p_std") > 0) & pl.col("label_payload").is_not_null()).with_columns(
        pl.col("label_payload").alias("expected"),
        ((pl.col("m_p") - pl.col("label_payload")) / pl.col("m_p_std")).alias("sigmas"),
    )
    centred = (pl.col("sigmas") - pl.col("sigmas").median().over("robot")).abs()
    scatter = (_MAD * centred.median().over("robot")).clip(lower_bound=1.0)
    wrong = told.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > MISLABELLED)
    return _as_findings(wrong, "payload", "m_p")


def _as_findings(rows: pl.DataFrame, kind: str, name: str) -> pl.DataFrame:
    import polars as pl

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


def _nothing(jobs: pl.DataFrame) -> pl.DataFrame:
    import polars as pl

    empty = jobs.head(0).with_columns(expected=pl.lit(np.nan), sigmas=pl.lit(np.nan), nothing=pl.lit(np.nan))
    return _as_findings(empty, "payload", "nothing").with_columns(parameter=pl.lit("m_p"))
