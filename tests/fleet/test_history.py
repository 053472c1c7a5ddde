"""Drift is found, nothing else is: on simulated fleets, against closed forms and numpy."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import binom, linregress
from scipy.stats import t as student

from algid.base.errors import ResultError
from algid.fleet.figures import overview
from algid.fleet.history import History, history_of, write_history
from algid.fleet.page import verdict
from algid.fleet.tables import change_table, robot_table
from tests.intervals import holds_95
from tests.report.pages import named, typed

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
    found = history.drifts.filter(pl.col("parameter") == "k6")
    assert found["robot"].n_unique() == 20
    assert found["slope"].to_numpy() == pytest.approx(
        0.01, abs=5 * float(found["slope_std"].to_numpy().max())
    )


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_false_alarms_stay_below_one_a_robot_year(tmp_path: Path, scatter: float) -> None:
    history = _history(_jobs(100, 365, seed=2, scatter=scatter), tmp_path)
    # 100 robots a year, 0.084 expected each: Poisson(8.4) passes 25 with probability 1e-6.
    assert history.windows["drift"].sum() <= 25


def test_slopes_of_no_drift_lie_within_their_intervals(tmp_path: Path) -> None:
    """By windows without a month in common, of logs that scatter thrice as much as they say."""
    history = _history(_jobs(60, 365, seed=10, scatter=3.0), tmp_path)
    apart = history.windows.filter(pl.col("month") % 3 == 2)
    slope, std, logs = (apart[name].to_numpy() for name in ("slope", "slope_std", "logs"))
    holds_95(slope / (std * student.ppf(0.975, logs - 2)))
    low, high = binom.interval(0.999, slope.size, 0.01)
    assert low <= np.sum(apart["p"].to_numpy() < 0.01) <= high


def test_a_slope_is_that_of_weighted_least_squares(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    jobs = _jobs(1, 60, seed=3, growth=0.02).with_columns(
        k6_std=pl.Series(rng.uniform(0.002, 0.02, 60))
    )
    last = (
        _history(jobs, tmp_path)
        .windows.filter(pl.col("parameter") == "k6")
        .sort("month")
        .row(-1, named=True)
    )
    t = np.arange(60) / 30.4375
    line = np.polyfit(t, jobs["k6"].to_numpy(), 1, w=1 / jobs["k6_std"].to_numpy())
    assert last["slope"] == pytest.approx(line[0], rel=1e-9)
    assert last["logs"] == 60


def test_outliers_and_wrong_labels_are_told(tmp_path: Path) -> None:
    jobs = _jobs(2, 30, seed=4)
    k3 = jobs["k3"].to_numpy().copy()
    k3[7] = 1.5
    payload = 0.5 + 0.001 * np.random.default_rng(5).standard_normal(60)
    payload[40] = 0.55
    jobs = jobs.with_columns(
        k3=pl.Series(k3), m_p=pl.Series(payload), m_p_std=pl.lit(0.001), label_payload=pl.lit(0.5)
    )
    findings = _history(jobs, tmp_path).findings
    assert findings.select("kind", "job", "parameter").rows() == [
        ("outlier", "j7", "k3"),
        ("payload", "j40", "m_p"),
    ]


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
    assert findings.filter(pl.col("kind") == "payload")["job"].to_list() == wrong


@pytest.mark.parametrize("days", [[0], [0, 0], [0, 0, 0, 0], [0, 20]])
def test_few_logs_and_logs_of_one_instant_have_a_mean_with_its_error(
    days: list[int], tmp_path: Path
) -> None:
    jobs = _jobs(1, len(days), seed=12).with_columns(
        time=pl.Series(
            [START + timedelta(days=day) for day in days], dtype=pl.Datetime("us", "UTC")
        )
    )
    last = _history(jobs, tmp_path).windows.filter(parameter="k2").row(-1, named=True)
    values, count = jobs["k2"].to_numpy(), len(days)
    lines = 1 + (len(set(days)) > 1)
    residual = values - (values.mean() if lines == 1 else values)
    widened = max(1.0, np.sqrt(np.sum(residual**2) / 0.005**2 / max(count - lines, 1)))
    assert last["mean"] == pytest.approx(values.mean(), rel=1e-12)
    assert last["mean_std"] == pytest.approx(widened * 0.005 / np.sqrt(count), rel=1e-9)
    assert not last["drift"]


def test_robots_with_a_log_each_are_drawn_too(tmp_path: Path) -> None:
    history = _history(_jobs(3, 1, seed=13), tmp_path)
    plot = overview(history)
    assert plot is not None
    assert plot.title == "Log by log"
    assert [one["text"] for one in plot.figure.layout["annotations"]][:3] == [
        f"<b>r{n}: k1, kg m²</b>" for n in range(3)
    ]
    dots = named(plot.figure.data, "log")
    assert len(dots) == 12
    jobs = pl.read_parquet(tmp_path / "jobs.parquet")
    assert [typed(one["y"])[0] for one in dots[:3]] == pytest.approx(jobs["k1"].to_list())
    undated = _jobs(2, 2, seed=9).with_columns(time=pl.lit(None, dtype=pl.Datetime("us", "UTC")))
    assert overview(_history(undated, tmp_path)) is None


def test_the_scatter_about_the_line_widens_its_error(tmp_path: Path) -> None:
    last = (
        _history(_jobs(1, 60, seed=7, scatter=4.0), tmp_path)
        .windows.filter(parameter="k2")
        .row(-1, named=True)
    )
    jobs = pl.read_parquet(tmp_path / "jobs.parquet")
    t = np.arange(60) / 30.4375
    # its error is the scatter's, which is four times the intervals'
    found = linregress(t, jobs["k2"].to_numpy())
    assert last["slope_std"] == pytest.approx(found.stderr, rel=1e-9)
    assert last["p"] == pytest.approx(found.pvalue, rel=1e-6)
    calm = (
        _history(_jobs(1, 60, seed=7, scatter=0.25), tmp_path)
        .windows.filter(parameter="k2")
        .row(-1, named=True)
    )
    assert calm["slope_std"] == pytest.approx(
        0.005 / np.sqrt(np.sum((t - t.mean()) ** 2)), rel=1e-9
    )


def test_a_window_holds_three_months(tmp_path: Path) -> None:
    history = _history(_jobs(1, 200, seed=8), tmp_path)
    months = np.floor(np.arange(200) / 30.4375)
    expected = [int(np.sum((months > month - 3) & (months <= month))) for month in range(7)]
    assert history.windows.filter(parameter="k1").sort("month")["logs"].to_list() == expected


def test_what_was_not_tested_is_said_and_its_robots_are_shown(tmp_path: Path) -> None:
    few = _jobs(1, 7, seed=9)
    assert [one.text for one in _history(few, tmp_path).untested] == [
        "Drift was not tested for 1 robot: fewer than 8 dated logs within 3 months."
    ]
    assert _history(_jobs(1, 8, seed=9), tmp_path).untested == []
    undated = _jobs(2, 2, seed=9).with_columns(time=pl.lit(None, dtype=pl.Datetime("us", "UTC")))
    nameless = _jobs(1, 1, seed=9).with_columns(robot=pl.lit(None, dtype=pl.String))
    history = _history(pl.concat([undated, nameless]), tmp_path)
    assert (history.robots, history.logs, history.nameless) == (2, 4, 1)
    assert [(one.numbers["case"], one.numbers["count"]) for one in history.untested] == [
        ("nameless", 1),
        ("undated", 4),
        ("steady", 2),
        ("alone", 2),
    ]
    write_history(history, tmp_path, tmp_path)
    page = (tmp_path / "fleet.html").read_text()
    assert "2 robots · 4 logs" in page
    assert "for want of a robot" in page
    assert [row[0] for row in robot_table(history).rows] == ["r0", "r1"]
    assert {row[2] for row in robot_table(history).rows} == {"not tested"}
    assert all(f">{robot}<" in page for robot in ("r0", "r1"))


def test_a_robot_is_shown_with_what_was_found_of_it(tmp_path: Path) -> None:
    jobs = _jobs(2, 92, seed=1, growth=0.05)
    history = _history(
        jobs.with_columns(m_p=pl.lit(0.4), m_p_std=pl.lit(0.001), label_payload=pl.lit(0.5)),
        tmp_path,
    )
    first = dict(
        zip(
            robot_table(history).columns,
            robot_table(history).rows[0],
            strict=True,
        )
    )
    found = {"Robot": "r0", "Logs": "92", "From": "2026-01-01", "To": "2026-04-02", "Drift": "k6"}
    assert first == found | {"Stand out": "92"}


def test_the_page_escapes_names_and_asks_no_host(tmp_path: Path) -> None:
    jobs = _jobs(1, 92, seed=1, growth=0.05).with_columns(robot=pl.lit("<script>alert(1)</script>"))
    write_history(_history(jobs, tmp_path), tmp_path, tmp_path)
    page = (tmp_path / "fleet.html").read_text()
    assert "<script>alert" not in page
    assert "default-src 'none'" in page
    # the last log is 91 days old: in the third month
    assert pl.read_parquet(tmp_path / "fleet.parquet").height == 7 * 3


def test_a_table_without_robots_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ResultError, match="none of 3 finished jobs has a robot; give each robot's logs a folder"
    ):
        _history(_jobs(1, 3, seed=1).with_columns(robot=pl.lit(None, dtype=pl.String)), tmp_path)
    with pytest.raises(ResultError, match="there is no such file"):
        history_of(tmp_path / "absent.parquet")
    with pytest.raises(
        ResultError, match=r": it is no regular file; expected jobs\.parquet of algid batch$"
    ):
        history_of(tmp_path)


def test_a_panic_of_the_library_is_a_refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A damaged bitmap ends in one, which is no Exception."""

    def panics(*_: object, **__: object) -> None:
        raise pl.exceptions.PanicException("assertion failed: offset + length <= self.length")

    path = tmp_path / "jobs.parquet"
    _jobs(1, 3, seed=1).write_parquet(path)
    monkeypatch.setattr(pl, "read_parquet", panics)
    with pytest.raises(ResultError, match=r"jobs\.parquet: cannot read it \(assertion failed"):
        history_of(path)


def test_each_parameter_is_told_as_it_is_followed(tmp_path: Path) -> None:
    _jobs(1, 40, seed=1).write_parquet(tmp_path / "jobs.parquet")
    calls: list[tuple[str, int, int]] = []
    history_of(tmp_path / "jobs.parquet", lambda *call: calls.append(call))
    assert calls == [("following", place, 7) for place in range(7)]


def test_a_replaced_arm_is_one_change_and_neither_drift_nor_outliers(tmp_path: Path) -> None:
    jobs = _jobs(2, 120, seed=20)
    late = (pl.col("robot") == "r1") & (pl.col("time") >= START + timedelta(days=80))
    replaced = jobs.with_columns(
        pl.when(late).then(pl.col(name) * 1.05).otherwise(pl.col(name)).alias(name)
        for name in ("k1", "k3")
    )
    history = _history(replaced, tmp_path)
    assert history.changes is not None
    assert sorted(history.changes.select("robot", "parameter").rows()) == [
        ("r1", "k1"),
        ("r1", "k3"),
    ]
    first = history.changes.row(0, named=True)
    assert (first["before"], first["after"]) == tuple(START + timedelta(days=d) for d in (79, 80))
    steps = history.changes["step"].to_numpy()
    assert steps == pytest.approx(0.05, abs=5 * 0.005 * np.sqrt(1 / 80 + 1 / 40))
    assert history.findings.height == 0
    # the steps would be drifts of every window that holds them
    assert history.drifts.filter(pl.col("parameter").is_in(["k1", "k3"])).height == 0
    assert "r1 changed at once between 2026-03-21 and 2026-03-22" in " ".join(
        one.text for one in verdict(history).reasons
    )
    (row,) = [row for row in change_table(history).rows if row[1] == "k1"]
    step = history.changes.filter(parameter="k1").row(0, named=True)
    half = 1.96 * step["step_std"] * abs(step["share"] / step["step"]) * 100
    assert row[2:] == (
        "step", f"{100 * step['share']:+.3g} ± {half:.2g}", "%", "2026-03-21 to 2026-03-22",
    )  # fmt: skip
    assert robot_table(history).rows[1][3] == "2026-03-22"
    assert verdict(history).headline.startswith("2 robots, 240 logs: 0 drifts, 1 change and 0 ")
    plot = overview(history)
    assert plot is not None
    panels = [one["text"] for one in plot.figure.layout["annotations"]]
    assert panels == ["<b>r1: k1, kg m²</b>", "<b>r1: k3, kg m²</b>"]
    lines = [one["x0"] for one in plot.figure.layout["shapes"]]
    assert lines == [pytest.approx((START + timedelta(days=80)).timestamp() * 1000)] * 2
    mean = named(plot.figure.data, "mean")[0]
    assert np.count_nonzero(np.isnan(typed(mean["y"]))) == 1  # no line leads across the change
    assert {one["name"] for one in plot.figure.data} == {"log", "mean"}


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_no_change_is_seen_where_there_is_none(tmp_path: Path, scatter: float) -> None:
    """200 lives of 90 logs: a share of 1e-6 of false ones is none of them."""
    history = _history(_jobs(200, 90, seed=21, scatter=scatter), tmp_path)
    assert history.changes is not None
    assert history.changes.height == 0


def test_neither_a_drift_nor_a_wild_log_is_a_change(tmp_path: Path) -> None:
    growing = _history(_jobs(20, 365, seed=22, growth=0.01), tmp_path)
    assert growing.changes is not None
    assert growing.changes.height == 0
    jobs = _jobs(1, 365, seed=23)
    k3 = jobs["k3"].to_numpy().copy()
    k3[200] = 50.0
    wild = _history(jobs.with_columns(k3=pl.Series(k3)), tmp_path)
    assert wild.changes is not None
    assert wild.changes.height == 0
    assert wild.findings["job"].to_list() == ["j200"]


def test_many_robots_of_a_log_each_may_be_one_in_many_folders(tmp_path: Path) -> None:
    one = _jobs(1, 15, seed=24).with_columns(robot=pl.col("job"))
    scattered = _history(one, tmp_path).scattered
    assert scattered is not None
    assert scattered.numbers == {"case": "sessions", "few": 15, "robots": 15, "logs": 2}
    assert "name it in a manifest" in " ".join(
        reason.text for reason in verdict(_history(one, tmp_path)).reasons
    )
    together = one.with_columns(time=pl.lit(START))  # robots of one moment are several
    assert _history(together, tmp_path).scattered is None
    assert _history(_jobs(3, 30, seed=24), tmp_path).scattered is None
