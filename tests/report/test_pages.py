"""The page of an identification: its numbers, its promises, what it makes of what is missing."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from collections import Counter
from importlib import resources
from pathlib import Path

import plotly.graph_objects as go
import pytest

from algid.base.errors import ResultError
from algid.notices import Verdict
from algid.report.document import Document, Section, Table
from algid.report.page import write_pages
from algid.report.render import library, markdown
from algid.results import (
    Bound,
    Result,
    Status,
    TermCriterion,
    TorquePrediction,
    WhitenessTest,
    read_result,
    write_result,
)
from algid.results.rows import rows_of
from tests.report.folders import HOSTILE, hostile
from tests.report.pages import Page, typed

FIGURES = [
    "intervals", "torque", "residual", "running", "signals", "coverage",
    "correlation", "information", "estimates", "loaded",
]  # fmt: skip


def written(folder: Path, result: Result | None = None, shared: bool = False) -> Page:
    if result is not None:
        write_result(result, folder / "result.json")
    return Page(write_pages(folder, shared)[0].read_text(encoding="utf-8"))


def test_the_page_leads_with_the_arm_and_its_tables_hold_the_estimates(
    folder: Path, result: Result
) -> None:
    shown = written(folder)
    assert list(shown.tables)[:2] == ["Constants", "Payload"]
    heads, rows = shown.tables["Constants"]
    assert heads[:5] == ["Parameter", "Estimate", "± 95 %", "Unit", "Status"]
    every = rows_of(result, result.parameters)
    assert [row[:5] for row in rows] == [[o.name, o.value, o.half, o.unit, o.status] for o in every]
    assert "<h1>case1-unloaded.mcap and 1 more</h1>" in shown.text
    facts = "7 of 7 constants identified · refined estimator · 8.000 s of log at 1000 Hz · 8,002"
    assert facts in shown.text
    heads, rows = shown.tables["Table 4"]
    paper = {row[0]: row[heads.index("Paper, %")] for row in rows}
    assert paper["k1"] == "0.2449"
    settings = dict(shown.tables["Settings"][1])

    assert (settings["velocity"], settings["used.torque_hold.used"]) == ("observer", "foh")
    assert not [name for name in settings if ".channels." in name]
    assert shown.tables["Torque prediction"][1][0][:2] == ["logs used", "1"]


def test_tables_have_what_the_fit_knows(folder: Path, result: Result) -> None:
    assert result.fit is not None
    prediction = TorquePrediction(
        rmse=(0.1234, 2), nrmse=(0.05, 0.5), r2=(0.9975, 0.75), filter="none",
        rmse_moving=(0.1, 1), rmse_rest=(0.2, None), rmse_held=(0.02, None),
    )  # fmt: skip
    tried = TermCriterion(term="rotor", delta_bic=-12.34, evidence=3.3, kept=True)
    broken = Bound(bound="k7 >= 0", value=-0.31, distance_sigma=4.04)
    known = {"residual": prediction, "terms": [tried], "broken_bounds": [broken]}
    known["cross_validation"] = prediction.model_copy(update={"rmse_rest": None})
    test = WhitenessTest(white=False, p_value=0.01234, lag1_correlation=0.5)
    known["whiteness"] = {"tau1": test}
    fit = result.fit.model_copy(update={**known, "noise": {"tau1": 0.0123, "theta2": 1e-4}})
    vague = result.parameters["k1"].model_copy(update={"status": Status.NOT_SIGNIFICANT})
    every = {"fit": fit, "estimator": "weak", "parameters": {**result.parameters, "f1": vague}}
    shown = written(folder, result.model_copy(update=every))
    rows = {title: rows for title, (_, rows) in shown.tables.items()}
    assert rows["Torque prediction"] == [
        ["logs used", "1", "0.123", "5.00", "0.99750", "0.100", "0.200", "0.0200"],
        ["logs used", "2", "2.00", "50.0", "0.75000", "1.00", "–", "–"],
        ["each log by the others", "1", "0.123", "5.00", "0.99750", "0.100", "–", "0.0200"],
        ["each log by the others", "2", "2.00", "50.0", "0.75000", "1.00", "–", "–"],
    ]
    assert shown.tables["Terms tried"] == (
        ["Term", "Change of BIC", "Beyond chance", "Kept"], [["rotor", "-12.3", "+3.3", "yes"]],
    )  # fmt: skip
    assert [row[0] for row in rows["Terms whose interval holds zero"]] == ["f1"]
    assert rows["Noise of the logs"] == [["tau1", "0.0123", "N m"], ["theta2", "1.00e-4", "rad"]]
    assert rows["Whiteness of the residual"] == [["tau1", "no", "0.012", "0.500"]]
    assert "The intervals rest on the likelihood" in shown.text
    assert rows["Physical bounds that are broken"] == [["k7 >= 0", "-0.3100", "4.0"]]
    assert [row[1:3] for row in rows["Logs"]] == [["unloaded", "mcap"], ["loaded", "mcap"]]
    assert {row[2] for row in rows["Channels"]} == {"all logs"}
    origin = dict(rows["Provenance"])
    assert origin["estimator"] == "weak, in place of refined"
    assert origin["sha256 of case1-unloaded.mcap"] == result.log.sha256
    parts = re.findall(r'<details class="part" id="(\w*)"><summary><h2>([^<]*)<', shown.text)
    assert parts == [
        ("zero", "1 term of the torque may be zero"),
        ("fit", "Noise, whiteness and bounds"),
        ("data", "Data quality"),
        ("settings", "Settings and provenance"),
        ("paper", "The paper&#39;s figure and tables"),
    ]
    paper = written(folder, result.model_copy(update={"estimator": "paper"})).text
    assert '<details class="part" id="paper" open>' in paper


def test_every_figure_is_there_and_plotly_takes_it(folder: Path) -> None:
    figures = written(folder).figures
    arm = figures.pop("arm")
    assert list(figures) == FIGURES
    assert len(arm["t"]) == len(arm["theta1"]) == len(arm["theta2"]) > 100
    layout = figures["estimates"]["layout"]
    *axes, condition = (layout[name] for name in layout if name.startswith("yaxis"))
    assert condition["type"] == "log"
    assert all("range" in axis for axis in axes)
    for figure in figures.values():
        made = go.Figure(figure)  # which refuses what its script does not know
        assert len(made.data) == len(figure["data"]) > 0
        held = Counter(trace["xaxis"] for trace in figure["data"])
        assert max(held.values()) - min(held.values()) <= 1  # panels show as much
        assert len(held) == sum(name.startswith("xaxis") for name in figure["layout"])
        for trace in figure["data"]:
            assert trace["xaxis"].replace("x", "y") == trace["yaxis"]  # of one panel
            if isinstance(trace["x"], dict) and isinstance(trace["y"], dict):
                assert typed(trace["x"]).size == typed(trace["y"]).size


def test_only_the_pages_own_scripts_run_and_nothing_is_asked_of_any_host(folder: Path) -> None:
    shown = written(folder)
    policy = next(a for t, a in shown.tags if t == "meta" and "http-equiv" in a)
    nonce = re.search(r"script-src 'nonce-([0-9a-f]{64})'", policy["content"])
    assert nonce is not None
    assert policy["content"].startswith("default-src 'none'; script-src 'nonce-")
    assert nonce[1] == hashlib.sha256(shown.text.replace(nonce[1], "").encode()).hexdigest()
    scripts = [attrs for tag, attrs in shown.tags if tag == "script"]
    assert [one.get("nonce") for one in scripts] == [None, None, nonce[1]]
    assert [one.get("id") for one in scripts] == ["figures", "library", None]
    assert not [attrs for _, attrs in shown.tags if "src" in attrs]
    ids = [attrs["id"] for _, attrs in shown.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    links = {attrs["href"] for _, attrs in shown.tags if "href" in attrs} - {"data:,"}
    assert links <= {f"#{one}" for one in ids}
    assert {"#numbers", "#torque", "#data", "#settings", "#paper"} <= links
    assert written(folder).text == shown.text  # the same result gives the same bytes
    changed = written(folder, hostile(read_result(folder)))
    assert nonce[1] not in changed.text


def test_foreign_text_stays_text(folder: Path, result: Result) -> None:
    shown = written(folder, hostile(result))
    tags = Page(shown.prose).tags
    assert {"img", "b", "script"}.isdisjoint(tag for tag, _ in tags)
    assert not [attrs for _, attrs in tags if any(name.startswith("on") for name in attrs)]
    assert html.escape(HOSTILE).replace("&quot;", "&#34;").replace("&#x27;", "&#39;") in shown.text
    assert shown.text.count("<script") == 3
    assert shown.text.count("<svg") == 1  # the arm
    texts = json.dumps(shown.figures, ensure_ascii=False)
    assert "<img" not in texts
    assert "&lt;script" in texts or "script&gt;" in texts  # a log's name over its part
    for character in "\x1b\x07\u202e":
        assert character not in shown.text + texts
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert r"\<script\>" in text
    assert not re.search(r"(?<!\\)<(?!details|summary|/details|/summary)|(?<!\\)@", text)
    assert "\x1b" not in text


def test_one_library_serves_a_folder_of_reports(folder: Path) -> None:
    shown = written(folder, shared=True)
    script = folder.parent / "plotly.min.js"
    assert script.read_bytes() == gzip.decompress(library())
    (_, linked), *_ = [(t, a) for t, a in shown.tags if t == "script" and "src" in a]
    assert linked["src"] == "../plotly.min.js"
    assert linked["nonce"] in shown.text
    assert 'id="library"' not in shown.text
    script.write_text("another version")
    written(folder, shared=True)
    assert script.stat().st_size > 1_000_000
    alone = written(folder).text
    assert base64.b64encode(library()).decode() in alone


@pytest.mark.skipif(
    not (resources.files("algid.report") / "assets/plotly.min.js.gz").is_file(),
    reason="built without npm: pages carry the whole of plotly",
)
def test_a_page_is_light(folder: Path) -> None:
    assert len(written(folder).text.encode()) <= 1_100_000


def test_a_bare_result_still_makes_a_page(tmp_path: Path, result: Result) -> None:
    bare = tmp_path / "bare.algid"
    shown = written(bare, result.model_copy(update={"fit": None, "more_logs": []}))
    assert shown.figures == {}
    assert {one.name for one in bare.iterdir()} == {"report.html", "report.md", "result.json"}
    assert 'class="first"' in shown.text  # nothing stands beside the numbers
    with pytest.raises(ResultError, match="cannot read it"):
        write_pages(tmp_path)


def test_markdown_has_every_table_and_a_command_that_can_be_copied() -> None:
    command = "algid identify 'a `b` ```c```.csv' --force"
    failed = Verdict("failed", "it failed", command=command)
    table = Table("T & Co", "A | N", [("x|y", "1")], "a note")
    parts = [
        Section("one", "One", [table]),
        Section("none", "None", [Table("empty", "A", ()), ()]),
        Section("two", "Two", ["a sentence", Table("U", "B", [("x|z",)])], folded=True),
    ]
    text = markdown(Document(failed, parts, "a kicker", "name"))
    lines = text.splitlines()
    assert lines[0] == "### A kicker: name"
    assert "❌ **Failed**: it failed." in text
    at = lines.index("    " + command)
    assert lines[at - 1] == lines[at + 1] == ""
    before, _, after = text.partition("<details>")
    assert before.count(r"**T & Co**".replace("&", r"\&")) == 1
    assert r"| x\|y | 1 |" in before
    assert "**U**" in after
    assert r"| x\|z |" in after
    assert after.rstrip().endswith("</details>")
    assert "| :-- | --: |" in before
    assert "empty" not in text
