"""`report.html`: one file that opens offline, without a request to any host."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from algid.files import whole_file
from algid.progress import Told
from algid.report.arm import arm_script
from algid.report.bars import bars
from algid.report.forest import forest
from algid.report.frame import LIBRARY, bullets, figures_html, framed, links_of, section
from algid.report.gallery import gallery
from algid.report.html import Drawn, table_html
from algid.report.library import library
from algid.report.posture import arm_of
from algid.report.table import Table
from algid.report.tables import (
    estimate_tables,
    fit_tables,
    log_tables,
    provenance_table,
    quality_tables,
    settings_table,
    terms_tables,
)
from algid.report.text import file_name, significant
from algid.report.verdict import verdict
from algid.results import Result, read_result
from algid.words import counted

FIRST = ("Parameters", "Payload")
SECOND = ("Torque prediction",)
TOLD_ELSEWHERE = ("± std, %", "Paper %")  # by the forest plot, and by Table 4
PAPER = ("paper", "The paper's tables and convergence")
TERMS = ("terms", "What the model lacks")


def write_report(folder: Path, shared_library: bool = False, told: Told | None = None) -> Path:
    """Write `report.html` into the result folder `folder`, from what it holds.

    Parameters
    ----------
    folder : Path
        Holds `result.json` and, as far as they are known, `estimates.parquet`, `loaded.parquet`,
        `torque.parquet` and `information.parquet`; the page says what is absent.
    shared_library : bool
        Whether the plotting library stands once beside the folder, for a folder of many results, instead
        of inside the page.
    told : callable
        Called as samples of the torque are read.

    Raises
    ------
    ResultError
        If `result.json` is missing or not a result of this version.
    OutputError
        If the page cannot be written.
    """
    result = read_result(folder)
    page = folder / "report.html"
    if shared_library:
        _write_once(folder.parent / LIBRARY, library().script)
    text = page_html(folder, result, shared_library, told)
    with whole_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return page


def _write_once(path: Path, text: str) -> None:
    content = text.encode()
    if not path.is_file() or path.stat().st_size != len(content):
        with whole_file(path) as temporary:
            temporary.write_bytes(content)


def page_html(folder: Path, result: Result, shared_library: bool = False, told: Told | None = None) -> str:
    """The page's text; with `shared_library` it asks for the library beside the folder."""
    shown = gallery(folder, result, told)
    tables = {table.title: table for table in estimate_tables(result)}
    first = _first_screen(result, tables)
    arm = arm_of(result, shown.torque)
    terms = _terms(result)
    quality = [*quality_tables(shown.torque, result), *log_tables(result)]
    notes = bullets(result.notes, "What the readers and the estimator warn of stands at the top of the page.")
    body = [
        '<div class="first"><div>',
        *first,
        f"</div>{arm}</div>",
        *figures_html(shown.figures[:1]),
        *terms,
        *figures_html(shown.figures[1:]),
        *section("fit", "What the estimator knows of the logs", fit_tables(result)),
        *section("data", "Data quality", quality, notes),
        *section("settings", "Settings and provenance", [settings_table(result.settings), provenance_table(result)]),
        _paper(result, [*map(table_html, tables.values()), *figures_html(shown.paper)]),
    ]
    links = [
        *links_of(shown.figures[:1]),
        *([TERMS] if terms else []),
        *links_of(shown.figures[1:]),
        ("data", "Data quality"),
        ("settings", "Settings and provenance"),
        PAPER,
    ]
    more = "" if not result.more_logs else f" and {len(result.more_logs)} more"
    return framed(
        "identification of a two-link arm",
        f"{file_name(result.log.path)}{more}",
        _facts(result),
        verdict(result),
        links,
        body,
        [*shown.figures, *shown.paper],
        f"Made by algid {result.version} from result.json.",
        tab=file_name(result.log.path),
        shared_library=shared_library,
        scripts=[arm_script()] if arm else [],
    )


def _first_screen(result: Result, tables: dict[str, Table]) -> list[str]:
    """The estimates with their forest plot, and how they predict; what is shown is taken out of `tables`."""
    logs = _own(result)
    drawn = forest({**result.parameters, **result.payload}, _truth(result), logs)
    column = [Drawn(drawn.heading, drawn.rows, after="Unit")] if drawn.rows else []
    first = [tables.pop(title).without(TOLD_ELSEWHERE) for title in FIRST if title in tables]
    if first and drawn.rows:
        marks = [f"Drawn: the 95 % interval on a scale of ± {significant(drawn.limit, 1)} % of the estimate"]
        marks += ["grey dots: each unloaded log's own estimate"] if logs else []
        marks += ["ring: the truth"] if _truth(result) else []
        first[-1] = replace(first[-1], note="; ".join([*([first[-1].note] if first[-1].note else []), *marks]) + ".")
    shown = [table_html(table, column) for table in first]
    return [*shown, *(table_html(tables.pop(title)) for title in SECOND if title in tables)]


def _own(result: Result) -> dict[str, list[float]]:
    """Each unloaded log's own estimates by name, of several logs; a loaded one's hold its payload's share."""
    found = [] if result.fit is None else result.fit.by_log
    if len(found) != len(result.logs):  # a log too short to be fitted has none, and which it is nobody tells
        return {}
    own = [one for one, log in zip(found, result.logs, strict=True) if log.role == "unloaded"]
    values = {
        name: [one[name].estimate for one in own if name in one and one[name].estimate is not None]
        for name in result.parameters
    }
    return {name: kept for name, kept in values.items() if len(kept) > 1}  # type: ignore[misc]


def _terms(result: Result) -> list[str]:
    """The terms that were tried, each with what it gains drawn; nothing where none was."""
    key, title = TERMS
    reading = (
        '<p class="reading">Read: a bar to the left lowers the error of torque that was held out; a term is kept where '
        "it does so and its odds are good. What is left out would gain no more than stands here.</p>"
    )
    tables = terms_tables(result)
    if not tables:
        return []
    gains = (
        {}
        if result.fit is None
        else {term.term: -100 * term.gain_heldout for term in result.fit.terms if term.gain_heldout is not None}
    )
    column = [Drawn("error held out", bars(gains), after="Held-out error, %")] if gains else []
    return [
        f'<section aria-labelledby="{key}"><h2 id="{key}">{title}</h2>',
        *(table_html(table, column) for table in tables),
        reading if gains else "",
        "</section>",
    ]


def _facts(result: Result) -> str:
    seconds = significant(sum(log.duration for log in result.logs), 4)
    samples, rate = sum(log.rows for log in result.logs), significant(result.log.rate, 4)
    return f"{result.estimator} estimator · {seconds} s of log at {rate} Hz · {counted(samples, 'sample')}"


def _truth(result: Result) -> dict[str, float]:
    """What a synthetic log was made with, by parameter."""
    rows = {row.parameter: row.truth for row in result.table4 if row.truth is not None}
    return {**rows, **result.truth}


def _paper(result: Result, content: Sequence[str]) -> str:
    """The paper's tables and convergence: open where the paper is the matter, folded where a real log is."""
    if not content:
        return ""
    key, title = PAPER
    opened = " open" if result.estimator == "paper" or _truth(result) else ""
    return f'<details class="paper" id="{key}"{opened}><summary>{title}</summary>\n{"".join(content)}</details>'
