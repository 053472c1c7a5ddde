"""What the figures draw: against the files, closed forms and numpy."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.stats import norm

from algid.arm import mass_matrix
from algid.base.significance import NORMAL
from algid.base.text import significant
from algid.report.figures import (
    closeup,
    convergence,
    correlation,
    coverage,
    inertia,
    information,
    intervals,
    measured,
    residual,
    running,
    shares_of_time,
    signals,
)
from algid.report.plot import Panels, Plot, label, packed
from algid.report.series import Drawn, drawn
from algid.results import Estimate, Result, TorquePrediction
from tests.report.folders import estimate
from tests.report.pages import named, typed


@pytest.fixture(scope="module")
def raw(case_folder: Path) -> Drawn:
    return drawn(case_folder / "torque.parquet")


def traces(plot: Plot | None, name: str) -> list[dict[str, Any]]:
    assert plot is not None
    return named(plot.figure.data, name)


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
    assert ring["marker"]["symbol"] == "circle-open"
    low, high = plot.figure.layout["xaxis"]["range"]
    assert high == -low == pytest.approx(1.15 * 4 * 5 * NORMAL)  # four times the median interval
    bare = intervals(result.model_copy(update={"parameters": {}, "payload": {}}))
    assert traces(bare, "truth") == []


def test_torque_is_drawn_above_its_residual(case_folder: Path, result: Result, raw: Drawn) -> None:
    assert result.fit is not None
    rows = pl.read_parquet(case_folder / "torque.parquet")
    score = TorquePrediction(
        rmse=(0.1, 0.2), nrmse=(0.01, 0.02), r2=(0.9, 0.8), filter="", bandwidth=60.0
    )
    fit = result.fit.model_copy(update={"residual": score})
    plot = measured(case_folder / "none", raw, result.model_copy(update={"fit": fit}))
    assert plot.title == "Measured and predicted torque below 60 Hz"
    assert "joint 2 0.200 N m RMS, R² 80.00 %" in plot.note
    for joint, one in enumerate(traces(plot, "measured"), start=1):
        y = finite(typed(one["y"]))
        assert (y.min(), y.max()) == pytest.approx(
            (rows[f"tau{joint}"].min(), rows[f"tau{joint}"].max()), rel=1e-6
        )
    axes = [[trace["yaxis"] for trace in traces(plot, name)] for name in ("measured", "residual")]
    assert axes == [["y", "y3"], ["y2", "y4"]]
    names = [one["text"] for one in plot.figure.layout["annotations"][4:]]
    assert names == ["case1-unloaded.mcap", "case1-loaded.mcap"]
    starts = sorted({shape["x0"] for shape in plot.figure.layout["shapes"]})
    assert starts == pytest.approx([0.0, 1.01 * 3.999])
    assert [plot.figure.layout[f"xaxis{n}"]["matches"] for n in (2, 3, 4)] == ["x"] * 3


def test_the_worst_moment_has_every_sample(case_folder: Path, result: Result, raw: Drawn) -> None:
    rows = pl.read_parquet(case_folder / "torque.parquet")
    plot = closeup(case_folder / "torque.parquet", raw, result)
    for joint, one in enumerate(traces(plot, "residual"), start=1):
        left = (rows[f"tau{joint}"] - rows[f"tau{joint}_predicted"]).abs()
        t, y = typed(one["x"]), typed(one["y"])
        assert np.abs(y).max() == pytest.approx(left.max(), rel=1e-6)
        moment = float(rows["t"][int(left.arg_max() or 0)])
        assert np.median(np.diff(t)) == pytest.approx(1e-3, rel=1e-2)
        assert t[0] == pytest.approx(max(moment - 0.5, 0.0), abs=2e-3)
        assert t[-1] == pytest.approx(min(moment + 0.5, 3.999), abs=2e-3)
    assert plot is not None
    assert f"at {moment:.3f} s" in plot.figure.layout["annotations"][1]["text"]


def test_residuals_stand_against_the_band_of_white_noise(case_folder: Path, result: Result) -> None:
    rows = pl.read_parquet(case_folder / "innovations.parquet")
    plot = residual(case_folder / "innovations.parquet", result)
    assert plot is not None
    one = rows.filter((pl.col("quantity") == "autocorrelation") & (pl.col("joint") == 1))
    stems = traces(plot, "residual")[1]
    assert finite(typed(stems["y"])[1::3]) == pytest.approx(one["value"].to_numpy(), rel=1e-5)
    inside = one.filter(pl.col("value").is_between(pl.col("low"), pl.col("high"))).height
    assert f"inside the band: {inside} of {one.height} and " in plot.note
    assert plot.note.endswith("No significant residual autocorrelation.")
    assert plot.figure.layout["xaxis"]["type"] == plot.figure.layout["yaxis"]["type"] == "log"
    band = traces(plot, "95 % band of white noise")[0]
    white = rows.filter((pl.col("quantity") == "whitened spectrum") & (pl.col("joint") == 1))
    assert typed(band["y"]).max() == pytest.approx(white["high"].max(), rel=1e-6)
    assert typed(band["y"]).min() == pytest.approx(white["low"].min(), rel=1e-6)


def test_a_spectrum_without_a_band_stands_beside_the_torques(
    case_folder: Path, result: Result, tmp_path: Path
) -> None:
    assert result.fit is not None
    rows = pl.read_parquet(case_folder / "innovations.parquet")
    spectrum = rows.filter(pl.col("quantity") == "whitened spectrum").with_columns(
        quantity=pl.lit("spectrum"), low=pl.lit(None, pl.Float64), high=pl.lit(None, pl.Float64)
    )
    torque = spectrum.with_columns(pl.lit("torque spectrum").alias("quantity"))
    other = rows.filter(pl.col("quantity") == "autocorrelation")
    pl.concat([spectrum, torque, other]).write_parquet(tmp_path / "i.parquet")
    tests = {
        name: one.model_copy(update={"white": False}) for name, one in result.fit.whiteness.items()
    }
    fit = result.fit.model_copy(update={"whiteness": tests})
    plot = residual(tmp_path / "i.parquet", result.model_copy(update={"fit": fit}))
    assert plot is not None
    assert len(traces(plot, "measured torque")) == 2
    assert plot.figure.layout["yaxis"]["title"]["text"] == "(N m)²/Hz"
    assert plot.note.endswith(" Significant residual autocorrelation.")
    spectrum.write_parquet(tmp_path / "i.parquet")  # too short to tell
    assert residual(tmp_path / "i.parquet", result) is None


def test_the_running_estimate_ends_at_its_last_value(case_folder: Path, result: Result) -> None:
    rows = pl.read_parquet(case_folder / "running.parquet")
    plot = running(case_folder / "running.parquet", result)
    assert plot is not None
    every = traces(plot, "estimate from all samples so far")
    assert len(every) == 7
    for place, (name, one) in enumerate(zip(result.parameters, every, strict=True)):
        assert typed(one["y"]) == pytest.approx(rows[name].to_numpy(), rel=1e-5)
        final, half = rows[name][-1], rows[f"{name}_half"][-1]
        assert plot.figure.layout["shapes"][place]["y0"] == pytest.approx(final)
        low, high = plot.figure.layout["yaxis" if not place else f"yaxis{place + 1}"]["range"]
        assert low <= final - 4 * half < final + 4 * half <= high
        late = slice(rows.height // 3, None)
        assert low <= (rows[name] - rows[f"{name}_half"])[late].min()
        assert high >= (rows[name] + rows[f"{name}_half"])[late].max()
    lost = dict.fromkeys(result.parameters, Estimate(estimate=None, unit=""))
    assert running(case_folder / "running.parquet", result.model_copy(
        update={"parameters": {}, "payload": {}})) is None  # fmt: skip
    assert running(case_folder / "running.parquet", result.model_copy(
        update={"parameters": lost})) is not None  # fmt: skip


def test_signals_tell_the_joints_apart_without_colour(result: Result, raw: Drawn) -> None:
    plot = signals(raw, result)
    dashes = {one["line"]["dash"] for one in traces(plot, "joint 2")}
    assert len(dashes) == 1
    assert dashes.isdisjoint(one["line"]["dash"] for one in traces(plot, "joint 1"))
    assert [one["yaxis"] for one in traces(plot, "joint 1")] == ["y", "y2", "y3"]
    assert [one["showlegend"] for one in plot.figure.data] == [True, True] + [False] * 4


def test_coverage_holds_angles_that_turned_round(raw: Drawn) -> None:
    angles, speeds = traces(coverage(raw), "samples")
    x = np.degrees(raw.samples["theta2"])
    assert np.ptp(x) < 540
    assert typed(angles["y"]) == pytest.approx(x, rel=1e-5)
    assert typed(speeds["y"]) == pytest.approx(raw.samples["omega2"], rel=1e-5)
    turned = Drawn(raw.columns, raw.logs, raw.samples | {"theta1": np.linspace(0, 20, x.size)})
    wrapped = typed(traces(coverage(turned), "samples")[0]["x"])
    assert wrapped.min() >= -180
    assert wrapped.max() <= 180
    np.testing.assert_allclose(
        np.cos(np.radians(wrapped)), np.cos(np.linspace(0, 20, x.size)), atol=1e-4
    )


def test_the_matrix_of_correlations_is_the_covariance_scaled(result: Result) -> None:
    assert result.fit is not None
    C = np.array([[4.0, 1.96, 0.0], [1.96, 1.0, 0.0], [0.0, 0.0, np.nan]])
    listed = [[None if np.isnan(one) else one for one in row] for row in C]
    plot = correlation(result.fit.model_copy(
        update={"covariance": listed, "covariance_names": ["a", "b", "c"]}))  # fmt: skip
    assert plot is not None
    R = typed(plot.figure.data[0]["z"])
    assert R[:2, :2] == pytest.approx(np.array([[1, 0.98], [0.98, 1]]))
    assert np.isnan(R[2]).all()
    assert plot.note == "Correlated beyond 0.95: a and b (+0.980)."
    whole = correlation(result.fit)
    assert whole is not None
    assert whole.figure.data[0]["texttemplate"] == "%{z:.2f}"
    many = result.fit.model_copy(
        update={"covariance": np.eye(15).tolist(), "covariance_names": list("abcdefghijklmno")}
    )
    crowded = correlation(many)
    assert crowded is not None
    assert "texttemplate" not in crowded.figure.data[0]
    assert crowded.note == "Correlated beyond 0.95: no pair."
    none = result.fit.model_copy(update={"covariance": [], "covariance_names": []})
    assert correlation(none) is None


def test_information_is_summed_not_thinned(case_folder: Path, tmp_path: Path) -> None:
    plot = information(case_folder / "information.parquet")
    assert plot is not None
    z = typed(plot.figure.data[0]["z"])
    assert z.shape == (7, 4)
    assert z.sum(axis=1) == pytest.approx(100)
    assert typed(plot.figure.data[0]["x"]) == pytest.approx([0.5, 1.5, 2.5, 3.5])
    gained = np.arange(2000.0).reshape(2, 1000) * np.array([[1.0], [0.0]])
    summed = shares_of_time(("a", "b"), gained, 0.5).figure.data[0]
    z = typed(summed["z"])
    assert z.shape == (2, 500)
    assert z[0, -1] == pytest.approx(100 * (998 + 999) / gained[0].sum(), rel=1e-5)
    assert not z[1].any()
    assert typed(summed["x"])[:2] == pytest.approx([0.5, 1.5])
    pl.DataFrame({"log": [0], "t": [0.0]}).write_parquet(tmp_path / "i.parquet")
    assert information(tmp_path / "i.parquet") is None


def test_the_mass_matrix_has_its_band_and_where_the_logs_went(result: Result, raw: Drawn) -> None:
    assert result.fit is not None
    plot = inertia(result, raw)
    assert plot is not None
    k = np.array([one.estimate for one in result.parameters.values()], dtype=np.float64)
    theta2 = np.linspace(-np.pi, np.pi, 181)
    m = mass_matrix(k, np.stack([0 * theta2, theta2]))
    for name, values in zip(("M11", "M12 = M21", "M22"), m, strict=True):
        (one,) = traces(plot, name)
        assert typed(one["y"]) == pytest.approx(np.broadcast_to(values, 181), rel=1e-5)
    # M22 = k3: its band is that of k3 alone
    band = typed(traces(plot, "95 % interval")[2]["y"])
    k3 = result.parameters["k3"]
    assert k3.estimate is not None
    assert k3.std is not None
    half = norm.ppf(0.975) * k3.std
    assert (band.min(), band.max()) == pytest.approx((k3.estimate - half, k3.estimate + half))
    (reached,) = plot.figure.layout["shapes"]
    assert reached["x0"] == pytest.approx(max(np.degrees(np.nanmin(raw["theta2"])), -180))
    least = min(np.linalg.eigvalsh(np.array([[a, b], [b, c]])).min() for a, b, c in zip(
        m[0], m[1], np.broadcast_to(m[2], 181), strict=True))  # fmt: skip
    words = "M is positive definite for every θ2; its smallest eigenvalue is"
    assert plot.note == f"{words} {significant(float(least), 3)} kg m²."
    negative = {**result.parameters, "k5": estimate(-1.0, 0.1, "kg m^2")}
    bent = inertia(result.model_copy(update={"parameters": negative}), None)
    assert bent is not None
    assert bent.note.startswith("M is not positive definite for every θ2, which no arm is")
    assert bent.figure.layout["shapes"] == []
    lost = {**result.parameters, "k5": Estimate(estimate=None, unit="")}
    assert inertia(result.model_copy(update={"parameters": lost}), raw) is None


def test_convergence_shows_result_truth_and_what_settles(
    case_folder: Path, result: Result, tmp_path: Path
) -> None:
    rows = pl.read_parquet(case_folder / "estimates.parquet")
    plot = convergence(case_folder / "estimates.parquet", result)
    titles = [one["text"] for one in plot.figure.layout["annotations"]]
    assert titles[:2] == ["<b>k1</b>", "<b>k2</b>"]
    assert titles[-1] == "<b>condition</b>"
    assert plot.figure.layout["yaxis8"]["type"] == "log"
    k1 = result.parameters["k1"].estimate
    own = [one for one in plot.figure.layout["shapes"] if one["yref"] == "y"]
    assert [one["y0"] for one in own] == [k1, result.table4[0].truth]
    settled = rows["k1"].drop_nans().drop_nulls().to_numpy()
    settled = settled[settled.size // 4 :]
    low, high = plot.figure.layout["yaxis"]["range"]
    inside = np.quantile(settled, [0.1, 0.9])
    assert low < inside[0] < inside[1] < high
    shutil.copy(case_folder / "loaded.parquet", tmp_path / "loaded.parquet")
    loaded = convergence(tmp_path / "loaded.parquet", result)
    assert loaded.title == "Convergence, loaded log"
    assert result.paper_payload["m_p"].estimate in [
        one.get("y0") for one in loaded.figure.layout["shapes"]
    ]


def test_panels_lie_beside_and_below_one_another() -> None:
    panels = Panels(["a", "b", "c"], 2, 200, together=True)
    layout = panels.layout
    assert layout["height"] == 2 * 200 + 40
    assert layout["xaxis"]["domain"][1] < layout["xaxis2"]["domain"][0] < 1
    assert layout["xaxis2"]["domain"][1] == pytest.approx(1.0)
    assert layout["xaxis3"]["domain"] == layout["xaxis"]["domain"]
    assert layout["yaxis3"]["domain"][1] == pytest.approx(0.5)
    assert layout["yaxis3"]["domain"][0] == pytest.approx(55 / 400)
    assert layout["yaxis"]["domain"] == layout["yaxis2"]["domain"]
    assert [layout[f"xaxis{n}"].get("matches") for n in ("", 2, 3)] == [None, "x", "x"]
    single = Panels(["one"], 1, 300).layout
    assert single["xaxis"]["domain"] == [0, 1]


def test_a_band_breaks_at_gaps() -> None:
    panels = Panels([""])
    x = np.arange(6.0)
    high = np.array([1.0, 1, np.nan, 2, 2, 2])
    panels.band(0, x, -high, high, "band")
    first, second = (typed(one["x"]).tolist() for one in panels.data)
    assert first == [0, 1, 1, 0]
    assert second == [3, 4, 5, 5, 4, 3]
    assert typed(panels.data[0]["y"]).tolist() == [1, 1, -1, -1]
    assert [one["showlegend"] for one in panels.data] == [True, False]


def test_lines_and_stretches_reach_over_the_whole_panel() -> None:
    panels = Panels(["a", "b"])
    panels.line(1, y=3.0)
    panels.line(0, x=2.0)
    panels.stretch(1, 4.0, 5.0)
    level, upright, stretch = panels.layout["shapes"]
    assert (level["xref"], level["x0"], level["x1"]) == ("x2 domain", 0, 1)
    assert (level["yref"], level["y0"], level["y1"]) == ("y2", 3.0, 3.0)
    assert (upright["yref"], upright["y1"], upright["x0"]) == ("y domain", 1, 2.0)
    assert (stretch["type"], stretch["x0"], stretch["x1"]) == ("rect", 4.0, 5.0)
    assert stretch["yref"] == "y2 domain"


def test_numbers_travel_in_single_precision_unless_steps_would_be_lost() -> None:
    short = packed(np.arange(1000) / 1000, exact=True)
    assert short["dtype"] == "f4"
    late = 1e6 + np.arange(1000) / 1000
    assert packed(late)["dtype"] == "f4"
    assert packed(late, exact=True)["dtype"] == "f8"
    assert typed(packed(late, exact=True)).tolist() == late.tolist()
    assert packed(np.array([1e300, 1.0]))["dtype"] == "f8"
    assert packed(np.array([np.nan, np.nan]), exact=True)["dtype"] == "f4"
    assert packed(np.ones((2, 3)))["shape"] == "2, 3"
    assert packed(["a"]) == ["a"]


def test_names_are_no_markup_for_plotly() -> None:
    assert label("<b>x</b>&") == "&lt;b&gt;x&lt;/b&gt;&amp;"
    assert label("x" * 80) == "x" * 55 + "…"
    panels = Panels(["<i>"])
    panels.text(0, "<a href=x>", 1.0)
    panels.dots(0, [1], [2], "<u>")
    panels.heat(["<s>"], [1], np.ones((1, 1)))
    assert "<" not in str(panels.data) + str(panels.layout).replace("<b>", "").replace("</b>", "")
