"""Figures against what they are drawn from: closed forms, NumPy's own linear algebra, files
written by hand.
"""

from __future__ import annotations

import base64
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.report.figures.base import Figure, Missing, Panel, between, label, packed, times
from algid.report.figures.convergence import convergence
from algid.report.figures.correlation import correlation, correlation_matrix
from algid.report.figures.coverage import coverage
from algid.report.figures.inertia import inertia
from algid.report.figures.information import information
from algid.report.figures.innovations import (
    CORRELATION,
    SPECTRUM,
    TORQUE,
    Curve,
    _round_ticks,
    innovations,
)
from algid.report.figures.running import running
from algid.report.figures.timeline import chained, offsets, separators, short, views
from algid.report.figures.torque import Scored, closeup, signals, torque
from algid.report.gallery import drawable
from algid.report.series import LogRange, TorqueLog, read_scored, read_torque
from algid.results import Estimate, Result, TorquePrediction


def values(typed: dict[str, str]) -> FloatArray:
    """What stands behind a typed array, by NumPy alone."""
    return np.frombuffer(base64.b64decode(typed["bdata"]), dtype=f"<{typed['dtype']}").astype(
        np.float64
    )


def drawn(made: Figure | Missing) -> Figure:
    assert isinstance(made, Figure)
    return made


def with_fit(result: Result, **changes: object) -> Result:
    assert result.fit is not None
    return result.model_copy(update={"fit": result.fit.model_copy(update=changes)})


def with_parameters(result: Result, **numbers: float | None) -> Result:
    found = {name: Estimate(estimate=value, unit="kg m^2") for name, value in numbers.items()}
    return result.model_copy(update={"parameters": {**result.parameters, **found}})


@given(st.lists(st.floats(-1e30, 1e30), min_size=1, max_size=20))
def test_numbers_travel_in_single_precision_and_double_where_that_is_not_enough(
    numbers: list[float],
) -> None:
    given_values = np.array(numbers)
    np.testing.assert_allclose(values(packed(given_values)), given_values, rtol=6e-8, atol=1e-38)
    np.testing.assert_array_equal(values(packed(given_values, precise=True)), given_values)
    beyond = np.append(given_values, 1e300)
    np.testing.assert_array_equal(values(packed(beyond)), beyond)


@pytest.mark.parametrize(
    ("start", "period", "kind"), [(0.0, 1e-3, "f4"), (1e5, 1e-3, "f8"), (1e5, 10.0, "f4")]
)
def test_neighbouring_times_stay_apart(start: float, period: float, kind: str) -> None:
    x = start + period * np.arange(100)
    made = times(x)
    assert made["dtype"] == kind
    np.testing.assert_allclose(np.diff(values(made)), period, rtol=0.02)
    assert times(np.empty(0))["dtype"] == "f4"


def test_an_area_lies_between_its_two_edges() -> None:
    x, low, high = np.arange(3.0), np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0])
    first, second = between(x, low, high, "@blue", "band")
    np.testing.assert_array_equal(values(first["y"]), low)
    np.testing.assert_array_equal(values(second["y"]), high)
    assert ("fill" in first, second["fill"], second["fillcolor"]) == (False, "tonexty", "@blue")
    assert first["legendgroup"] == second["legendgroup"] == "band"
    assert "legendgroup" not in between(x, low, high, "@blue")[0]


def test_a_label_is_never_markup_and_never_long() -> None:
    assert label("a<b>&c") == "a&lt;b&gt;&amp;c"
    assert label("x" * 41) == "x" * 39 + "…"
    assert label("x" * 40) == "x" * 40
    assert label("y" * 9, 8) == "y" * 7 + "…"


RANGES = {0: LogRange(0.0, 2.0, 200), 1: LogRange(5.0, 8.0, 300), 2: LogRange(1.0, 1.5, 50)}


def test_logs_follow_one_another_a_hundredth_of_the_whole_apart(result: Result) -> None:
    moved = offsets(RANGES)
    ends = [(moved[log] + span.first, moved[log] + span.last) for log, span in RANGES.items()]
    assert ends[0] == (0.0, 2.0)
    space = 0.01 * (2.0 + 3.0 + 0.5)
    assert [after[0] - before[1] for before, after in pairwise(ends)] == pytest.approx([space] * 2)
    logs = [result.log.model_copy(update={"path": f"{name}.csv"}) for name in "ab"]
    # more series than logs
    assert [name for name, *_ in views(RANGES, logs)] == [
        "a.csv",
        "b.csv",
        "log 3",
    ]
    shown = separators(RANGES, moved, logs)
    assert [shape["x0"] for shape in shown["shapes"]] == pytest.approx([end[0] for end in ends[1:]])
    assert [note["text"] for note in shown["annotations"]] == ["a.csv", "b.csv", "log 3"]
    assert shown["margin"]["t"] > 22  # the template's
    many = {log: LogRange(0.0, 1.0) for log in range(30)}
    runs = [result.log.model_copy(update={"path": f"/d/run_{n:02}.csv"}) for n in range(30)]
    crowded = separators(many, offsets(many), runs)
    assert len(crowded["shapes"]) == 29
    # every log keeps its name, less what all names share
    assert [note["text"] for note in crowded["annotations"]] == [f"{n:02}" for n in range(30)]
    assert short(["a.csv", "b.csv"]) == ["a", "b"]
    assert short(["run", "run-1"]) == ["run", "run-1"]
    assert short(["x-143339.csv", "x-143524.csv"]) == ["143339", "143524"]
    assert separators({0: RANGES[0]}, moved, logs) == {}


def test_a_chained_line_breaks_between_logs() -> None:
    series = {
        1: (np.array([5.0, 6.0]), np.array([3.0, 4.0])),
        0: (np.array([0.0, 1.0]), np.array([1.0, 2.0])),
    }
    x, y = chained(series, {0: 0.0, 1: -3.0})
    np.testing.assert_array_equal(x, [0, 1, 1, 2, 3, 3])
    np.testing.assert_array_equal(y, [1, 2, np.nan, 3, 4, np.nan])
    assert chained({}, {})[0].size == 0


def test_correlations_are_those_of_numpy_and_unknown_where_a_variance_is() -> None:
    root = np.random.default_rng(3).normal(size=(4, 4))
    covariance = root @ root.T
    std = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(
        correlation_matrix(covariance.tolist()), covariance / np.outer(std, std), rtol=1e-12
    )
    known: list[list[float | None]] = [[4.0, 3.0, None], [3.0, 9.0, 0.0], [None, 0.0, -1.0]]
    found = correlation_matrix(known)
    np.testing.assert_allclose(found[:2, :2], [[1.0, 0.5], [0.5, 1.0]], rtol=1e-12)
    assert np.isnan(found[2]).all()
    assert np.isnan(found[:, 2]).all()


def test_strong_pairs_are_named_once_with_their_sign(result: Result) -> None:
    names = ["k1", "k2", "k3"]
    covariance = [[1.0, -0.96, 0.2], [-0.96, 1.0, 0.95], [0.2, 0.95, 1.0]]
    figure = drawn(correlation(with_fit(result, covariance=covariance, covariance_names=names)))
    assert figure.note == "Correlated beyond 0.95: k1 and k2 (-0.960)."  # 0.95 itself is not beyond
    trace = figure.panels[0].traces[0]
    np.testing.assert_allclose(values(trace["z"]).reshape(3, 3), covariance, rtol=1e-7)
    assert trace["x"] == trace["y"] == names
    assert (trace["zmin"], trace["zmax"], trace["texttemplate"]) == (-1, 1, "%{z:.2f}")
    lost: list[list[float | None]] = [[1.0, None, 0.0], [None, None, None], [0.0, None, 1.0]]
    figure = drawn(correlation(with_fit(result, covariance=lost, covariance_names=names)))
    assert (
        figure.note
        == "No pair is correlated beyond 0.95. What is not identifiable has no correlation."
    )
    many = [f"k{place}" for place in range(15)]
    figure = drawn(
        correlation(with_fit(result, covariance=np.eye(15).tolist(), covariance_names=many))
    )
    assert "texttemplate" not in figure.panels[0].traces[0]


@pytest.mark.parametrize(("k1", "k3", "k5"), [(0.05, 0.2, 0.3), (0.4, 0.1, 0.1), (0.0, 0.03, 0.02)])
def test_the_smallest_eigenvalue_is_that_of_numpy_over_all_of_theta2(
    result: Result, k1: float, k3: float, k5: float
) -> None:
    figure = drawn(inertia(with_parameters(result, k1=k1, k3=k3, k5=k5), None))
    theta2 = np.linspace(-np.pi, np.pi, 181)
    cosine = np.cos(theta2)
    m11, m12, m22 = k5 + k3 + 2 * k1 * cosine, k3 + k1 * cosine, np.full(181, k3)  # eq. (2)
    matrices = np.stack([np.stack([m11, m12], axis=-1), np.stack([m12, m22], axis=-1)], axis=-2)
    smallest = float(np.linalg.eigvalsh(matrices).min())
    definite = "M is positive definite for every θ2"
    expected = (
        definite if smallest > 0 else "M is not positive definite for every θ2, which no arm is"
    )
    assert figure.note.startswith(expected + ";")
    assert float(figure.note.split("eigenvalue is ")[1].split()[0]) == pytest.approx(
        smallest, rel=6e-3
    )
    curves = [trace for trace in figure.panels[0].traces if "fill" not in trace]
    for trace, part in zip(curves, (m11, m12, m22), strict=True):
        np.testing.assert_allclose(values(trace["y"]), part, rtol=1e-6, atol=1e-9)
    assert figure.panels[0].layout["shapes"] == []  # no log tells where it went


def test_bands_of_the_mass_matrix_are_as_wide_as_draws_of_the_constants(result: Result) -> None:
    assert result.fit is not None
    covariance: FloatArray = np.zeros((7, 7))
    place = [result.fit.covariance_names.index(name) for name in ("k1", "k3", "k5")]
    root = np.array([[1e-2, 0, 0], [5e-3, 8e-3, 0], [-4e-3, 2e-3, 6e-3]])
    covariance[np.ix_(place, place)] = root @ root.T
    made = with_fit(
        with_parameters(result, k1=0.05, k3=0.2, k5=0.3), covariance=covariance.tolist()
    )
    traces = [
        trace
        for trace in drawn(inertia(made, None)).panels[0].traces
        if trace.get("fill") == "toself"
    ]
    draws = np.array([0.05, 0.2, 0.3]) + np.random.default_rng(8).normal(size=(4_000, 3)) @ root.T
    cosine = np.cos(np.linspace(-np.pi, np.pi, 181))
    k1, k3, k5 = draws.T[:, :, None]
    for trace, part in zip(
        traces, (k5 + k3 + 2 * k1 * cosine, k3 + k1 * cosine, k3 + 0 * cosine), strict=True
    ):
        edge = values(trace["y"])
        half = 0.5 * (edge[:181] - edge[:180:-1])
        # 4,000 draws: a standard error of 1.1 %
        np.testing.assert_allclose(half, 1.96 * part.std(axis=0), rtol=0.06)
    lost: list[list[float | None]] = covariance.tolist()
    lost[place[0]][place[1]] = None
    bare = drawn(inertia(with_fit(made, covariance=lost), None))
    assert len(bare.panels[0].traces) == 3
    assert isinstance(inertia(with_parameters(result, k3=None), None), Missing)


def test_where_the_logs_went_is_grey(result: Result, case_folder: Path) -> None:
    found = read_torque(case_folder / "torque.parquet")
    (shape,) = drawn(inertia(result, found)).panels[0].layout["shapes"]
    theta2 = np.degrees(pl.read_parquet(case_folder / "torque.parquet")["theta2"].to_numpy())
    assert (shape["x0"], shape["x1"]) == pytest.approx(
        (max(theta2.min(), -180), min(theta2.max(), 180))
    )


def _log(motion: FloatArray) -> TorqueLog:
    names = ("theta1", "theta2", "omega1", "omega2")
    ends = {
        name: (float(row.min()), float(row.max())) for name, row in zip(names, motion, strict=True)
    }
    return TorqueLog({}, {}, motion, ends, (1.0, 1.0), (0.1, 0.1), 0, {}, reduced=False)


def test_an_angle_that_turned_round_is_shown_within_a_turn_and_another_is_not() -> None:
    turns = np.linspace(0.0, 4 * np.pi, 400)
    figure = coverage(_log(np.stack([turns, 1.4 * np.pi * np.sin(turns), turns, -turns])))
    cloud = figure.panels[0].traces[0]
    shown = values(cloud["x"])
    assert -180 <= shown.min() < shown.max() <= 180
    difference = np.radians(shown) - turns
    np.testing.assert_allclose(difference, 2 * np.pi * np.rint(difference / (2 * np.pi)), atol=1e-5)
    np.testing.assert_allclose(
        values(cloud["y"]), np.degrees(1.4 * np.pi * np.sin(turns)), rtol=1e-6, atol=1e-4
    )
    assert "θ1 0 to 720°" in figure.note
    assert "Angles that turned round are shown within ±180°." in figure.note
    still = coverage(_log(np.stack([turns / 8] * 4)))
    assert "turned" not in still.note


def test_an_angle_of_which_no_sample_is_a_number_is_drawn_without_a_warning() -> None:
    turns = np.linspace(0.0, 4 * np.pi, 400)
    figure = coverage(_log(np.stack([np.full(400, np.nan), turns, turns, turns])))
    assert np.isnan(values(figure.panels[0].traces[0]["x"])).all()


def _parquet(path: Path, **columns: Any) -> Path:
    pl.DataFrame(columns).write_parquet(path)
    return path


def test_information_adds_up_and_the_note_tells_the_poorest(result: Result, tmp_path: Path) -> None:
    t = np.arange(1300.0)
    even, late = np.ones(1300), np.where(t >= 1287, 1.0, 0.0)
    path = _parquet(
        tmp_path / "information.parquet",
        log=np.zeros(1300, np.int32),
        t=t,
        k1=even,
        k2=late,
        k3=0 * t,
    )
    figure = drawn(information(path, result))
    trace = figure.panels[0].traces[0]
    rows, columns = (int(part) for part in trace["z"]["shape"].split(","))
    assert (rows, columns) == (3, 434)  # three seconds a cell, so that 600 are not passed
    shares = values(trace["z"]).reshape(rows, columns)
    np.testing.assert_allclose(shares.sum(axis=1), [100.0, 100.0, 0.0], rtol=1e-4)
    np.testing.assert_allclose(values(trace["x"])[:3], [1.5, 4.5, 7.5])
    assert trace["y"] == ["k1", "k2", "k3"]
    # 3 of 434 cells
    assert figure.note == "Half of what is known of k2 comes from 0.69 % of the time."
    short = _parquet(
        tmp_path / "short.parquet", log=[0, 0], t=[0.0, 1.0], k1=[1.0, 2.0], k2=[2.0, 1.0]
    )
    assert drawn(information(short, result)).note == ""
    bare = _parquet(tmp_path / "bare.parquet", log=[0], t=[0.0])
    assert information(bare, result) == Missing(
        "information", "Information per second of log", "bare.parquet holds no second"
    )


def test_what_has_no_prediction_shows_its_spectra_and_ticks(result: Result, tmp_path: Path) -> None:
    x = np.array([1.0, 10.0, 100.0])
    rows = [
        (quantity, joint, float(at), value, low, high)
        for joint in (1, 2)
        for quantity, series, low, high in (
            (TORQUE, (1.0, 0.1, 0.01 / joint**20), np.nan, np.nan),
            (SPECTRUM, (1e-3, 1e-3, 1e-3), np.nan, np.nan),
            (CORRELATION, (0.5, 0.0, -0.5), -0.1, 0.1),
        )
        for at, value in zip(x, series, strict=True)
    ]
    names = ["quantity", "joint", "x", "value", "low", "high"]
    path = tmp_path / "innovations.parquet"
    pl.DataFrame(rows, schema=names, orient="row").write_parquet(path)
    figure = drawn(innovations(path, with_fit(result, whiteness={}, intervals="sandwich")))
    assert [panel.title for panel in figure.panels][:2] == [
        "Joint 1: spectrum",
        "Joint 1: autocorrelation",
    ]
    assert "far below grey" in figure.reading
    assert [entry.words for entry in figure.legend][
        1
    ] == "measured torque, through the same windows"
    few, many = (figure.panels[place].layout["yaxis"] for place in (0, 2))
    assert few["nticks"] == 5  # three powers of ten
    assert many["dtick"] == 2  # joint 2: eight
    assert figure.panels[0].layout["xaxis"]["range"] == [0.0, 2.0]
    assert figure.note == (
        "Inside the band: 1 of 3 and 1 of 3 correlations of joints 1 and 2. "
        "The refined estimator takes no noise to be white: the intervals allow for colour."
    )
    assert figure.panels[1].layout["xaxis"]["title"]["text"] == "lag, s"  # the last ends at 100 s
    no_fit = drawn(innovations(path, result.model_copy(update={"fit": None})))
    assert no_fit.note == "Inside the band: 1 of 3 and 1 of 3 correlations of joints 1 and 2."
    pl.DataFrame(rows, schema=names, orient="row").filter(
        pl.col("quantity") == TORQUE
    ).write_parquet(path)
    short = innovations(path, result)
    assert isinstance(short, Missing)
    assert short.why == "the logs are too short to tell noise from colour"


@pytest.mark.parametrize(("joint", "moment"), [(1, 1.234), (2, 0.1)])
def test_the_worst_moment_is_shown_sample_by_sample(
    case_folder: Path, result: Result, tmp_path: Path, joint: int, moment: float
) -> None:
    rows = pl.read_parquet(case_folder / "torque.parquet")
    knock = (pl.col("t") - moment).abs() < 5e-4
    name = f"tau{joint}"
    changed = rows.with_columns(
        pl.when(knock & (pl.col("log") == 1))
        .then(pl.col(name) + 9.0)
        .otherwise(pl.col(name))
        .alias(name)
    )
    path = tmp_path / "torque.parquet"
    changed.write_parquet(path)
    found = read_torque(path)
    panel = drawn(closeup(path, found, result.logs)).panels[joint - 1]
    near = changed.filter((pl.col("log") == 1) & pl.col("t").is_between(moment - 0.5, moment + 0.5))
    measured, predicted, residual = (values(trace["y"]) for trace in panel.traces)
    np.testing.assert_allclose(measured, near[name].to_numpy(), rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(
        residual, (near[name] - near[f"{name}_predicted"]).to_numpy(), rtol=1e-5, atol=1e-6
    )
    assert measured.size == predicted.size == (1001 if moment > 0.5 else 601)
    assert panel.says.startswith(f"Joint {joint}, largest residual ")
    assert panel.says.endswith(f" at {moment:.3f} s of case1-loaded.mcap")
    path.write_bytes(b"PAR1 nothing")
    with pytest.raises(ResultError, match="cannot read it"):
        closeup(path, found, result.logs)


def test_torques_and_signals_hold_the_extremes_of_their_logs(
    case_folder: Path, result: Result
) -> None:
    found = read_torque(case_folder / "torque.parquet")
    rows = pl.read_parquet(case_folder / "torque.parquet")
    made = signals(found, result.logs)
    for panel, name in zip(made.panels, ("theta", "omega", "tau"), strict=True):
        for joint, trace in enumerate(panel.traces, start=1):
            shown, whole = values(trace["y"]), rows[f"{name}{joint}"].to_numpy()
            assert (np.nanmin(shown), np.nanmax(shown)) == pytest.approx(
                (whole.min(), whole.max()), rel=1e-6
            )
        both = rows.select(f"{name}1", f"{name}2").to_numpy()
        assert f"{both.min():.4g} to {both.max():.4g}" in panel.says
    first, _ = torque(found, result.logs).panels
    assert [trace.get("yaxis", "y") for trace in first.traces] == ["y", "y", "y2"]
    rms = float(np.sqrt(np.mean(rows["tau1"].to_numpy() ** 2)))
    assert f"RMS {rms:.3g} N m; residual" in first.says


def test_the_first_figure_draws_what_is_scored_and_hides_what_was_recorded(
    case_folder: Path, result: Result, tmp_path: Path
) -> None:
    found = read_torque(case_folder / "torque.parquet")
    t = np.arange(0.3, 9.7, 0.02)
    predicted = {f"tau{j}_predicted": np.sin(t + j) for j in (1, 2)}
    measured = {f"tau{j}": np.sin(t + j) + 0.1 * j for j in (1, 2)}
    path = _parquet(
        tmp_path / "scored.parquet", log=np.zeros(t.size, np.int32), t=t, **measured, **predicted
    )
    score = TorquePrediction(
        rmse=(0.1, 0.2), nrmse=(0.1, 0.2), r2=(0.99, 0.98), filter="", bandwidth=5.0
    )
    made = torque(found, result.logs, Scored(read_scored(path), score))
    assert made.title == "Measured and predicted torque below 5 Hz"
    assert [(entry.group, entry.shown) for entry in made.legend] == [
        ("measured", True),
        ("predicted", True),
        ("residual", True),
        ("as recorded", False),
    ]
    for joint, panel in enumerate(made.panels, start=1):
        by_group: dict[str, list[Any]] = {}
        for trace in panel.traces:
            by_group.setdefault(trace["legendgroup"], []).append(trace)
        (residual,) = by_group["residual"]
        drawn = values(residual["y"])
        np.testing.assert_allclose(drawn[np.isfinite(drawn)], 0.1 * joint, rtol=1e-5)
        raw = values(by_group["as recorded"][1]["y"])
        assert np.nanmax(np.abs(raw)) == pytest.approx(
            max(map(abs, found.extremes[f"residual{joint}"])), rel=1e-6
        )
    assert "below 5 Hz, which the table of predictions scores: joint 1 0.100 N m RMS" in made.note
    assert "As recorded: joint 1" in made.note


def test_a_noisy_prediction_says_why() -> None:
    base = _log(np.zeros((4, 3)))
    extremes = {**base.extremes, "tau1": (0.0, 0.0), "tau2": (0.0, 0.0)}
    for residual, told in ((0.49, False), (0.51, True)):
        noisy = TorqueLog(
            {}, {}, base.motion, extremes, (1.0, 1.0), (0.1, residual), 0, {}, reduced=False
        )
        note = torque(noisy, []).note
        assert note.startswith(
            f"Residual of joint 1: 0.100 of 1.00 N m RMS; of joint 2: {residual:.3f} of 1.00 N m "
            "RMS."
        )
        assert ("differentiates angles twice" in note) is told


def test_a_band_that_misses_its_end_is_told_with_the_last_moment(
    result: Result, tmp_path: Path
) -> None:
    t = np.arange(1.0, 6.0)
    k1 = np.array([9.0, 1.0, 1.5, 1.0, 1.0])
    columns = {
        "k1": k1,
        "k1_half": np.full(5, 0.2),
        "k2": np.full(5, 2.0),
        "k2_half": np.full(5, 0.1),
    }
    path = _parquet(tmp_path / "running.parquet", log=np.zeros(5, np.int32), t=t, **columns)
    real = with_parameters(result, k1=1.0, k2=2.0).model_copy(update={"table4": [], "truth": {}})
    figure = drawn(running(path, real))
    assert (
        figure.note
        == "The last band to miss its final estimate was that of k1, at 3.00 s of 5.00 s."
    )
    low, high = figure.panels[0].layout["yaxis"]["range"]
    # four half widths about the end hold the later part too
    assert (low, high) == pytest.approx((0.2, 1.8))
    known = drawn(running(path, real.model_copy(update={"truth": {"k1": 1.0, "k2": 2.3}})))
    assert known.note.endswith(" The bands hold the truth 30.0 % of the time.")  # 3 of 5, and none
    level = figure.panels[1]
    steady = _parquet(
        tmp_path / "steady.parquet",
        log=np.zeros(5, np.int32),
        t=t,
        k2=np.full(5, 2.0),
        k2_half=[0.1] * 5,
    )
    assert drawn(running(steady, real)).note == "Every band held the final estimate from the start."
    assert level.says == "k2 over time, in the end 2.0000 kg m²"
    lost = running(steady, with_parameters(real, k2=None))
    assert lost == Missing("running", "Running estimate", "no parameter is determined")
    bare = _parquet(tmp_path / "bare.parquet", log=[0], t=[0.0])
    assert running(bare, real) == Missing(
        "running", "Running estimate", "bare.parquet holds no series"
    )


def _series_panel(result: Result, path: Path, name: str) -> Panel:
    return next(panel for panel in drawn(convergence(path, result)).panels if panel.title == name)


def test_a_series_is_framed_by_what_is_known_of_it(result: Result, tmp_path: Path) -> None:
    t = np.arange(4000) / 1000
    k1 = np.where(t < 0.05, 1e6, 2.0) + 0.1 * np.sin(40 * t)
    path = _parquet(tmp_path / "estimates.parquet", t=t, k1=k1, kx=np.full(4000, np.nan))
    found = Estimate(estimate=2.0, std=0.05, ci95=(1.9, 2.1), unit="kg m^2")
    made = result.model_copy(
        update={"parameters": {"k1": found}, "table4": [], "truth": {"k1": 3.0}}
    )
    panel = _series_panel(made, path, "k1")
    low, high = panel.layout["yaxis"]["range"]
    assert low < 1.9 < 2.1 < 3.0 < high < 4.0  # the spike is left out, the truth is not
    kinds = [
        (shape["type"], shape["y0"])
        for shape in panel.layout["shapes"]
        if shape.get("xref") == "paper"
    ]
    assert kinds == [("rect", 1.9), ("line", 2.0), ("line", 3.0)]
    windows = [shape["x0"] for shape in panel.layout["shapes"] if shape.get("xref") != "paper"]
    assert windows == pytest.approx([0.2, 2.2])  # ε after each window's start
    assert panel.says == "k1 over time; final estimate 2.000 kg m²; truth 3.0000 kg m²"
    empty = _series_panel(made, path, "kx")
    assert empty.layout["yaxis"]["range"] is None
    assert empty.says == "kx over time"
    words = [entry.words for entry in drawn(convergence(path, made)).legend]
    assert "result and its 95 % interval" in words
    assert "truth" in words
    plain = made.model_copy(
        update={"parameters": {"k1": found.model_copy(update={"ci95": None, "std": None})}}
    )
    words = [entry.words for entry in drawn(convergence(path, plain)).legend]
    assert "result" in words
    bare = _parquet(tmp_path / "bare.parquet", t=t)
    assert isinstance(convergence(bare, made), Missing)


def test_numbers_too_large_to_draw_are_left_out_of_figures_alone(result: Result) -> None:
    assert drawable(result).parameters == result.parameters
    huge = Estimate(estimate=1.0, std=1e101, ci95=(0.0, 1.0), unit="kg m^2")
    kept = drawable(
        with_fit(
            result.model_copy(update={"payload": {"m_p": huge}}),
            covariance=[[1e101, 1.0], [1.0, None]],
        )
    )
    assert kept.payload["m_p"].estimate is None
    assert kept.payload["m_p"].unit == "kg m^2"
    assert kept.fit is not None
    assert kept.fit.covariance == [[None, 1.0], [1.0, None]]
    assert kept.table4 == result.table4


@pytest.mark.parametrize("lowest", [0.3, 1e-2, 1e-6, 1e-13])
def test_ticks_of_a_spectrum_stand_apart_however_wide_it_is(lowest: float) -> None:
    value = np.geomspace(lowest, 20.0, 50)
    ticks = _round_ticks(Curve(value, value, np.full(50, 0.5), np.full(50, 2.0)))
    low, high = ticks["range"]
    shown = [at for at in np.log10(ticks["tickvals"]) if low <= at <= high]
    assert len(shown) >= 3
    assert np.diff(shown).min() > (high - low) / 12
