"""`report.html`: one file that opens offline, without a request to any host.

Nothing but this package's own script runs: the page's Content-Security-Policy names the scripts by their
hashes, or by a nonce for the library beside the page, so that a name out of a log could not run even if it
slipped past the escaping.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from algid.files import whole_file
from algid.progress import Told
from algid.report.arm import arm_script
from algid.report.figures.base import Figure, Missing
from algid.report.forest import forest
from algid.report.gallery import gallery
from algid.report.html import TEMPLATE, escaped, figure_html, panel_id, script_json, table_html
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
)
from algid.report.text import file_name, significant
from algid.report.verdict import LEVEL_WORDS, Verdict, verdict
from algid.results import Result, read_result

LIBRARY = "plotly.min.js"
FIRST = ("Parameters", "Payload")
SECOND = ("Torque prediction",)
PAPER = ("paper", "The paper's tables and convergence")
SIGNS = {"good": "✓", "reservations": "!", "failed": "✕"}


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
    first = [tables.pop(title) for title in FIRST if title in tables]
    arm = arm_of(result, shown.torque)
    drawn = forest({**result.parameters, **result.payload}, _truth(result))
    quality = [*quality_tables(shown.torque, result), *log_tables(result)]
    body = [
        _head(result, verdict(result)),
        contents(shown.figures, PAPER),
        '<main id="numbers">',
        '<div class="first"><div>',
        *(table_html(table, drawn.rows, drawn.heading) for table in first),
        *(table_html(tables.pop(title)) for title in SECOND if title in tables),
        f"</div>{arm}</div>",
        *map(figure_html, shown.figures),
        *section("fit", "What the estimator knows of the logs", fit_tables(result)),
        *section("data", "Data quality", quality, _warnings(result)),
        *section("settings", "Settings and provenance", [settings_table(result.settings), provenance_table(result)]),
        _paper(result, [*map(table_html, tables.values()), *map(figure_html, shown.paper)]),
        "</main>",
        f"<footer>Made by algid {escaped(result.version)} from {escaped(str(folder.name))}/result.json.</footer>",
        '<noscript><p class="missing">The figures need JavaScript; all numbers stand without it.</p></noscript>',
    ]
    return document(
        file_name(result.log.path),
        "\n".join(body),
        script_json(drawing([*shown.figures, *shown.paper])),
        shared_library,
        [arm_script()] if arm else [],
    )


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


def document(title: str, body: str, data: str, shared_library: bool = False, scripts: Sequence[str] = ()) -> str:
    """A whole page out of its body and its figures' data.

    It carries the plotting library, packed; with `shared_library` it asks for the one beside the folder. `scripts` run
    after the page's own.
    """
    running, style = [_asset("report.js"), *scripts], _asset("report.css")
    if shared_library:
        nonce = hashlib.sha256((body + data).encode()).hexdigest()  # nobody who writes the body can foretell it
        source, tag = f"'nonce-{nonce}'", f'<script nonce="{nonce}" src="../{LIBRARY}"></script>'
    else:
        own = library()
        source, tag = _hash(own.script), f'<script type="text/plain" id="library">{own.packed}</script>'
    elements = "\n".join(f"<script>{script}</script>" for script in running)
    policy = (
        f"default-src 'none'; script-src {' '.join([source, *map(_hash, running)])}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        f"<title>{escaped(title)} · algid</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f'<a class="skip" href="#numbers">Skip to the numbers</a>\n{body}\n'
        f'<script type="application/json" id="figures">{data}</script>\n{tag}\n{elements}\n'
        "</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return (resources.files("algid.report") / "assets" / name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def drawing(figures: Sequence[Figure | Missing]) -> dict[str, object]:
    """What the page's script draws."""
    panels = [
        {
            "id": panel_id(figure, place),
            "figure": figure.key,
            "columns": "two" if figure.columns == 2 else "one",
            "sync": panel.sync,
            "height": panel.height,
            "traces": panel.traces,
            "layout": panel.layout,
        }
        for figure in figures
        if isinstance(figure, Figure)
        for place, panel in enumerate(figure.panels)
    ]
    return {"template": TEMPLATE, "panels": panels}


def _head(result: Result, judged: Verdict) -> str:
    more = "" if not result.more_logs else f" and {len(result.more_logs)} more"
    seconds = significant(sum(log.duration for log in result.logs), 4)
    samples, rate = sum(log.rows for log in result.logs), significant(result.log.rate, 4)
    facts = f"{result.estimator} estimator · {seconds} s of log at {rate} Hz · {samples:,} samples"
    return (
        f'<header><p class="kicker">algid · identification of a two-link arm</p>'
        f"<h1>{escaped(file_name(result.log.path))}{more}</h1>\n"
        f'<p class="facts">{escaped(facts)}</p>\n{banner(judged)}</header>'
    )


def banner(judged: Verdict) -> str:
    """The verdict's sentence and its reasons, in its colour."""
    word = LEVEL_WORDS[judged.level]
    told = judged.level == "reservations" and len(judged.reasons) == 1
    reasons = "" if told else "".join(f"<li>{escaped(reason)}</li>" for reason in judged.reasons)
    return (
        f'<div class="verdict {judged.level}"><span class="sign" aria-hidden="true">{SIGNS[judged.level]}</span>'
        f"<div><p><strong>{word}</strong>{escaped(judged.sentence.removeprefix(word))}</p>"
        f"{_first(judged)}{reasons and f'<ul>{reasons}</ul>'}</div></div>"
    )


def _first(judged: Verdict) -> str:
    """The likely cause and the command to run first."""
    cause = f'<p class="cause">Likely cause: {escaped(judged.cause)}</p>' if judged.cause else ""
    return cause + (f'<p class="cause">Run first: <code>{escaped(judged.command)}</code></p>' if judged.command else "")


def contents(figures: Sequence[Figure | Missing], *more: tuple[str, str]) -> str:
    """Links to the page's parts: figures, data, settings and `more`, each its key and title."""
    targets = [("numbers", "Numbers"), *((figure.key, figure.title) for figure in figures)]
    targets += [("data", "Data quality"), ("settings", "Settings and provenance"), *more]
    links = "".join(f'<li><a href="#{key}">{escaped(title)}</a></li>' for key, title in targets)
    return f'<nav aria-label="Contents"><details open><summary>Contents</summary><ul>{links}</ul></details></nav>'


def section(key: str, title: str, tables: Sequence[Table], extra: str = "") -> list[str]:
    """A titled part of the page; nothing where it would be empty."""
    if not tables and not extra:
        return []
    return [
        f'<section aria-labelledby="{key}"><h2 id="{key}">{escaped(title)}</h2>',
        extra,
        *map(table_html, tables),
        "</section>",
    ]


def _warnings(result: Result) -> str:
    if not result.warnings:
        return '<p class="note">The readers and the estimator gave no warning.</p>'
    return f"<ul>{''.join(f'<li>{escaped(warning)}</li>' for warning in result.warnings)}</ul>"
