"""What is found of a fleet: by hand with weighted least squares and scipy's distributions at each
limit, and on simulated fleets, where nothing is found that is not there.
"""

from __future__ import annotations

import json
import math
import re
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
from algid.fleet.history import History, history_of
from algid.fleet.page import finding_table, overview, robot_table, verdict
from tests.report.pages import named, typed

START = datetime(2026, 1, 1, tzinfo=UTC)
MONTH = 30.4375  # days
STAMP = pl.Datetime("us", "UTC")
NAMES = tuple(f"k{n}" for n in range(1, 8))


def history_in(folder: Path, jobs: pl.DataFrame) -> History:
    """The history of these jobs."""
    jobs.write_parquet(folder / "jobs.parquet")
    return history_of(folder / "jobs.parquet")


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
    return {
        "slope": found[1],
        "slope_std": slope_std,
        "p": p,
        "mean": np.average(y, weights=1 / std**2),
        "mean_std": widened / math.sqrt(np.sum(1 / std**2)),
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
    found = history_in(tmp_path, table(values.tolist(), std.tolist(), time=when)).windows.filter(
        parameter="k1"
    )
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


def test_estimates_without_an_error_bar_or_from_a_prior_count_for_nothing(tmp_path: Path) -> None:
    good = [1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 0.98, 1.01]
    jobs = table([*good, 50.0, math.nan, 50.0], [*[0.01] * 8, 0.0, 0.01, math.nan])
    nothing = jobs.with_columns(
        k1_std=pl.when(pl.col("job") == "j10").then(None).otherwise(pl.col("k1_std"))
    )
    prior = table([*good, 50.0], k1_status=["OK"] * 8 + ["FROM_PRIOR"])
    for one in (jobs.head(10), nothing, prior):
        history = history_in(tmp_path, one)
        (points,) = named(overview(history).data, "log")
        assert np.isfinite(typed(points["y"])).sum() == 8
        found = history.windows.filter(parameter="k1").rows(named=True)[-1]
        assert found["logs"] == 8
        assert found["mean"] == pytest.approx(np.mean(good), rel=1e-12)


def test_what_is_not_finished_is_not_read(tmp_path: Path) -> None:
    status, labels = ["ok", "failed", "incomplete"], ["heavy", "1", "0.5"]
    jobs = table([1.0, 2.0, 3.0], status=status, label_payload=labels)
    found = history_in(tmp_path, jobs).jobs.reverse()
    assert found["job"].to_list() == ["j0", "j2"]
    assert found["label_payload"].to_list() == [None, 0.5]
    assert found["month"].to_list() == [0, 0]
    assert found["t"].to_numpy() == pytest.approx([0, 2 / MONTH], rel=1e-12)


# where half the logs are the median itself the scatter is the intervals' own, never less
AS_TOLD = [0.0] * 7
# deviations of 3 to both sides: 1.4826 times them is one robust deviation; scipy has more digits
ROBUST = float(stats.median_abs_deviation([-3, 3, -3, 3, 0], scale="normal"))
SCATTERED = [-3.0, 3, -3, 3, 0, -3, 3, -3, 3, 0]


@pytest.mark.parametrize(("others", "unit"), [(AS_TOLD, 1.0), (SCATTERED, ROBUST)])
@pytest.mark.parametrize(("away", "told"), [(5.99, False), (6.01, True), (-6.01, True)])
def test_an_outlier_is_six_deviations_away(
    others: list[float], unit: float, away: float, told: bool, tmp_path: Path
) -> None:
    jobs = table([1 + 0.01 * one for one in (*others, away * unit)])
    found = history_in(tmp_path, jobs).findings.filter(kind="outlier")
    assert found["job"].to_list() == [f"j{len(others)}"] * told
    if told:
        value = (1.0 + 0.01 * away * unit, pytest.approx(1.0))
        assert found.select("robot", "parameter", "value", "expected").row(0) == ("r", "k1", *value)
        assert found["sigmas"][0] == pytest.approx(away, rel=1e-3)


@pytest.mark.parametrize("values", [[1.0, 1.2], [1.0, 1.0, 0.9, 1.1]])
def test_logs_that_scatter_as_much_as_each_other_are_no_outliers(
    values: list[float], tmp_path: Path
) -> None:
    """Of two that disagree nobody knows which is odd."""
    assert not history_in(tmp_path, table(values)).findings.filter(kind="outlier").height


def test_drifts_are_the_latest_of_each_robot_and_the_clearest_comes_first(tmp_path: Path) -> None:
    days = 100
    faint = [1 + 0.04 * (day % 2) + 0.0009 * day for day in range(days)]
    clear = [1 + 0.0009 * day for day in range(days)]
    jobs = pl.concat([table(faint), table(clear, robot=["s"] * days)])
    jobs = jobs.with_columns(k2=pl.lit(1.0), k2_std=pl.lit(0.01))
    history = history_in(tmp_path, jobs)
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
    """Ten logs on either side: the gain is 5 (step / std)², at one of 19 places.

    Logs without a date are on neither side.
    """
    gain = stats.chi2.isf(CERTAIN / 19, 1)
    step = 10.0 * math.sqrt(share * gain / 5)
    jobs = table([100.0] * 10 + [100.0 + step] * 10, 10.0)
    undated = table([120.0] * 3, 10.0, time=pl.Series([None] * 3, dtype=STAMP), job=["a", "b", "c"])
    history = history_in(tmp_path, pl.concat([jobs, undated]))
    assert history.jobs["job"][0] == "j19"
    assert history.jobs["time"].tail(3).null_count() == 3
    found = history.findings.filter(kind="step")
    assert found.height == told
    if told:
        assert found.select("job", "expected").row(0) == ("j10", pytest.approx(100.0))
        assert found["value"][0] == pytest.approx(step, rel=1e-9)
        jobs = table([100.0] * 10 + [100.0 + 6 * step] * 10 + [100.0 + 3 * step] * 10, 10.0)
        found = history_in(tmp_path, jobs).findings.filter(kind="step").sort("time")
        assert found["job"].to_list() == ["j10", "j20"]


def fleet(
    robots: int,
    days: int,
    seed: int,
    growth: float = 0.0,
    scatter: float = 1.0,
    alike: float = 0.0,
) -> pl.DataFrame:
    """One log a day: estimates of 1 ± 0.5 %, scattering `scatter` times as much as they say.

    All of a log err by `alike` times that together. k6 grows a month.
    """
    rng = np.random.default_rng(seed)
    rows = robots * days
    day = np.tile(np.arange(days), robots)
    robot = np.repeat(np.arange(robots), days)
    columns: dict[str, object] = {
        "job": [f"j{row}" for row in range(rows)],
        "robot": [f"r{one}" for one in robot],
        "time": pl.Series([START + timedelta(days=int(one)) for one in day], dtype=STAMP),
        "status": ["ok"] * rows,
    }
    common = 0.005 * alike * np.random.default_rng(seed + 1).standard_normal(rows)
    for name in NAMES:
        trend = common + (growth * day / MONTH if name == "k6" else 0.0)
        columns[name] = 1 + trend + scatter * 0.005 * rng.standard_normal(rows)
        columns[f"{name}_std"] = np.full(rows, 0.005)
    return pl.DataFrame(columns)


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_false_alarms_stay_below_one_a_robot_year(tmp_path: Path, scatter: float) -> None:
    history = history_in(tmp_path, fleet(100, 365, seed=2, scatter=scatter))
    # 100 robots a year, 0.084 expected each: Poisson(8.4) passes 25 with probability 1e-6.
    assert history.windows["drift"].sum() <= 25


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ([0.9], ["j0"]),
        ([0.5001, 0.9], ["j1"]),
        ([0.9, 0.5001], ["j0"]),
        ([0.1, 0.4999], ["j0"]),
        ([0.5001, 0.9, 0.4995], ["j1"]),
        ([0.5001, 0.9, 0.4995, 0.5005], ["j1"]),
        ([0.9, 0.9002], ["j0", "j1"]),
        ([0.504, 0.496], []),
        ([0.5, 0.47, 0.53, 0.48, 0.52, 0.51], []),  # their own scatter is what they are judged by
        # one of a million
        ([0.5, 0.5, 0.50492, 0.5, 0.5], []),
        ([0.5, 0.5, 0.50494, 0.5, 0.5], ["j2"]),
        ([0.5, 0.5, 0.49506, 0.5, 0.5], ["j2"]),
    ],
)
def test_a_wrong_label_is_found_however_few_the_logs(
    values: list[float], wrong: list[str], tmp_path: Path
) -> None:
    count = len(values)
    told = {"m_p": values, "m_p_std": [0.001] * count, "label_payload": [0.5] * count}
    found = history_in(tmp_path, table([1.0] * count, **told)).findings.filter(kind="payload")
    assert sorted(found["job"]) == wrong
    for one in found.rows(named=True):
        assert (one["parameter"], one["expected"]) == ("m_p", 0.5)
        assert one["value"] == values[int(one["job"][1:])]
        assert one["sigmas"] == pytest.approx((one["value"] - 0.5) / 0.001, rel=1e-9)


def test_a_replaced_arm_is_one_change_and_neither_drift_nor_outliers(tmp_path: Path) -> None:
    late = (pl.col("robot") == "r1") & (pl.col("time") >= START + timedelta(days=80))
    replaced = pl.when(late).then(pl.col("k1", "k3") * 1.05).otherwise(pl.col("k1", "k3"))
    history = history_in(tmp_path, fleet(2, 120, seed=20).with_columns(replaced))
    found = history.findings  # the steps would be drifts of every window that holds them
    assert sorted(found.select("kind", "robot", "parameter").rows()) == [
        ("step", "r1", "k1"),
        ("step", "r1", "k3"),
    ]
    first = found.row(0, named=True)
    assert (first["before"], first["time"]) == tuple(START + timedelta(days=d) for d in (79, 80))
    assert first["job"] == "j200"
    spread = 0.005 * np.sqrt(1 / 80 + 1 / 40)
    assert found["value"].to_numpy() == pytest.approx(0.05, abs=5 * spread)
    assert found["half"].to_numpy() == pytest.approx(stats.t.ppf(0.975, 118) * spread, rel=0.2)
    assert verdict(history).headline == "2 robots, 240 logs: 2 steps"
    assert [one.text for one in verdict(history).reasons] == [
        "2 parameters changed at once: k1 of r1 and k3 of r1"
    ]
    shown = finding_table(history)
    assert "p < 9e-4; a step" in shown.note
    (row,) = [row for row in shown.rows if row[2] == "k1"]
    assert row[1:4] == ("r1", "k1", "step")
    assert re.fullmatch(r"[45]\.\d+ ± 0\.\d+ %", row[4])
    assert row[6] == "2026-03-21 to 2026-03-22"
    assert [row[3] for row in robot_table(history).rows] == ["none", "2"]
    plot = overview(history)
    lines = [one[end] for one in plot.layout["shapes"] for end in ("x0", "x1")]
    assert lines == [pytest.approx((START + timedelta(days=80)).timestamp() * 1000)] * 4
    assert len(named(plot.data, "mean")) == 4  # no line leads across the change


@pytest.mark.parametrize(("scatter", "alike"), [(1.0, 0.0), (3.0, 0.0), (1.0, 3.0)])
def test_no_change_is_seen_where_there_is_none(
    tmp_path: Path, scatter: float, alike: float
) -> None:
    """200 lives of 90 logs: a share of 1e-6 of false ones is none of them."""
    history = history_in(tmp_path, fleet(200, 90, seed=21, scatter=scatter, alike=alike))
    assert not history.findings.filter(kind="step").height


def test_neither_a_drift_nor_a_wild_log_is_a_change(tmp_path: Path) -> None:
    growing = history_in(tmp_path, fleet(20, 365, seed=22, growth=0.01))
    assert not growing.findings.filter(kind="step").height
    jobs = fleet(1, 365, seed=23)
    k3 = jobs["k3"].to_numpy().copy()
    k3[200] = 50.0
    wild = history_in(tmp_path, jobs.with_columns(k3=pl.Series(k3)))
    assert wild.findings.select("kind", "job").rows() == [("outlier", "j200")]


def test_a_large_fleet_is_cut_and_what_was_not_tested_is_named(tmp_path: Path) -> None:
    jobs = fleet(1, 203, seed=24).with_columns(
        robot=pl.when(pl.col("job") != "j0").then("job"),
        time=pl.when(pl.col("job") != "j1").then("time"),
        status=pl.when(pl.col("job") != "j2").then("status").otherwise(pl.lit("failed")),
    )
    history = history_in(tmp_path, jobs)
    reasons = verdict(history).reasons
    told = [("failed", 1), ("nameless", 1), ("undated", 1), ("steady", 201)]
    assert [(one.case, one.numbers["count"]) for one in reasons] == told
    assert json.loads(history.as_json())["untested"] == [one.text for one in reasons]
    table, plot = robot_table(history), overview(history)
    assert (len(table.rows), table.note) == (200, "201 robots; the first 200 are shown.")
    assert table.rows[0] == ("j1", "j1", "1", "not tested", "–", "–")
    assert plot is not None
    assert len(plot.layout["annotations"]) == 12


def test_estimates_that_end_are_no_change(tmp_path: Path) -> None:
    """Of their information nothing is left behind the last one, but for rounding."""
    jobs = fleet(50, 40, seed=25)
    day = pl.col("time").rank("dense").over("robot")
    ended = jobs.with_columns(pl.when(day <= 17).then(pl.col("k1", "k1_std")))
    assert not history_in(tmp_path, ended).findings.filter(kind="step").height
