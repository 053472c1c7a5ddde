"""Drift is found, nothing else is: on simulated fleets, against closed forms and numpy."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import t as student

from algid.base.errors import ResultError
from algid.base.text import significant
from algid.fleet.history import History, history_of
from algid.fleet.page import finding_table, overview, robot_table, verdict
from tests.report.pages import named

START = datetime(2026, 1, 1, tzinfo=UTC)
NAMES = tuple(f"k{n}" for n in range(1, 8))


def _jobs(
    robots: int, days: int, seed: int, growth: float = 0.0, scatter: float = 1.0
) -> pl.DataFrame:
    """One log a day: estimates of 1 ± 0.5 %, scattering `scatter` times as much as they say.

    k6 grows a month.
    """
    rng = np.random.default_rng(seed)
    rows = robots * days
    day = np.tile(np.arange(days), robots)
    robot = np.repeat(np.arange(robots), days)
    columns: dict[str, object] = {
        "job": [f"j{row}" for row in range(rows)],
        "robot": [f"r{one}" for one in robot],
        "time": pl.Series(
            [START + timedelta(days=int(one)) for one in day], dtype=pl.Datetime("us", "UTC")
        ),
        "status": ["ok"] * rows,
    }
    for name in NAMES:
        trend = growth * day / 30.4375 if name == "k6" else 0.0
        columns[name] = 1 + trend + scatter * 0.005 * rng.standard_normal(rows)
        columns[f"{name}_std"] = np.full(rows, 0.005)
    return pl.DataFrame(columns)


def _history(jobs: pl.DataFrame, folder: Path) -> History:
    jobs.write_parquet(folder / "jobs.parquet")
    return history_of(folder / "jobs.parquet")


def test_growth_of_a_percent_a_month_is_found_within_three_months(tmp_path: Path) -> None:
    history = _history(_jobs(20, 92, seed=1, growth=0.01), tmp_path)
    found = history.findings.filter(kind="drift", parameter="k6")
    assert found["robot"].n_unique() == 20
    assert found["value"].to_numpy() == pytest.approx(
        0.01, abs=2.6 * float(found["half"].to_numpy().max())
    )


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_false_alarms_stay_below_one_a_robot_year(tmp_path: Path, scatter: float) -> None:
    history = _history(_jobs(100, 365, seed=2, scatter=scatter), tmp_path)
    # 100 robots a year, 0.084 expected each: Poisson(8.4) passes 25 with probability 1e-6.
    assert history.windows["drift"].sum() <= 25


def _payloads(values: list[float], std: float = 0.001) -> pl.DataFrame:
    jobs = _jobs(1, len(values), seed=6)
    return jobs.with_columns(m_p=pl.Series(values), m_p_std=pl.lit(std), label_payload=pl.lit(0.5))


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
    ],
)
def test_a_wrong_label_is_found_however_few_the_logs(
    values: list[float], wrong: list[str], tmp_path: Path
) -> None:
    findings = _history(_payloads(values), tmp_path).findings
    assert sorted(findings.filter(kind="payload")["job"]) == wrong


def test_a_panic_of_the_library_is_a_refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A damaged bitmap ends in one, which is no Exception."""

    def panics(*_: object, **__: object) -> None:
        raise pl.exceptions.PanicException("assertion failed: offset + length <= self.length")

    path = tmp_path / "jobs.parquet"
    _jobs(1, 3, seed=1).write_parquet(path)
    monkeypatch.setattr(pl, "scan_parquet", panics)
    with pytest.raises(ResultError, match=r"jobs\.parquet: cannot read it \(assertion failed"):
        history_of(path)


def test_a_replaced_arm_is_one_change_and_neither_drift_nor_outliers(tmp_path: Path) -> None:
    jobs = _jobs(2, 120, seed=20)
    late = (pl.col("robot") == "r1") & (pl.col("time") >= START + timedelta(days=80))
    replaced = jobs.with_columns(
        pl.when(late).then(pl.col(name) * 1.05).otherwise(pl.col(name)).alias(name)
        for name in ("k1", "k3")
    )
    history = _history(replaced, tmp_path)
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
    assert found["half"].to_numpy() == pytest.approx(student.ppf(0.975, 118) * spread, rel=0.2)
    assert [one.text for one in verdict(history).reasons] == [
        "2 parameters changed at once: k1 of r1 and k3 of r1"
    ]
    (row,) = [row for row in finding_table(history, {}).rows if row[2] == "k1"]
    step = found.filter(parameter="k1").row(0, named=True)
    value, half = (
        significant(100 * step[n] / step["expected"], 2 + (n == "value")) for n in ("value", "half")
    )
    assert row[1:5] == ("r1", "k1", "step", f"{value} ± {half} %")
    assert row[6] == "2026-03-21 to 2026-03-22"
    assert [row[3] for row in robot_table(history, {}).rows] == ["none", "2"]
    assert verdict(history).headline == "2 robots, 240 logs: 2 steps"
    plot = overview(history)
    assert plot is not None
    panels = [one["text"] for one in plot.layout["annotations"]]
    assert panels == ["<b>r1: k1, kg m²</b>", "<b>r1: k3, kg m²</b>"]
    lines = [one["x0"] for one in plot.layout["shapes"]]
    assert lines == [pytest.approx((START + timedelta(days=80)).timestamp() * 1000)] * 2
    assert {one["name"] for one in plot.data} == {"log", "mean"}
    assert len(named(plot.data, "mean")) == 4  # no line leads across the change


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_no_change_is_seen_where_there_is_none(tmp_path: Path, scatter: float) -> None:
    """200 lives of 90 logs: a share of 1e-6 of false ones is none of them."""
    history = _history(_jobs(200, 90, seed=21, scatter=scatter), tmp_path)
    assert not history.findings.filter(kind="step").height


def test_neither_a_drift_nor_a_wild_log_is_a_change(tmp_path: Path) -> None:
    growing = _history(_jobs(20, 365, seed=22, growth=0.01), tmp_path)
    assert not growing.findings.filter(kind="step").height
    jobs = _jobs(1, 365, seed=23)
    k3 = jobs["k3"].to_numpy().copy()
    k3[200] = 50.0
    wild = _history(jobs.with_columns(k3=pl.Series(k3)), tmp_path)
    assert wild.findings.select("kind", "job").rows() == [("outlier", "j200")]


def test_robots_of_a_log_each_may_be_sessions_of_one(tmp_path: Path) -> None:
    one = _history(_jobs(1, 15, seed=24).with_columns(robot=pl.col("job")), tmp_path)
    (alone,) = verdict(one).reasons
    assert (alone.key, alone.numbers["count"]) == ("NOT_TESTED:steady", 15)


def test_estimates_that_end_are_no_change(tmp_path: Path) -> None:
    """Of their information nothing is left behind the last one, but for rounding."""
    jobs = _jobs(50, 40, seed=25)
    day = pl.col("time").rank("dense").over("robot")
    ended = jobs.with_columns(pl.when(day <= 17).then(pl.col("k1", "k1_std")))
    assert not _history(ended, tmp_path).findings.filter(kind="step").height
