"""What the figures say in words is what they show."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import binom

from algid.report.figures.base import Figure, Missing
from algid.report.gallery import gallery
from algid.results import Result, TorquePrediction, WhitenessTest

CORRELATION, WHITENED = "autocorrelation", "whitened spectrum"


@pytest.fixture
def folder(case_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))


def _figure(made: object) -> Figure:
    assert isinstance(made, Figure)
    return made


def _drawn(key: str, folder: Path, result: Result) -> Figure | Missing:
    (made,) = [one for one in gallery(folder, result).every if one.key == key]
    return made


def test_a_good_reports_innovations_lie_in_their_band(case_folder: Path, result: Result) -> None:
    assert result.verdict.grade == "good"
    rows = pl.read_parquet(case_folder / "innovations.parquet")
    rows = rows.filter(pl.col("quantity").is_in([WHITENED, CORRELATION]))
    assert rows.select("quantity", "joint").n_unique() == 4
    count = rows.height
    inside = rows.filter(pl.col("value").is_between(pl.col("low"), pl.col("high"))).height
    counts = [sum(part) for part in _told(case_folder, result)]
    assert counts == [inside, count]
    low, high = binom.interval(0.999, count, 0.95)
    assert low <= inside <= high
    assert inside > binom.ppf(0.95, count, 0.85)


def _told(folder: Path, result: Result) -> tuple[list[int], list[int]]:
    """How many values lie inside their bands as the note says, and how many there are."""
    note = _figure(_drawn("innovations", folder, result)).note
    inside, counts = zip(*re.findall(r"(\d+) of (\d+)", note), strict=True)
    return list(map(int, inside)), list(map(int, counts))


def test_frequencies_that_no_axis_shows_are_refused(folder: Path, result: Result) -> None:
    path = folder / "innovations.parquet"
    changed = pl.when(pl.col("quantity") == WHITENED).then(-1e9).otherwise(pl.col("x")).alias("x")
    pl.read_parquet(path).with_columns(changed).write_parquet(path)
    expected = "column 'x' of its whitened spectrum: expected rising numbers above 0"
    refused = _drawn("innovations", folder, result)
    assert isinstance(refused, Missing)
    assert expected in refused.why


def test_the_note_counts_what_the_picture_shows(folder: Path, result: Result) -> None:
    path = folder / "innovations.parquet"
    figure = _figure(_drawn("innovations", folder, result))
    rows = pl.read_parquet(path).with_columns(
        inside=pl.col("value").is_between(pl.col("low"), pl.col("high"))
    )
    for quantity, words in (
        (CORRELATION, "correlations of joints 1 and 2"),
        (WHITENED, "frequencies"),
    ):
        own = rows.filter(pl.col("quantity") == quantity)
        told = [own.filter(pl.col("joint") == joint) for joint in (1, 2)]
        counts = " and ".join(f"{int(one['inside'].sum())} of {one.height}" for one in told)
        assert f"{counts} {words}" in figure.note
    assert "finds no colour" in figure.note


def test_colour_is_told_and_seen(folder: Path, result: Result) -> None:
    path = folder / "innovations.parquet"
    raised = pl.when(pl.col("quantity") == CORRELATION).then(0.8).otherwise(pl.col("value"))
    pl.read_parquet(path).with_columns(value=raised).write_parquet(path)
    assert result.fit is not None
    coloured = {
        name: WhitenessTest(white=False, p_value=0.0, lag1_correlation=0.8)
        for name in ("tau1", "tau2")
    }
    poor = result.model_copy(update={"fit": result.fit.model_copy(update={"whiteness": coloured})})
    figure = _figure(_drawn("innovations", folder, poor))
    assert "Inside the band: 0 of 40 and 0 of 40 correlations" in figure.note
    assert "coloured; the intervals do not allow for that" in figure.note


@pytest.mark.parametrize("least", [1e-308, 0.0])
def test_a_band_that_none_computes_is_drawn(least: float, folder: Path, result: Result) -> None:
    path = folder / "innovations.parquet"
    pl.read_parquet(path).with_columns(low=pl.lit(least)).write_parquet(path)
    _figure(_drawn("innovations", folder, result))


def test_scored_torque_of_a_log_that_is_not_there_is_refused(folder: Path, result: Result) -> None:
    assert result.fit is not None
    score = TorquePrediction(rmse=(0.1, 0.2), nrmse=(0.1, 0.2), r2=(0.9, 0.9), filter="")
    fit = result.fit.model_copy(update={"residual": score})
    torque = pl.read_parquet(folder / "torque.parquet").with_columns(log=pl.lit(-1, pl.Int32))
    torque.write_parquet(folder / "scored.parquet")
    first = gallery(folder, result.model_copy(update={"fit": fit})).figures[0]
    assert isinstance(first, Missing)
    assert first.why.endswith("expected the logs of torque.parquet, found log -1; identify again")


def test_the_running_estimate_ends_at_the_estimate_and_tells_when_it_strayed(
    folder: Path, result: Result
) -> None:
    path = folder / "running.parquet"
    figure = _figure(_drawn("running", folder, result))
    rows = pl.read_parquet(path)
    assert [panel.title for panel in figure.panels] == [
        name for name in rows.columns if f"{name}_half" in rows.columns
    ]
    for panel in figure.panels:
        estimate = result.parameters[panel.title].estimate
        assert estimate is not None
        assert rows[panel.title][-1] == pytest.approx(estimate, rel=1e-9)
        (mark,) = [shape for shape in panel.layout["shapes"] if shape.get("xref") == "paper"]
        assert mark["y0"] == pytest.approx(estimate, rel=1e-9)
        low, high = panel.layout["yaxis"]["range"]
        assert low < estimate < high
    truth = {row.parameter: row.truth for row in result.table4}
    held = [
        np.mean(np.abs(rows[name].to_numpy() - truth[name]) <= rows[f"{name}_half"].to_numpy())
        for name in truth
    ]
    told = re.search(r"The bands hold the truth ([\d.]+) % of the time", figure.note)
    assert told is not None
    # three digits are written
    assert float(told[1]) == pytest.approx(100 * float(np.mean(held)), rel=1e-2)


def test_what_has_no_estimate_has_no_running_one(case_folder: Path, result: Result) -> None:
    lost = result.parameters["k3"].model_copy(
        update={"estimate": None, "std": None, "ci95": (None, None)}
    )
    poor = result.model_copy(update={"parameters": {**result.parameters, "k3": lost}})
    titles = [panel.title for panel in _figure(_drawn("running", case_folder, poor)).panels]
    assert "k3" not in titles
    assert "k4" in titles


def test_no_figure_is_without_a_reading_aid(case_folder: Path, result: Result) -> None:
    shown = gallery(case_folder, result)
    for figure in (*shown.figures, *shown.paper):
        assert _figure(figure).reading.startswith("Read: "), figure.key
        assert all(panel.says for panel in _figure(figure).panels)
