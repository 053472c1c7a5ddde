from __future__ import annotations

import html
import io
import json
import re
from pathlib import Path

import pytest
from rich.console import Console

from algid.model import PARAMETERS
from algid.report.document import Table
from algid.report.markdown import escaped, markdown
from algid.report.page import FIRST, TOLD_ELSEWHERE, page_html, result_document, write_report
from algid.report.tables import (
    by_state,
    estimate_tables,
    flat_settings,
    log_tables,
    settings_table,
    terms_tables,
    used_settings,
)
from algid.report.terminal import print_document
from algid.results import (
    Estimate,
    Result,
    Status,
    TermCriterion,
    TorqueModel,
    TorquePrediction,
    result_json,
)
from algid.text import digits_of, resolved, significant
from tests.report.folders import estimate, hostile


def terminal(result: Result, width: int = 200, **options: object) -> str:
    stream = io.StringIO()
    console = Console(file=stream, width=width, **options)  # type: ignore[arg-type]
    print_document(result_document(result), console)
    return stream.getvalue()


def from_markdown(text: str) -> list[list[str]]:
    cells = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return [
        [re.sub(r"\\(.)", r"\1", cell) for cell in row]
        for row in cells
        if not row[0].startswith(":--")
    ]


def from_html(text: str) -> list[list[str]]:
    text = re.sub(r'<t[hd][^>]*class="drawn[^>]*>.*?</t[hd]>', "", text, flags=re.DOTALL)
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", text, re.DOTALL)
    return [
        [html.unescape(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)]
        for row in rows
    ]


def from_terminal(text: str, heading: str) -> list[list[str]]:
    """Rows of the table under `heading`, split where two blanks part the cells."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.strip() == heading) + 3
    rows = []
    for line in lines[start:]:
        if not line.strip():
            break
        rows.append(re.split(r"\s{2,}", line.strip()))
    return rows


def test_every_format_shows_the_same_digits_and_json_holds_them(
    result: Result, case_folder: Path
) -> None:
    parameters = next(table for table in estimate_tables(result) if table.title == "Parameters")
    expected = [list(row) for row in parameters.rows]
    first = [list(row) for row in parameters.without(TOLD_ELSEWHERE).rows]
    page = from_html(write_report(case_folder, shared_library=True).read_text(encoding="utf-8"))
    assert [row for row in page if row in first][: len(first)] == first
    assert from_markdown(markdown(result_document(result)))[1 : 1 + len(expected)] == expected
    assert from_terminal(terminal(result), "Parameters") == expected
    stored = json.loads(result_json(result))["parameters"]
    for name, shown, std, *_ in expected:
        number, spread = stored[name]["estimate"], stored[name]["std"]
        assert float(shown) == pytest.approx(
            number, rel=0.501 * 10 ** (1 - digits_of(number, spread))
        )
        assert shown == resolved(number, spread)
        assert std == significant(spread, 2)


def test_every_table_reaches_html_and_markdown_alike(result: Result, case_folder: Path) -> None:
    page = from_html(write_report(case_folder).read_text(encoding="utf-8"))
    text = from_markdown(markdown(result_document(result)))
    for table in estimate_tables(result):
        first = table.without(TOLD_ELSEWHERE) if table.title in FIRST else table
        for made, found in ((first, page), (table, text)):
            for row in (tuple(column.heading for column in made.columns), *made.rows):
                assert list(row) in found


def test_truth_and_the_papers_error_stand_beside_the_estimate(result: Result) -> None:
    parameters, *_ = estimate_tables(result)
    headings = [column.heading for column in parameters.columns]
    row = dict(zip(headings, parameters.rows[0], strict=True))
    assert row["Parameter"] == "k1"
    assert row["Truth"] == "8.1532e-4"  # m2 l1 lc2 of Table 3
    assert row["Paper %"] == "0.2449"


def test_the_truth_of_what_table_4_lacks_is_the_arms_own(result: Result) -> None:
    k5 = result.parameters["k5"].estimate
    assert k5 is not None
    known = result.model_copy(update={"truth": {"k1": 7.0, "k5": k5 / 1.25, "l1": 0.1626}})
    parameters, payload, *_ = estimate_tables(known)
    headings = [column.heading for column in parameters.columns]
    rows = {row[0]: dict(zip(headings, row, strict=True)) for row in parameters.rows}
    assert rows["k5"]["Error %"] == "25.00"
    assert rows["k5"]["Paper %"] == "–"  # the paper gives the sum k5+k3 alone
    assert rows["k1"]["Truth"] == "8.1532e-4"  # Table 4's own
    assert "0.16260" in next(row for row in payload.rows if row[0] == "l1")


def test_cross_validation_stands_beside_the_residual_in_every_format(
    result: Result, case_folder: Path
) -> None:
    crossed = TorquePrediction(
        rmse=(0.25, 0.125), nrmse=(0.5, 0.0625), r2=(0.75, 0.996), filter="3 Hz"
    )
    assert result.fit is not None
    changed = result.model_copy(
        update={"fit": result.fit.model_copy(update={"cross_validation": crossed})}
    )
    expected = ["each log by the others", "1", "0.250", "50.0", "0.75000"]
    assert expected in from_terminal(terminal(changed), "Torque prediction")
    assert expected in from_markdown(markdown(result_document(changed)))
    assert expected in from_html(page_html(case_folder, changed))


def test_rmse_moving_and_at_rest_stands_under_the_table(result: Result) -> None:
    found = TorquePrediction(
        rmse=(0.25, 0.125),
        nrmse=(0.5, 0.0625),
        r2=(0.75, 0.996),
        filter="3 Hz",
        rmse_moving=(0.5, 0.125),
        rmse_rest=(0.0625, None),
        rmse_held=(0.015, None),
    )
    words = "joint 1 0.500 moving, 0.0625 at rest, 0.0150 at rest beyond ± f of dry friction"
    assert by_state(found) == f"{words}; joint 2 0.125 moving (N m)"
    assert not by_state(found.model_copy(update={"rmse_rest": (None, None)}))
    assert not by_state(found.model_copy(update={"rmse_rest": None}))
    assert result.fit is not None
    changed = result.model_copy(
        update={"fit": result.fit.model_copy(update={"cross_validation": found})}
    )
    assert f"RMSE of each log by the others: {words}" in " ".join(terminal(changed).split())


def test_the_error_belongs_to_the_estimate_beside_it(result: Result) -> None:
    row = result.table4[0].model_copy(
        update={"parameter": "m_p", "estimate": 0.5, "truth": 0.5, "error_percent": 0.0}
    )
    other = {"m_p": Estimate(estimate=0.51, unit="kg")}
    changed = result.model_copy(update={"table4": [row], "paper_payload": other, "payload": {}})
    table = next(table for table in estimate_tables(changed) if "route" in table.title)
    (shown,) = table.rows
    assert shown[:-1] == ("m_p", "0.51000", "kg", "OK", "0.50000", "2.000", "0.2449")
    assert shown[-1] == PARAMETERS["m_p"].meaning


def test_a_column_that_nobody_fills_is_dropped(result: Result) -> None:
    bare = {"k1": Estimate(estimate=1.0, unit="kg m^2")}
    tables = estimate_tables(
        result.model_copy(update={"parameters": bare, "table4": [], "payload": {}})
    )
    assert [column.heading for column in tables[0].columns] == [
        "Parameter",
        "Estimate",
        "Unit",
        "Status",
        "Meaning",
    ]
    assert tables[0].rows == (("k1", "1.0000", "kg m²", "OK", PARAMETERS["k1"].meaning),)
    unnamed = {"k1+z3": Estimate(estimate=1.0, unit="kg m^2")}
    loaded = estimate_tables(result.model_copy(update={"loaded": unnamed}))
    table = next(table for table in loaded if table.title == "Loaded arm")
    assert "Meaning" not in [column.heading for column in table.columns]


def test_an_unbounded_interval_is_shown_as_one(result: Result) -> None:
    lost = Estimate(estimate=None, ci95=(None, None), unit="N m", status=Status.NOT_IDENTIFIABLE)
    table = estimate_tables(result.model_copy(update={"parameters": {"k2": lost}}))[0]
    assert "[−∞, ∞]" in table.rows[0]
    assert "NOT_IDENTIFIABLE" in table.rows[0]


def test_settings_are_flat_and_plain() -> None:
    nested = {"a": {"b": True, "c": None}, "d": [1.0, 2], "e": {}, "f": 1e-3}
    assert flat_settings(nested) == {"a.b": "yes", "a.c": "–", "d": "1, 2", "e": "{}", "f": "0.001"}


def test_channels_name_a_log_only_where_they_differ(result: Result) -> None:
    channels = log_tables(result.logs)[1]
    assert {row[2] for row in channels.rows} == {"all logs"}
    other = result.more_logs[0].model_copy(update={"mapping": {"theta1": "q1"}})
    differing = log_tables(result.model_copy(update={"more_logs": [other]}).logs)[1]
    theirs = [row for row in differing.rows if row[0] == "theta1"]
    assert [row[2] for row in theirs] == ["case1-unloaded.mcap", "case1-loaded.mcap"]
    assert theirs[1][1] == "q1"
    assert differing.rows[-1][2] == "case1-unloaded.mcap"  # the other log has no such signal
    many = [result.log] * 5 + [other]
    rows = log_tables(many)[1].rows
    assert rows[0][2] == "case1-unloaded.mcap and 4 more"
    assert len(rows) == len(channels.rows) + 1


def test_the_terminal_has_no_colour_without_a_colour_system(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[3" not in terminal(result, force_terminal=True)


@pytest.mark.parametrize("width", [80, 100, 106, 200])
def test_a_narrow_terminal_drops_columns_and_never_digits(result: Result, width: int) -> None:
    table = estimate_tables(result)[0]
    shown = from_terminal(terminal(result, width), "Parameters")
    for row, full in zip(shown, table.rows, strict=True):
        assert set(row) <= set(full)
        assert row[:2] == list(full[:2])
        assert full[6] in row  # the interval
    assert (len(shown[0]) == len(table.columns)) == (width == 200)


def test_where_nothing_can_be_dropped_cells_fold(result: Result) -> None:
    narrow = terminal(result, 40)
    k7 = result.parameters["k7"]
    parts = [line.split()[1] for line in narrow.splitlines() if line.startswith(("k7", " k7"))]
    assert resolved(k7.estimate, k7.std).startswith(parts[0])
    assert "…" not in narrow


def test_foreign_text_is_neither_markup_nor_escape_sequence(result: Result) -> None:
    text = terminal(hostile(result)) + markdown(result_document(hostile(result)))
    assert "\x1b" not in text
    assert "\u202e" not in text
    shown = markdown(result_document(hostile(result)))
    assert not re.search(r"(?<!\\)<(?!/?(details|summary)>)", shown)
    assert "\n```" not in shown
    assert "\\@everyone" in shown


def test_markdown_escapes_what_it_would_read() -> None:
    assert escaped("a|b_c*`<x>") == "a\\|b\\_c\\*\\`\\<x\\>"


def test_settings_table_keeps_a_table_whole() -> None:
    table = settings_table({"a\nb": "x|y"})
    assert isinstance(table, Table)
    assert table.rows == (("a\\x0ab", "x|y"),)


def test_settings_are_those_that_were_used_with_the_request_beside_them(result: Result) -> None:
    assert result.fit is not None
    chosen = TorqueModel(terms=["coulomb"], coulomb_speed=0.2, stribeck_speed=0.3, chosen_by="logs")
    delay = Estimate(estimate=-0.0038, std=1e-4, unit="s")
    other = result.model_copy(
        update={
            "estimator": "weak",
            "settings": {"estimator": "refined", "model": "auto", "delay": 0.0, "window": None},
            "parameters": {**result.parameters, "delay": delay},
            "fit": result.fit.model_copy(update={"model": chosen}),
        }
    )
    table = used_settings(other)
    assert [column.heading for column in table.columns] == ["Setting", "Used", "Asked for"]
    assert table.rows[:4] == (
        ("estimator", "weak", "refined"),
        ("model", "coulomb, delay (Coulomb friction over 0.20 rad/s)", "auto"),
        ("delay", "−3.8 ms", "0"),
        ("window", "–", "–"),
    )
    as_asked = used_settings(
        other.model_copy(update={"settings": {"estimator": "weak"}, "fit": None, "parameters": {}})
    )
    assert [column.heading for column in as_asked.columns] == ["Setting", "Used"]


def test_estimates_that_are_not_ok_stand_out(result: Result) -> None:
    weak = {"k1": estimate(1.0, 0.5, "kg m^2", Status.WEAK_EXCITATION)}
    assert "WEAK_EXCITATION" in terminal(result.model_copy(update={"parameters": weak}))


def test_a_truth_of_zero_has_no_error_in_percent(result: Result) -> None:
    bare = result.model_copy(update={"table4": [], "truth": {"k1": 0.0, "k2": 2.0}})
    parameters = estimate_tables(bare)[0]
    heads = [column.heading for column in parameters.columns]
    rows = {row[0]: dict(zip(heads, row, strict=True)) for row in parameters.rows}
    assert (rows["k1"]["Truth"], rows["k1"]["Error %"]) == ("0", "–")
    k2 = result.parameters["k2"].estimate
    assert k2 is not None
    assert float(rows["k2"]["Error %"]) == pytest.approx(100 * abs(k2 - 2.0) / 2.0, rel=1e-3)


def test_a_term_that_lowers_the_error_has_a_minus(result: Result) -> None:
    assert result.fit is not None
    terms = [
        TermCriterion(term="coulomb", kept=True, gain_heldout=0.5, evidence=40.0, why="kept"),
        TermCriterion(term="load", kept=False, gain_heldout=0.0, evidence=0.0, why="no meaning"),
        TermCriterion(term="offset", kept=False, delta_bic=3.25, why="left out"),
    ]
    (table,) = terms_tables(
        result.model_copy(update={"fit": result.fit.model_copy(update={"terms": terms})})
    )
    assert table.rows == (
        ("coulomb", "–", "-50.00", "+40.0", "yes", "kept"),
        ("load", "–", "+0.00", "+0.0", "no", "no meaning"),
        ("offset", "+3.2", "–", "–", "no", "left out"),
    )
    assert terms_tables(result.model_copy(update={"fit": None})) == ()


def test_terms_without_a_number_of_which_the_same_is_said_share_a_row(result: Result) -> None:
    assert result.fit is not None
    terms = [
        TermCriterion(term="coulomb", kept=True, why="shrunk"),
        TermCriterion(term="offset", kept=True, evidence=2.0, why="shrunk"),
        TermCriterion(term="load", kept=True, why="shrunk"),
        TermCriterion(term="gain", kept=False, why="shrunk"),
    ]
    (table,) = terms_tables(
        result.model_copy(update={"fit": result.fit.model_copy(update={"terms": terms})})
    )
    assert [row[0] for row in table.rows] == ["coulomb, load", "offset", "gain"]
