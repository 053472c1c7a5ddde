"""Figures for papers: every one of a page is saved, with the page's own values, words and ranges."""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Sheet
from typer.testing import CliRunner

from algid.errors import SettingError
from algid.report.figures.base import Figure, Panel, axis, line
from algid.report.gallery import gallery
from algid.report.plots import _save, save_plots
from algid.results import Result
from tests.cli.commands import app


def test_figures_are_saved_in_the_form_that_is_asked_for(case_folder: Path, result: Result, tmp_path: Path) -> None:
    shown = gallery(case_folder, result).every[:2]
    written = save_plots(shown, tmp_path, "case1", "png")
    assert [path.name for path in written] == [f"case1-{figure.key}.png" for figure in shown]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)


@pytest.mark.slow  # matplotlib takes fonts apart for every file
def test_the_command_saves_every_figure_of_the_page(case_folder: Path, result: Result, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))
    done = CliRunner().invoke(app, ["report", str(folder), "--save-plots", str(tmp_path / "figures")])
    assert done.exit_code == 0, done.output
    files = sorted((tmp_path / "figures").iterdir())
    keys = [figure.key for figure in gallery(case_folder, result).every]
    assert len(keys) == 11
    assert [path.stem.split("-", 1)[1] for path in files] == sorted(keys)
    assert all(path.read_bytes().startswith(b"%PDF") for path in files)


def test_a_sheet_holds_what_the_panel_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    sheets: list[Sheet] = []
    monkeypatch.setattr(Sheet, "savefig", lambda self, *_, **__: sheets.append(self))
    x, y = np.array([1.0, 10.0, 100.0]), np.array([2.0, 4.0, 8.0])
    layout = {
        "xaxis": axis("frequency, Hz", type="log", range=[0.0, 2.0]),
        "yaxis": axis("a &lt; $b$", range=[1.0, 9.0]),
    }
    panel = Panel([line(x, y, "@blue", "n", "g")], layout, "says", "Joint $1$")
    _save(Figure("key", "title", (panel,), "Read: it."), io.BytesIO(), "png")
    (drawn,) = sheets[0].axes
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
    with pytest.raises(SettingError, match=r"--save-plots: expected matplotlib.*pip install 'algid\[plots\]'"):
        save_plots(gallery(case_folder, result).every, tmp_path / "figures", "case1")
    assert not (tmp_path / "figures").exists()
