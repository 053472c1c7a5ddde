from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import polars as pl
import pytest

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.notices import Notice
from algid.report.document import Depth, Document
from algid.report.figures.base import Figure, Missing
from algid.report.figures.timeline import views
from algid.report.frame import library, page
from algid.report.gallery import gallery
from algid.report.page import page_html, result_document, write_report
from algid.report.series import LogRange
from algid.report.text import escaped, script_json
from algid.results import Estimate, Result, Status, TermCriterion, read_result, write_result
from algid.verdict import Verdict
from tests.report.folders import HOSTILE, hostile

BUNDLE = Path(str(resources.files("algid.report"))) / "assets/plotly.min.js.gz"


@pytest.fixture
def folder(case_folder: Path, tmp_path: Path) -> Path:
    """A copy of the complete folder, to be changed."""
    return Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))


class Tags(HTMLParser):
    """Elements with their attributes, and the text of scripts left out."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def test_every_figure_is_one_that_plotly_knows(case_folder: Path, result: Result) -> None:
    shown = gallery(case_folder, result)
    figures = [*shown.figures, *shown.paper]
    assert [figure.title for figure in figures if isinstance(figure, Missing)] == []
    assert len(figures) == 11
    for figure in figures:
        assert isinstance(figure, Figure)
        assert figure.reading.startswith("Read: ")
        for panel in figure.panels:
            go.Figure(
                {"data": _without_tokens(panel.traces), "layout": _without_tokens(panel.layout)}
            )


def _without_tokens(value: object) -> object:
    """Colour tokens replaced by a colour, as the page's script does."""
    if isinstance(value, str):
        return "#123456" if value.startswith("@") else value
    if isinstance(value, dict):
        return {name: _without_tokens(item) for name, item in value.items()}
    return [_without_tokens(item) for item in value] if isinstance(value, list) else value


def test_the_page_asks_nothing_of_any_host(folder: Path) -> None:
    text = write_report(folder).read_text(encoding="utf-8")
    tags = Tags(re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)).found
    assert not [tag for tag, attrs in tags if "src" in attrs]
    links = [attrs.get("href") or "" for _, attrs in tags if "href" in attrs]
    assert all(link.startswith(("#", "data:,")) for link in links)
    policy = next(
        attrs["content"] for tag, attrs in tags if tag == "meta" and "http-equiv" in attrs
    )
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-eval" not in policy
    assert "http" not in policy


def test_one_library_serves_a_folder_of_reports(folder: Path) -> None:
    page = write_report(folder, shared_library=True)
    assert (folder.parent / "plotly.min.js").stat().st_size > 1_000_000
    assert page.stat().st_size <= 1_000_000
    assert '<script nonce="' in page.read_text(encoding="utf-8")


def test_a_page_alone_is_within_eight_megabytes(folder: Path) -> None:
    assert write_report(folder).stat().st_size <= 8_000_000


def test_the_same_folder_gives_the_same_bytes(folder: Path) -> None:
    assert write_report(folder).read_bytes() == write_report(folder).read_bytes()


def test_foreign_text_stays_text(folder: Path, result: Result) -> None:
    write_result(hostile(result), folder / "result.json")
    text = write_report(folder).read_text(encoding="utf-8")
    own = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", text, flags=re.DOTALL)
    # the page's own drawings
    own = re.sub(r'<svg (?:class="forest"|viewBox="-).*?</svg>', "", own, flags=re.DOTALL)
    tags = Tags(own).found
    assert {"img", "svg", "b", "script"}.isdisjoint(tag for tag, _ in tags)
    assert not [attrs for _, attrs in tags if any(name.startswith("on") for name in attrs)]
    assert escaped(HOSTILE) in own
    # the data, the library, the page's own, the arm's frames and its player
    assert text.count("<script") == 5
    for character in "\x1b\x07\u202e":
        assert character not in text


def test_data_cannot_end_its_script() -> None:
    text = script_json({"a": "</script><!--&\u2028"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": "</script><!--&\u2028"}


@pytest.mark.parametrize("name", ["estimates", "torque", "information", "innovations", "running"])
def test_the_page_says_which_file_is_absent(folder: Path, name: str) -> None:
    (folder / f"{name}.parquet").unlink()
    assert f"Not shown: {name}.parquet is not in this folder." in write_report(folder).read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize(
    "name", ["estimates", "loaded", "torque", "information", "innovations", "running"]
)
def test_the_page_says_which_file_is_broken(folder: Path, name: str) -> None:
    (folder / f"{name}.parquet").write_bytes(b"PAR1 no parquet")
    assert "cannot read it as Parquet" in write_report(folder).read_text(encoding="utf-8")


def test_a_missing_column_is_named(folder: Path) -> None:
    path = folder / "torque.parquet"
    pl.read_parquet(path).drop("omega2").write_parquet(path)
    assert "expected a column &#x27;omega2&#x27;" in write_report(folder).read_text(
        encoding="utf-8"
    )


def test_a_bare_result_still_makes_a_page(tmp_path: Path, result: Result) -> None:
    bare = tmp_path / "bare.algid"
    write_result(result.model_copy(update={"fit": None, "more_logs": []}), bare / "result.json")
    text = write_report(bare).read_text(encoding="utf-8")
    assert text.count("Not shown: ") == 6
    assert "the estimator refined gives no covariance" in text


def test_a_folder_without_a_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="cannot read it"):
        write_report(tmp_path)


def test_nothing_is_lost_of_a_torque_log_in_blocks(
    case_folder: Path, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = gallery(case_folder, result).torque
    assert whole is not None
    rows = pl.read_parquet(case_folder / "torque.parquet")
    residual = (rows["tau1"] - rows["tau1_predicted"]).to_numpy()
    assert whole.residual_rms[0] == pytest.approx(float(np.sqrt(np.mean(residual**2))), rel=1e-12)
    log, moment = whole.worst[1]
    largest = rows.filter((pl.col("log") == log) & (pl.col("t") == moment))
    assert abs(largest["tau1"][0] - largest["tau1_predicted"][0]) == np.abs(residual).max()
    monkeypatch.setattr("algid.report.reduce.blocks.__defaults__", (317,))
    cut = gallery(case_folder, result).torque
    assert cut is not None
    for log, span in whole.ranges.items():
        assert cut.ranges[log] == replace(span, period=cut.ranges[log].period)
        # a median of other stamps
        assert cut.ranges[log].period == pytest.approx(span.period, rel=1e-9)
    assert cut.extremes == whole.extremes
    np.testing.assert_array_equal(cut.motion, whole.motion)
    for name, series in whole.series[1].items():
        np.testing.assert_array_equal(cut.series[1][name], series)


def test_gaps_are_counted(folder: Path, result: Result) -> None:
    path = folder / "torque.parquet"
    pl.read_parquet(path).filter(~pl.col("t").is_between(1.0, 1.5)).write_parquet(path)
    found = gallery(folder, result).torque
    assert found is not None
    assert [span.gaps for span in found.ranges.values()] == [1, 1]
    assert found.ranges[0].largest_gap == pytest.approx(0.502, abs=1e-9)
    assert np.isnan(found.series[0]["tau1"][1]).any()


def test_a_log_without_prediction_has_its_torque_alone(folder: Path) -> None:
    path = folder / "torque.parquet"
    lost = [pl.lit(None, pl.Float64).alias(f"tau{joint}_predicted") for joint in (1, 2)]
    pl.read_parquet(path).with_columns(lost).write_parquet(path)
    text = write_report(folder).read_text(encoding="utf-8")
    assert "8,000 samples have no predicted torque" in text
    assert "Not shown: no torque is predicted" in text


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("lost", ["numbers", "rows"])
def test_a_motion_without_numbers_is_not_drawn(folder: Path, lost: str) -> None:
    path = folder / "torque.parquet"
    whole = pl.read_parquet(path)
    numbers = whole.with_columns(pl.lit(None, pl.Float64).alias("theta1"))
    {"numbers": numbers, "rows": whole.clear()}[lost].write_parquet(path)
    text = write_report(folder).read_text(encoding="utf-8")
    assert "the column 'theta1' holds no number" in html.unescape(text)


def _ids(text: str) -> Iterator[str]:
    yield from re.findall(
        r'\sid="([^"]+)"', re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    )


def test_numbers_that_no_arm_has_are_told_and_not_drawn(folder: Path, result: Result) -> None:
    huge = Estimate(estimate=9e29, std=9.9e29, ci95=(-1.1e30, 1.7e29), unit="kg m^2")
    assert result.fit is not None
    fit = result.fit.model_copy(update={"covariance": [[9e59] * 7] * 7})
    names = dict.fromkeys(result.parameters, huge)
    write_result(
        result.model_copy(update={"parameters": names, "fit": fit}), folder / "result.json"
    )
    torque = pl.read_parquet(folder / "torque.parquet")
    beyond = (
        pl.when(pl.int_range(pl.len()) % 3 == 0)
        .then(pl.lit(-1.7e308))
        .otherwise(pl.col("tau1_predicted"))
    )
    torque.with_columns(tau1_predicted=beyond).write_parquet(folder / "torque.parquet")
    page = write_report(folder).read_text(encoding="utf-8")  # pytest makes any overflow an error
    assert "[−1.1e30" in page or "[-1.1e30" in page or "1.7e29" in page
    assert "k1, k3 or k5 has no estimate that can be drawn" in page


def test_every_link_within_the_page_leads_somewhere(folder: Path) -> None:
    text = write_report(folder).read_text(encoding="utf-8")
    ids = list(_ids(text))
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(ids)


def test_numbers_are_legible_on_the_strongest_colours_of_a_matrix() -> None:
    style = (resources.files("algid.report") / "assets/report.css").read_text(encoding="utf-8")
    light, dark = style.split("@media (prefers-color-scheme: dark)")[:2]
    for theme in (light, dark):
        colours = {
            name: _channels(value) for name, value in re.findall(r"--(\w+): (#\w{6});", theme)
        }
        for strong in ("blue", "orange"):
            ground = 0.5 * colours[strong] + 0.5 * colours["page"]
            high, low = sorted((_luminance(ground), _luminance(colours["ink"])), reverse=True)
            assert (high + 0.05) / (low + 0.05) >= 4.5  # WCAG AA


def _channels(colour: str) -> FloatArray:
    return np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255


def _luminance(colour: FloatArray) -> float:
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_the_result_is_read_from_the_folder(folder: Path) -> None:
    assert read_result(folder).log.path.endswith("case1-unloaded.mcap")


def test_the_library_in_a_page_is_the_one_that_was_built_for_it(folder: Path) -> None:
    own = library()
    assert gzip.decompress(base64.b64decode(own.packed)).decode() == own.script
    page = write_report(folder).read_text(encoding="utf-8")
    assert own.packed in page
    digest = base64.b64encode(hashlib.sha256(own.script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in page


@pytest.mark.skipif(
    not BUNDLE.is_file(), reason="built without npm: pages carry the whole of plotly"
)
def test_a_page_is_light(folder: Path) -> None:
    assert write_report(folder).stat().st_size <= 1_200_000


def test_the_papers_part_is_open_for_its_own_cases_and_folded_for_a_real_log(
    folder: Path, result: Result
) -> None:
    assert '<details class="paper" id="paper" open>' in page_html(folder, result)
    rows = [row.model_copy(update={"truth": None, "error_percent": None}) for row in result.table4]
    real = page_html(folder, result.model_copy(update={"table4": rows, "truth": {}}))
    assert '<details class="paper" id="paper">' in real
    before, after = real.split('<details class="paper" id="paper">')
    assert 'id="convergence-0"' not in before
    assert 'id="convergence-0"' in after
    assert (
        before.index('id="torque"')
        < before.index('id="innovations"')
        < before.index('id="running"')
        < before.index('id="signals"')
    )


def test_rows_that_must_not_be_used_are_not_green(folder: Path, result: Result) -> None:
    poor = result.parameters["k1"].model_copy(update={"status": Status.NOT_CONVERGED})
    failed = page_html(
        folder, result.model_copy(update={"parameters": {**result.parameters, "k1": poor}})
    )
    assert 'class="verdict failed"' in failed
    assert 'class="status ok"' not in failed
    assert failed.count('<tr class="doubtful">') >= len(result.parameters)
    assert '<tr class="doubtful">' not in page_html(folder, result)


def test_a_choice_of_logs_moves_the_time_axis(result: Result) -> None:
    ranges = {0: LogRange(0.0, 2.0, 200), 1: LogRange(5.0, 8.0, 300)}
    logs = [result.log, result.log.model_copy(update={"path": "second.csv"})]
    assert views({0: ranges[0]}, logs) == ()
    (_, first, end), (name, start, last) = views(ranges, logs)
    assert (first, end, name) == (0.0, 2.0, "second.csv")
    assert last - start == pytest.approx(3.0)
    assert start > end


def test_each_logs_own_estimate_is_a_dot_of_the_forest_plot(folder: Path, result: Result) -> None:
    assert result.fit is not None
    k1 = result.parameters["k1"]
    assert k1.estimate is not None
    own = [
        {"k1": k1.model_copy(update={"estimate": share * k1.estimate})} for share in (0.999, 1.001)
    ]
    both = [result.log, result.log.model_copy(update={"path": "second.csv"})]
    changes = {"fit": result.fit.model_copy(update={"by_log": own}), "more_logs": both[1:]}
    page = page_html(folder, result.model_copy(update=changes))
    row = re.search(r'<tr><th scope="row">k1</th>.*?</tr>', page, re.DOTALL)
    assert row is not None
    assert row[0].count('class="log"') == 2
    assert "grey dots: each unloaded log by itself, hollow at the edge" in page
    loaded = [both[0], both[1].model_copy(update={"role": "loaded"})]
    changes["more_logs"] = loaded[1:]  # whose k1 holds the payload's share
    assert 'class="log"' not in page_html(folder, result.model_copy(update=changes))


def test_what_was_tried_stands_second_with_what_it_gains(folder: Path, result: Result) -> None:
    assert result.fit is not None
    terms = [
        TermCriterion(
            term="coulomb", kept=True, gain_heldout=0.5, evidence=40.0, why="kept: predicts better"
        ),
        TermCriterion(term="offset", kept=False, gain_heldout=-0.01, evidence=-4.0, why="left out"),
    ]
    page = page_html(
        folder, result.model_copy(update={"fit": result.fit.model_copy(update={"terms": terms})})
    )
    order = [page.index(f'id="{key}"') for key in ("torque", "terms", "closeup", "innovations")]
    assert order == sorted(order)
    assert "a bar to the left lowers the error" in page
    assert page.count('class="less"') == 1


def test_a_page_shows_three_reasons_and_folds_the_rest_and_the_notes() -> None:
    reasons = tuple(Notice("A", f"reason {place}", logs=("a.csv",)) for place in range(5))
    notes = (Notice("B", "a note", note=True),)
    verdict = Verdict("reservations", "k1 is known", reasons, notes)
    shown = page(Document("Title", verdict, (), "kicker", "name", "facts", "made"))
    first, _, rest = shown.partition("<details>")
    assert [place for place in range(5) if f"reason {place}" in first] == [0, 1, 2]
    assert "2 more reasons" in rest
    assert "data notes (1)" in rest
    assert "a.csv: reason 4" in rest


def test_a_page_of_the_papers_method_begins_with_its_figure_and_lacks_nothing(
    folder: Path, result: Result
) -> None:
    for name in ("torque", "innovations", "running", "information"):
        (folder / f"{name}.parquet").unlink()
    of_paper = result.model_copy(update={"estimator": "paper", "fit": None})
    document = result_document(of_paper, gallery(folder, of_paper))
    figures = [one for one in document.content() if isinstance(one, Figure)]
    assert [one.key for one in figures[:2]] == ["convergence", "loaded"]
    assert "Figure 2" in figures[0].title
    assert not [one for one in document.content() if isinstance(one, Missing)]
    assert not any(section.fold for section in document.sections)
    (table,) = [one for one in document.tables(*Depth) if one.title == "Table 4"]
    assert "was sought for this table" in table.note
    # which another estimator does not lack by nature
    other = result.model_copy(update={"fit": None})
    shown = result_document(other, gallery(folder, other))
    assert [one for one in shown.content() if isinstance(one, Missing)]
