"""A result as Markdown, for pull requests and CI summaries."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from algid.files import whole_file
from algid.report.table import Table
from algid.report.tables import estimate_tables, fit_tables, log_tables, provenance_table
from algid.report.text import file_name
from algid.report.verdict import LEVEL_WORDS, Level, Verdict, verdict
from algid.results import Result, read_result

LEVEL_SIGNS: dict[Level, str] = {"good": "✅", "reservations": "⚠️", "failed": "❌"}
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~@&])")


def markdown(result: Result) -> str:
    """Verdict, estimates, fit, logs and provenance of `result` as GitHub's Markdown."""
    return document(
        f"Identification of {file_name(result.log.path)}",
        verdict(result),
        [*estimate_tables(result), *fit_tables(result)],
        "Logs and provenance",
        [log_tables(result)[0], provenance_table(result)],
    )


def document(title: str, judged: Verdict, tables: Sequence[Table], summary: str, details: Sequence[Table]) -> str:
    """A title, a verdict and tables, and `details` folded away below their `summary`."""
    word = LEVEL_WORDS[judged.level]
    lines = [
        f"### {escaped(title)}",
        "",
        f"{LEVEL_SIGNS[judged.level]} **{word}**{escaped(judged.sentence.removeprefix(word))}",
        "",
        *([f"Likely cause: {escaped(judged.cause)}", ""] if judged.cause else []),
        *(["Run first:", "", *_code(judged.command), ""] if judged.command else []),
        *(f"- {escaped(reason)}" for reason in judged.reasons),
    ]
    folded = [f"<details><summary>{summary}</summary>", "", *map(markdown_table, details), "</details>"]
    return "\n".join([*lines, "", *map(markdown_table, tables), *folded]) + "\n"


def write_markdown(folder: Path) -> Path:
    """Write `report.md` into the result folder `folder`. Raises `ResultError`, `OutputError`."""
    page = folder / "report.md"
    text = markdown(read_result(folder))
    with whole_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return page


def markdown_table(table: Table) -> str:
    """One table with its title and note."""
    rule = ["--:" if column.kind == "number" else ":--" for column in table.columns]
    rows = [[column.heading for column in table.columns], *table.rows]
    body = [_line([escaped(cell) for cell in row]) for row in rows]
    note = ["", escaped(table.note)] if table.note else []
    return "\n".join([f"**{escaped(table.title)}**", "", body[0], _line(rule), *body[1:], *note, ""])


def escaped(text: str) -> str:
    """`text` so that Markdown shows it as it is: no markup, no HTML, no mention of anybody."""
    return _SPECIAL.sub(r"\\\1", text)


def _code(text: str) -> list[str]:
    """A block of code that no row of backticks in `text` can end."""
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return [f"{fence}sh", text, fence]


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"
