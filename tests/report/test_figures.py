"""What the figures draw: against the files, closed forms and numpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from algid.api.report import report
from algid.base.errors import ResultError
from algid.base.significance import NORMAL
from algid.report.figures import (
    correlation,
    coverage,
    figures,
    intervals,
    over_time,
    residual,
    shares_of_time,
    signals,
    torque,
)
from algid.report.plot import Panels, packed
from algid.report.series import Drawn
from algid.results import Result
from algid.results.rows import known_truth
from tests.report.folders import estimate
from tests.report.pages import named, typed


def traces(plot: Panels | None, name: str) -> list[dict[str, Any]]:
    assert plot is not None
    return named(plot.data, name)


def finite(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def test_intervals_are_in_percent_of_the_estimate(result: Result) -> None:
    assert result.fit is not None
    own = {"k1": estimate(2.0, 0.1, ""), "k2": estimate(-4.0, 0.04, ""), "k3": estimate(1, 5, "")}
    logs = [{"k1": estimate(2.2, 0.1, "")}, {"k1": estimate(9.0, 0.1, "")}]
    fit = result.fit.model_copy(update={"by_log": logs})
    known = {"parameters": own, "payload": {}, "table4": [], "truth": {"k2": -4.4}, "fit": fit}
    plot = intervals(result.model_copy(update=known))
    (bars,) = traces(plot, "estimate with its interval")
    assert bars["y"] == ["k1", "k2", "k3"]
    assert bars["error_x"]["array"] == pytest.approx([5 * NORMAL, NORMAL, 500 * NORMAL])
    (dots,) = traces(plot, "each log by itself")  # the loaded log's k1 holds its payload's share
    assert (dots["x"], dots["y"]) == ([pytest.approx(10.0)], ["k1"])
    (ring,) = traces(plot, "truth")
    assert (ring["x"], ring["y"]) == ([pytest.approx(-10.0)], ["k2"])
    low, high = plot.layout["xaxis"]["range"]
    assert high == -low == pytest.approx(1.15 * 4 * 5 * NORMAL)  # four times the median interval
    bare = intervals(result.model_copy(update={"parameters": {}, "payload": {}}))
    assert traces(bare, "truth") == []


def test_torque_stands_above_its_residual(case_folder: Path, result: Result, raw: Drawn) -> None:
    plot = torque(case_folder, result, raw)
    scored = pl.read_parquet(case_folder / "scored.parquet")
    for joint, one in enumerate(traces(plot, "measured"), start=1):
        y = finite(typed(one["y"]))
        ends = scored[f"tau{joint}"].min(), scored[f"tau{joint}"].max()
        assert (y.min(), y.max()) == pytest.approx(ends, rel=1e-6)
    axes = [[trace["yaxis"] for trace in traces(plot, name)] for name in ("measured", "residual")]
    assert axes == [["y", "y3"], ["y2", "y4"]]
    assert result.fit is not None
    assert result.fit.prediction is not None
    assert plot.title.endswith(f" below {result.fit.prediction.bandwidth:g} Hz")
    starts = sorted({shape["x0"] for shape in plot.layout["shapes"]})
    span = scored.filter(log=0)["t"]
    assert starts == pytest.approx([span[0], 1.01 * span[-1]])
    words = [one["text"] for one in plot.layout["annotations"]]
    assert words[4:] == ["case1-unloaded.mcap", "case1-loaded.mcap"]


def test_signals_and_the_motion_are_drawn_as_recorded(result: Result, raw: Drawn) -> None:
    every = [(typed(one["y"]), one["yaxis"]) for one in signals(result, raw).data]
    names = ("theta1", "theta2", "omega1", "omega2", "tau1", "tau2")
    for (y, axis), name, own in zip(every, names, ("y", "y", "y2", "y2", "y3", "y3"), strict=True):
        assert axis == own
        np.testing.assert_array_equal(y, raw[name].astype(np.float32))
    first, second = coverage(raw).data
    assert typed(first["y"]) == pytest.approx(np.degrees(raw.samples["theta2"]), rel=1e-6)
    assert typed(second["x"]) == pytest.approx(raw.samples["omega1"], rel=1e-6)


def test_residuals_stand_against_the_band_of_white_noise(case_folder: Path) -> None:
    rows = pl.read_parquet(case_folder / "innovations.parquet")
    plot = residual(case_folder)
    assert plot is not None
    one = rows.filter((pl.col("quantity") == "autocorrelation") & (pl.col("joint") == 1))
    stems = traces(plot, "residual")[1]
    assert typed(stems["y"]) == pytest.approx(one["value"].to_numpy(), rel=1e-5)
    axes = [plot.layout[name]["title"]["text"] for name in plot.layout if name.startswith("x")]
    assert axes == 2 * ["frequency, Hz", "lag, s"]
    inside = one.filter(pl.col("value").is_between(pl.col("low"), pl.col("high"))).height
    assert f"inside the band: {inside} of {one.height} and " in plot.note
    white = rows.filter((pl.col("quantity") == "whitened spectrum") & (pl.col("joint") == 1))
    band = finite(typed(traces(plot, "95 % band of white noise")[0]["y"]))
    ends = white["low"].min(), white["high"].max()
    assert (band.min(), band.max()) == pytest.approx(ends, rel=1e-6)


def test_the_running_estimate_ends_at_its_last_value(case_folder: Path, result: Result) -> None:
    rows = pl.read_parquet(case_folder / "running.parquet")
    plot = over_time(case_folder, result, "running")
    assert plot is not None
    names = [name for name in rows.columns if f"{name}_half" in rows.columns]
    for place, one in enumerate(traces(plot, "estimate from all samples so far")):
        name = names[place]
        assert finite(typed(one["y"]))[-1] == pytest.approx(rows[name][-1], rel=1e-6)
        axis = f"y{place + 1}" if place else "y"
        low, high = plot.layout[axis.replace("y", "yaxis")]["range"]
        marks = {shape["y0"] for shape in plot.layout["shapes"] if shape["yref"] == axis}
        assert {result.estimates[name].estimate, known_truth(result).get(name)} - {None} <= marks
        assert low < rows[name][-1] - rows[f"{name}_half"][-1] < rows[name][-1] < high


def test_maps_are_the_covariance_scaled_and_information_summed(result: Result) -> None:
    plot = correlation(result)
    assert plot is not None
    (trace,) = traces(plot, "map")
    C = result.covariance
    np.testing.assert_allclose(typed(trace["z"]), C / np.sqrt(np.outer(*[np.diag(C)] * 2)), 1e-5)
    gained = np.arange(2 * 1_500.0).reshape(2, -1)
    (trace,) = traces(shares_of_time(["a", "b"], gained, 0.5), "map")
    assert typed(trace["z"]).shape == (2, 500)
    np.testing.assert_allclose(typed(trace["z"]).sum(axis=1), 100, rtol=1e-5)
    assert typed(trace["z"])[0, 1] == pytest.approx(100 * (3 + 4 + 5) / gained[0].sum(), rel=1e-5)
    assert typed(trace["x"])[1] == pytest.approx(1.5 * 3 * 0.5)


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("scored", set()), ("innovations", {"residual"}), ("running", {"running"}),
        ("information", {"information"}),
    ],
)  # fmt: skip
def test_what_is_absent_is_not_drawn_and_what_is_broken_is_refused(
    folder: Path, result: Result, raw: Drawn, name: str, lost: set[str]
) -> None:
    every = {one.key for one in figures(folder, result, raw)}
    (folder / f"{name}.parquet").unlink(missing_ok=True)
    assert {one.key for one in figures(folder, result, raw)} == every - lost
    (folder / f"{name}.parquet").write_bytes(b"PAR1")
    with pytest.raises(ResultError, match=rf"{name}\.parquet: cannot read it as Parquet"):
        figures(folder, result, raw)


def test_a_series_that_lacks_a_column_is_one_line(folder: Path) -> None:
    file = folder / "torque.parquet"
    pl.read_parquet(file).drop("tau2").write_parquet(file)
    with pytest.raises(ResultError, match=r"case1.algid: its series do not go .*'tau2'"):
        report([folder])


def test_numbers_travel_in_single_precision_unless_they_are_beyond_it() -> None:
    x = np.arange(10.0) * 1e-3
    assert [packed(of)["dtype"] for of in (x, 1e42 * x, np.arange(3))] == ["f4", "f8", "f8"]
    np.testing.assert_array_equal(typed(packed(1e42 * x)), 1e42 * x)
    assert typed(packed(np.ones((2, 3)))).shape == (2, 3)
