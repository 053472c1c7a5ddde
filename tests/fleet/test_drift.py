"""Windows, drift, outliers and labels by hand: weighted least squares, scipy's distributions, each
limit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy import stats

from algid.base.errors import ResultError
from algid.base.significance import CERTAIN
from algid.fleet.history import history_of, read_jobs

START = datetime(2026, 1, 1, tzinfo=UTC)
MONTH = 30.4375  # days
STAMP = pl.Datetime("us", "UTC")


def table(
    values: Sequence[float], std: Sequence[float] | float = 0.01, **others: Any
) -> pl.DataFrame:
    """A robot's k1, a day apart, as `algid batch` writes it.

    `others` replace columns or add them.
    """
    count = len(values)
    columns = {
        "job": [f"j{row}" for row in range(count)],
        "robot": ["r"] * count,
        "time": pl.Series([START + timedelta(days=row) for row in range(count)], dtype=STAMP),
        "status": ["ok"] * count,
        "k1": pl.Series(values, dtype=pl.Float64),
        "k1_std": pl.Series([std] * count if isinstance(std, float) else std, dtype=pl.Float64),
    }
    return pl.DataFrame(columns | others)


def read(jobs: pl.DataFrame, folder: Path) -> pl.DataFrame:
    jobs.write_parquet(folder / "jobs.parquet")
    return read_jobs(folder / "jobs.parquet")


def followed(jobs: pl.DataFrame, folder: Path) -> pl.DataFrame:
    """k1's windows."""
    jobs.write_parquet(folder / "jobs.parquet")
    return history_of(folder / "jobs.parquet").windows.filter(parameter="k1")


def standing_out(jobs: pl.DataFrame, folder: Path, kind: str) -> pl.DataFrame:
    """What is found of one kind."""
    jobs.write_parquet(folder / "jobs.parquet")
    return history_of(folder / "jobs.parquet").findings.filter(kind=kind)


def weighted_line(t: np.ndarray, y: np.ndarray, std: np.ndarray) -> dict[str, float]:
    """Weighted least squares by its normal equations, its errors widened by χ² per degree of
    freedom above one.
    """
    design = np.stack([np.ones(t.size), t], axis=1)
    normal = design.T @ (design / std[:, None] ** 2)
    found = np.linalg.solve(normal, design.T @ (y / std**2))
    freedom = t.size - 2
    widened = max(1.0, math.sqrt(np.sum(((y - design @ found) / std) ** 2) / freedom))
    slope_std = widened * math.sqrt(np.linalg.inv(normal)[1, 1])
    p = 2 * stats.t.sf(abs(found[1]) / slope_std, freedom)
    mean, mean_std = (
        np.sum(y / std**2) / np.sum(1 / std**2),
        widened / math.sqrt(np.sum(1 / std**2)),
    )
    return {
        "slope": found[1],
        "slope_std": slope_std,
        "p": p,
        "mean": mean,
        "mean_std": mean_std,
        "logs": t.size,
    }


@pytest.mark.parametrize(("scatter", "growth"), [(0.3, 0.0), (1.0, 0.01), (5.0, 0.1)])
def test_every_window_is_weighted_least_squares_with_students_test(
    scatter: float, growth: float, tmp_path: Path
) -> None:
    draw = np.random.default_rng(7)
    days = np.sort(draw.choice(200, 90, replace=False))
    days -= days[0]
    std = draw.uniform(0.005, 0.02, days.size)
    values = 3 + growth * days / MONTH + scatter * std * draw.standard_normal(days.size)
    when = pl.Series([START + timedelta(days=int(day)) for day in days], dtype=STAMP)
    found = followed(table(values.tolist(), std.tolist(), time=when), tmp_path)
    month = np.floor(days / MONTH).astype(int)
    assert found["month"].to_list() == sorted(set(month.tolist()))
    for row in found.rows(named=True):
        inside = (month <= row["month"]) & (month > row["month"] - 3)
        expected = weighted_line(days[inside] / MONTH, values[inside], std[inside])
        # sums of moments about the robot's first log: rounding is that of t² Σw, some 1e-16 × 40 ×
        # 60
        assert {name: row[name] for name in expected} == pytest.approx(
            expected, rel=1e-8, abs=1e-15
        )
        assert row["end"] == START + timedelta(days=int(days[inside][-1]))
        assert row["drift"] == (expected["p"] < 1e-3)
    assert found["drift"].any() == (growth / scatter > 0.001 and growth > 0)


def test_estimates_without_an_error_bar_count_for_nothing(tmp_path: Path) -> None:
    good = [1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 0.98, 1.01]
    jobs = table([*good, 50.0, math.nan, 50.0], [*[0.01] * 8, 0.0, 0.01, math.nan])
    nothing = jobs.with_columns(
        k1_std=pl.when(pl.col("job") == "j10").then(None).otherwise(pl.col("k1_std"))
    )
    for one in (jobs.head(10), nothing):
        found = followed(one, tmp_path).rows(named=True)[-1]
        assert found["logs"] == 8
        assert found["mean"] == pytest.approx(np.mean(good), rel=1e-12)


def test_what_is_not_finished_is_not_read(tmp_path: Path) -> None:
    found = read(table([1.0, 2.0, 3.0], status=["ok", "failed", "incomplete"]), tmp_path)
    assert found["job"].to_list() == ["j0", "j2"]
    assert found["month"].to_list() == [0, 0]
    assert found["t"].to_numpy() == pytest.approx([0, 2 / MONTH], rel=1e-12)


@pytest.mark.parametrize("value", [1e308, 1e-200, math.nan])
@pytest.mark.parametrize("column", ["k1", "k1_std", "label_payload"])
def test_numbers_beyond_all_bounds_are_no_estimates(
    column: str, value: float, tmp_path: Path
) -> None:
    jobs = table([1.0] * 12, m_p=[0.5] * 12, m_p_std=[0.1] * 12, label_payload=[0.5] * 12)
    changed = pl.when(pl.col("job") == "j3").then(pl.lit(value)).otherwise(column).alias(column)
    jobs.with_columns(changed).write_parquet(tmp_path / "jobs.parquet")
    history = history_of(tmp_path / "jobs.parquet")
    assert history.jobs.filter(job="j3")[column].to_list() == [None]
    assert not history.findings.filter(kind="step").height
    json.loads(history.as_json())


@pytest.mark.parametrize(("away", "told"), [(5.99, False), (6.01, True), (-6.01, True)])
def test_an_outlier_is_six_deviations_away(away: float, told: bool, tmp_path: Path) -> None:
    """Where half the logs are the median itself the scatter is the intervals' own, never less."""
    found = standing_out(table([1.0] * 7 + [1.0 + 0.01 * away]), tmp_path, "outlier")
    assert found.height == told
    if told:
        expected = ("outlier", "r", "j7", "k1", 1.0 + 0.01 * away, 1.0)
        assert (
            found.select("kind", "robot", "job", "parameter", "value", "expected").row(0)
            == expected
        )
        assert found["sigmas"][0] == pytest.approx(away, rel=1e-9)


@pytest.mark.parametrize(("away", "told"), [(5.99, False), (6.01, True)])
def test_logs_that_scatter_are_judged_by_their_scatter(
    away: float, told: bool, tmp_path: Path
) -> None:
    """Deviations of 3 standard deviations to both sides: 1.4826 times them is one robust
    deviation.
    """
    # scipy has more digits of 1.4826
    robust = stats.median_abs_deviation([-3, 3, -3, 3, 0], scale="normal")
    values = [1 + 0.01 * one for one in (-3, 3, -3, 3, 0, -3, 3, -3, 3, away * robust)]
    jobs = table([*values, 1.0])
    assert jobs["k1"].median() == pytest.approx(1.0, abs=1e-12)
    found = standing_out(jobs, tmp_path, "outlier")
    assert found["job"].to_list() == (["j9"] if told else [])


@pytest.mark.parametrize(("payload", "told"), [(0.50492, False), (0.50494, True), (0.49506, True)])
def test_a_label_is_wrong_once_in_a_million(payload: float, told: bool, tmp_path: Path) -> None:
    jobs = table(
        [1.0] * 5, m_p=[0.5, 0.5, payload, 0.5, 0.5], m_p_std=[0.001] * 5, label_payload=[0.5] * 5
    )
    found = standing_out(jobs, tmp_path, "payload")
    assert found["job"].to_list() == (["j2"] if told else [])
    if told:
        assert found.select("kind", "parameter", "value", "expected").row(0) == (
            "payload",
            "m_p",
            payload,
            0.5,
        )
        assert found["sigmas"][0] == pytest.approx((payload - 0.5) / 0.001, rel=1e-9)


def test_drifts_are_the_latest_of_each_robot_and_the_clearest_comes_first(tmp_path: Path) -> None:
    days = 100
    faint = [1 + 0.04 * (day % 2) + 0.0009 * day for day in range(days)]
    clear = [1 + 0.0009 * day for day in range(days)]
    jobs = pl.concat([table(faint), table(clear, robot=["s"] * days)])
    jobs = jobs.with_columns(k2=pl.lit(1.0), k2_std=pl.lit(0.01))
    jobs.write_parquet(tmp_path / "jobs.parquet")
    history = history_of(tmp_path / "jobs.parquet")
    found = history.findings
    assert found.select("kind", "robot", "parameter").rows() == [
        ("drift", "s", "k1"),
        ("drift", "r", "k1"),
    ]
    assert abs(found["sigmas"][0]) > abs(found["sigmas"][1])
    last = history.windows.filter(robot="s", parameter="k1").row(-1, named=True)
    half = stats.t.ppf(0.975, last["logs"] - 2) * last["slope_std"]
    assert found.select("value", "half", "expected", "time").row(0) == (
        last["slope"], pytest.approx(half), last["mean"], last["end"],
    )  # fmt: skip
    plain = json.loads(history.as_json())
    assert [row["robot"] for row in plain["findings"]] == ["s", "r"]
    assert plain["robots"][0]["first"].startswith("2026-01-01")


COLUMNS = "expected jobs.parquet of algid batch"
NONE = "no job has given parameters; see its column reason, and run algid batch again"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda jobs: jobs.drop("time"), f"no column time; {COLUMNS}"),
        (lambda jobs: jobs.drop("robot", "job"), f"no column job, robot; {COLUMNS}"),
        (lambda jobs: jobs.drop("k1"), NONE),
        (lambda jobs: jobs.drop("k1_std"), NONE),
        (lambda jobs: jobs.with_columns(status=pl.lit("failed")), NONE),
        (
            lambda jobs: jobs.with_columns(robot=pl.lit(None, dtype=pl.String)),
            (
                "none of 3 finished jobs has a robot; give each robot's logs a folder of "
                "their own, or name robots in a manifest, and run algid batch again"
            ),
        ),
    ],
)
def test_tables_that_tell_nothing_are_refused_in_one_line(
    change: Any, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "jobs.parquet"
    change(table([1.0, 2.0, 3.0])).write_parquet(path)
    with pytest.raises(ResultError) as raised:
        history_of(path)
    assert str(raised.value) == f"{path}: {told}"


def test_a_file_that_is_no_table_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "jobs.parquet"
    path.write_text("job,robot\n")
    with pytest.raises(
        ResultError,
        match=r"jobs\.parquet: cannot read it \(.+\); expected jobs\.parquet of algid batch$",
    ) as raised:
        history_of(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("share", "told"), [(0.999, False), (1.001, True)])
def test_a_step_is_what_two_means_explain_once_in_a_million_lives(
    share: float, told: bool, tmp_path: Path
) -> None:
    """Ten logs on either side: the gain is 5 (step / std)², at one of 19 places."""
    gain = stats.chi2.isf(CERTAIN / 19, 1)
    step = 0.01 * math.sqrt(share * gain / 5)
    found = standing_out(table([1.0] * 10 + [1.0 + step] * 10), tmp_path, "step")
    assert found.height == told
    if told:
        assert found.select("job", "expected").row(0) == ("j10", pytest.approx(1.0))
        assert found["value"][0] == pytest.approx(step, rel=1e-9)
