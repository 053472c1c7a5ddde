"""A comparison's page: what it draws is what the results hold, and its words count what
it draws.
"""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from algid.report.comparison import compare
from algid.report.comparison_page import comparison_document, verdict
from algid.report.figures.base import Figure
from algid.report.frame import page
from algid.results import Result, Status, write_result
from tests.cli.commands import app
from tests.report.folders import HOSTILE


def _moved(result: Result, sigmas: float) -> Result:
    moved = {
        name: found.model_copy(
            update={"estimate": (found.estimate or 0.0) + sigmas * 2**0.5 * (found.std or 0.0)}
        )
        for name, found in result.parameters.items()
    }
    return result.model_copy(update={"parameters": moved})


def _values(packed: dict[str, str]) -> list[float]:
    values: list[float] = np.frombuffer(
        base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}"
    ).tolist()
    return values


def _drawn(key: str, results: list[Result], labels: list[str]) -> Figure:
    """The figure of that key on the page."""
    content = comparison_document(compare(results, labels), results).content()
    (figure,) = [one for one in content if isinstance(one, Figure) and one.key == key]
    return figure


def test_distances_and_their_count_agree(result: Result) -> None:
    results = [result, _moved(result, 1.0), _moved(result, -5.0)]
    found = compare(results, ["a", "b", "c"])
    figure = _drawn("distances", results, ["a", "b", "c"])
    drawn = [_values(trace["x"]) for trace in figure.panels[0].traces]
    np.testing.assert_allclose(drawn[0][:7], 1.0, rtol=1e-5)  # seven constants, in single precision
    np.testing.assert_allclose(drawn[1][:7], -5.0, rtol=1e-5)
    inside = sum(abs(x) <= 1.96 for x in drawn[0] + drawn[1])
    assert figure.note.startswith(f"{inside} of {len(drawn[0]) + len(drawn[1])} differences")
    judged = verdict(found)
    assert judged.grade == "reservations"
    assert "of c (-5.0 σ)" in judged.sentence
    assert verdict(compare(results[:2], ["a", "b"])).grade == "good"


def test_intervals_are_those_of_the_results(result: Result) -> None:
    results = [result, _moved(result, 1.0)]
    figure = _drawn("intervals", results, ["a", "b"])
    first, second = figure.panels[0].traces
    k1 = result.parameters["k1"]
    assert k1.estimate is not None
    assert k1.std is not None
    assert _values(first["x"])[0] == 0.0
    # in σ: no row flattens another
    assert first["error_x"]["array"][0] == pytest.approx(1.96, rel=1e-3)
    assert _values(second["x"])[0] == pytest.approx(2**0.5, rel=1e-5)
    ticks = figure.panels[0].layout["yaxis"]["ticktext"]
    assert ticks[:7] == [f"k{n}" for n in range(1, 8)]  # one row a parameter
    assert len(ticks) == len(set(ticks))


def test_the_command_writes_the_page(result: Result, tmp_path: Path) -> None:
    for name, one in (("monday", result), ("friday", _moved(result, 0.5))):
        write_result(one, tmp_path / f"{name}.algid" / "result.json")
    folders = [str(tmp_path / f"{name}.algid") for name in ("monday", "friday")]
    done = CliRunner().invoke(app, ["compare", *folders, "-o", str(tmp_path / "page")])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "page/compare.html").read_text(encoding="utf-8")
    assert "Estimates side by side" in page
    assert page.count('class="reading">Read: ') == 2
    assert not re.findall(r'(?:src|href)="(?!#|data:)', page)


def test_a_status_stands_under_its_number(result: Result) -> None:
    poor = result.parameters["k2"].model_copy(update={"status": Status.NOT_SIGNIFICANT})
    other = result.model_copy(update={"parameters": {**result.parameters, "k2": poor}})
    text = page(comparison_document(compare([result, other], ["a", "b"]), [result, other]))
    assert text.count('<span class="aside">(NOT_SIGNIFICANT)</span></td>') == 1


def test_a_name_that_attacks_stays_text(result: Result) -> None:
    results = [result, _moved(result, 1.0)]
    text = page(comparison_document(compare(results, [HOSTILE, "b"]), results))
    assert "<img" not in text
    assert text.count("<script") == 3
