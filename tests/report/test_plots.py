"""Figures for papers: every one of a page is saved, with the page's own values, words
and ranges.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Sheet
from typer.testing import CliRunner

from algid.errors import SettingError
from algid.report.figures.base import (
    Figure,
    Legend,
    Missing,
    Panel,
    axis,
    band,
    between,
    level,
    line,
    packed,
    stretch,
    upright,
)
from algid.report.gallery import gallery
from algid.report.plots import save_plots
from algid.results import Result
from tests.cli.commands import app

X, Y = np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 2.0])


def test_figures_are_saved_in_the_form_that_is_asked_for(tmp_path: Path) -> None:
    panel = Panel([line(X, Y, "@blue", "n", "g")], {"xaxis": axis(), "yaxis": axis()}, "says")
    shown = [Figure(key, "title", (panel,), "Read: it.") for key in ("one", "two")]
    written = save_plots(shown, tmp_path, "case1", "png")
    assert [path.name for path in written] == ["case1-one.png", "case1-two.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)
    written = save_plots(shown[:1], tmp_path, "case1")
    assert [path.name for path in written] == ["case1-one.pdf"]
    once = written[0].read_bytes()
    assert once.startswith(b"%PDF")
    # no date, no random name
    assert save_plots(shown[:1], tmp_path, "case1")[0].read_bytes() == once


@pytest.mark.slow  # matplotlib takes fonts apart for every file
def test_the_command_saves_every_figure_of_the_page(
    case_folder: Path, result: Result, tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))
    done = CliRunner().invoke(
        app, ["report", str(folder), "--save-plots", str(tmp_path / "figures")]
    )
    assert done.exit_code == 0, done.output
    files = sorted((tmp_path / "figures").iterdir())
    keys = [figure.key for figure in gallery(case_folder, result).every]
    assert len(keys) == 11
    assert [path.stem.split("-", 1)[1] for path in files] == sorted(keys)
    assert all(path.read_bytes().startswith(b"%PDF") for path in files)


def test_a_sheet_holds_what_the_panel_draws() -> None:
    x, y = np.array([1.0, 10.0, 100.0]), np.array([2.0, 4.0, 8.0])
    layout = {
        "xaxis": axis("frequency, Hz", type="log", range=[0.0, 2.0]),
        "yaxis": axis("a &lt; $b$", range=[1.0, 9.0]),
    }
    panel = Panel([line(x, y, "@blue", "n", "g")], layout, "says", "Joint $1$")
    (drawn,) = sheet_of(Figure("key", "title", (panel,), "Read: it.")).axes
    np.testing.assert_allclose(np.asarray(drawn.lines[0].get_ydata(), dtype=np.float64), y)
    assert drawn.get_xscale() == "log"
    assert drawn.get_xlim() == pytest.approx((1.0, 100.0))
    assert drawn.get_ylim() == (1.0, 9.0)
    assert drawn.get_ylabel() == r"a < \$b\$"  # a dollar, not a formula
    assert drawn.lines[0].get_color() == "#0b62b0"


def test_without_matplotlib_the_flag_says_what_to_install(
    case_folder: Path, result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(
        SettingError, match=r"--save-plots: expected matplotlib.*pip install 'algid\[plots\]'"
    ):
        save_plots(gallery(case_folder, result).every, tmp_path / "figures", "case1")
    assert not (tmp_path / "figures").exists()


def sheet_of(figure: Figure) -> Sheet:
    """What matplotlib is handed, unsaved."""
    sheets: list[Sheet] = []
    with pytest.MonkeyPatch.context() as patch, TemporaryDirectory() as folder:
        patch.setattr(Sheet, "savefig", lambda self, *_, **__: sheets.append(self))
        save_plots([figure], Path(folder), "log", "png")
    return sheets[0]


def one_panel(traces: list[dict[str, Any]], **layout: Any) -> Any:
    """The axes of one panel of those traces."""
    made = Panel(traces, {"xaxis": axis("x"), "yaxis": axis("y"), **layout}, "says")
    return sheet_of(Figure("key", "title", (made,), "Read: it.")).axes[0]


def test_an_area_between_two_series_is_filled_with_its_colour() -> None:
    axes = one_panel(between(X, Y - 1, Y + 1, "@blue/0.25"))
    (area,) = axes.collections
    (path,) = area.get_paths()
    corners = {(float(x), float(y)) for x, y in path.vertices}
    assert {(x, y + side) for x, y in zip(X, Y, strict=True) for side in (-1.0, 1.0)} <= corners
    assert area.get_alpha() == 0.25
    assert tuple(np.round(255 * area.get_facecolor()[0][:3])) == (0x0B, 0x62, 0xB0)
    assert not axes.lines  # the edges have no line
    below = {"type": "scatter", "mode": "lines", "x": packed(X), "y": packed(Y), "fill": "tozeroy"}
    (area,) = one_panel([{**below, "fillcolor": "@amber/0.35", "line": {"width": 0}}]).collections
    assert area.get_paths()[0].vertices[:, 1].min() == 0.0


def test_closed_areas_break_where_they_are_broken() -> None:
    x = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 5.0, 6.0, 6.0, 5.0, 9.0])
    y = np.array([0.0, 0.0, 1.0, 1.0, np.nan, 0.0, 0.0, 2.0, np.nan, 1.0])
    trace = {
        "type": "scatter",
        "mode": "lines",
        "x": packed(x),
        "y": packed(y),
        "fill": "toself",
        "fillcolor": "@green",
    }
    axes = one_panel([{**trace, "line": {"width": 0}}])
    # the last part has a single corner
    assert [len(patch.get_xy()) - 1 for patch in axes.patches] == [
        4,
        3,
    ]


def test_markers_steps_and_error_bars_are_those_of_the_page() -> None:
    dots = {
        "type": "scatter",
        "mode": "markers",
        "x": packed(X),
        "y": packed(Y),
        "marker": {"color": "@orange", "size": 8, "opacity": 0.5},
        "error_x": {"type": "data", "array": [0.1, 0.2, 0.3], "color": "@orange"},
    }
    steps = line(X, Y, "@ink", "n", "g", width=2.0)
    steps["line"] |= {"shape": "hv", "dash": "dash"}
    axes = one_panel([dots, steps])
    marks, stairs = axes.lines[0], axes.lines[-1]
    assert (marks.get_marker(), marks.get_alpha(), marks.get_markersize()) == ("o", 0.5, 6.0)
    assert (stairs.get_drawstyle(), stairs.get_linestyle(), stairs.get_linewidth()) == (
        "steps-post",
        "--",
        1.5,
    )
    (bars,) = axes.containers
    ends = bars.lines[2][0].get_segments()
    np.testing.assert_allclose(
        [end[:, 0] for end in ends], [[-0.1, 0.1], [0.8, 1.2], [1.7, 2.3]], atol=1e-7
    )


def test_a_matrix_has_its_names_its_numbers_and_its_scale() -> None:
    z = np.array([[1.0, -0.5], [np.nan, 0.25]])
    trace = {
        "type": "heatmap",
        "x": ["k1", "k&lt;2"],
        "y": ["k1", "k&lt;2"],
        "z": {**packed(z), "shape": "2, 2"},
        "zmin": -1,
        "zmax": 1,
        "colorscale": [[0, "@orange/0.5"], [0.5, "@page/0"], [1, "@blue"]],
        "texttemplate": "%{z:.2f}",
    }
    layout = {"xaxis": axis(type="category"), "yaxis": axis(type="category", autorange="reversed")}
    axes = one_panel([trace], **layout)
    assert [text.get_text() for text in axes.texts] == ["1.00", "-0.50", "0.25"]
    assert [text.get_position() for text in axes.texts] == [(0, 0), (1, 0), (1, 1)]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["k1", "k<2"]
    assert axes.yaxis_inverted()
    (mesh,) = axes.collections
    assert mesh.get_clim() == (-1, 1)
    np.testing.assert_array_equal(
        np.ma.getmaskarray(mesh.get_array()).ravel(), [False, False, True, False]
    )
    low, middle, high = (mesh.get_cmap()(place) for place in (0.0, 0.5, 1.0))
    assert low[:3] == pytest.approx(
        ((255 + 0xC2) / 510, (255 + 0x57) / 510, (255 + 0x0C) / 510), abs=1e-3
    )
    assert middle[:3] == pytest.approx((1, 1, 1), abs=0.01)  # clear on white paper
    assert high[:3] == pytest.approx((0x0B / 255, 0x62 / 255, 0xB0 / 255), abs=1e-3)


def test_cells_of_seconds_stand_about_their_middles() -> None:
    trace = {
        "type": "heatmap",
        "x": packed(np.array([0.5, 1.5, 2.5])),
        "y": ["k1"],
        "z": {**packed(np.array([1.0, 2.0, 3.0])), "shape": "1, 3"},
        "colorscale": [[0, "@page"], [1, "@blue"]],
    }
    axes = one_panel([trace])
    corners = axes.collections[0].get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], [0.0, 1.0, 2.0, 3.0])
    assert not axes.texts


def test_shapes_lie_where_the_page_has_them() -> None:
    shapes = [
        band(1.0, 2.0, "@green/0.28"),
        stretch(0.5, 1.5, "@muted/0.16"),
        level(2.5, "@ink", "dash", 1.2),
        upright(1.25, "@muted"),
        {**band(0.0, 3.0, "@blue/0.25"), "xref": "x", "x0": 0.2, "x1": 0.4},
    ]
    axes = one_panel([line(X, Y, "@blue", "n", "g")], shapes=shapes)
    across, along = axes.patches
    assert (across.get_y(), across.get_y() + across.get_height()) == (1.0, 2.0)
    assert (along.get_x(), along.get_x() + along.get_width()) == (0.5, 1.5)
    assert (across.get_alpha(), along.get_alpha()) == (0.28, 0.16)
    flat, vertical = axes.lines[1:]
    assert list(flat.get_ydata()) == [2.5, 2.5]
    assert (flat.get_linestyle(), flat.get_linewidth()) == ("--", pytest.approx(0.9))
    assert list(vertical.get_xdata()) == [1.25, 1.25]
    assert vertical.get_linestyle() == ":"
    (part,) = axes.collections
    assert (part.get_paths()[0].vertices[:, 0].min(), part.get_paths()[0].vertices[:, 0].max()) == (
        0.2,
        0.4,
    )


def test_a_residual_has_axes_of_its_own_and_a_share_has_none() -> None:
    lower = {**line(X, Y, "@orange", "n", "g"), "yaxis": "y2"}
    panel = Panel(
        [line(X, 2 * Y, "@blue", "n", "g"), lower],
        {
            "xaxis": axis("t"),
            "yaxis": axis("torque", domain=[0.4, 1]),
            "yaxis2": axis("residual", domain=[0, 0.3]),
        },
        "says",
    )
    top, bottom = sheet_of(Figure("key", "title", (panel,), "Read: it.")).axes
    assert (top.get_ylabel(), bottom.get_ylabel(), bottom.get_xlabel()) == (
        "torque",
        "residual",
        "t",
    )
    np.testing.assert_allclose(np.asarray(bottom.lines[0].get_ydata()), Y)
    assert top.get_position().height > bottom.get_position().height
    share = Panel(
        panel.traces, {**panel.layout, "yaxis2": {"range": [0, 1], "overlaying": "y"}}, "says"
    )
    first, second = sheet_of(Figure("key", "title", (share,), "Read: it.")).axes
    assert second.get_ylim() == (0, 1)
    assert not second.axison
    assert len(first.lines) == len(second.lines) == 1


def test_ticks_dates_and_zero_are_as_the_page_has_them() -> None:
    trace = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": ["2024-01-31T00:00:00", "2024-02-29T00:00:00"],
        "y": [1.0, 2.0],
    }
    axes = one_panel([{**trace, "line": {"color": "@blue"}}], yaxis=axis("y", rangemode="tozero"))
    assert axes.get_ylim()[0] == 0.0
    first, last = axes.lines[0].get_xdata()
    assert (last - first) == np.timedelta64(29, "D")
    names = axis(tickvals=[0, 1, 2], ticktext=["k1", "k2", "k$3"], range=[2.6, -0.6])
    axes = one_panel([line(X, Y, "@blue", "n", "g")], yaxis=names)
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["k1", "k2", r"k\$3"]
    assert axes.get_ylim() == (2.6, -0.6)


def test_a_legend_has_every_entry_of_the_page_and_missing_figures_no_file(tmp_path: Path) -> None:
    legend = (
        Legend("g", "a line", "@blue", "dash"),
        Legend("", "an area", "@blue/0.25", "area"),
        Legend("", "c", "@ink"),
    )
    panels = tuple(
        Panel([line(X, Y, "@blue", "n", "g")], {"xaxis": axis(), "yaxis": axis()}, "says")
        for _ in range(3)
    )
    sheet = sheet_of(Figure("key", "title", panels, "Read: it.", legend, columns=2))
    assert len(sheet.axes) == 3
    assert [text.get_text() for text in sheet.legends[0].get_texts()] == ["a line", "an area", "c"]
    assert sheet.get_figwidth() == pytest.approx(7.1)
    assert save_plots([Missing("key", "title", "gone")], tmp_path, "x") == []
