"""A result as Markdown, for pull requests and CI summaries."""

from __future__ import annotations

import re
from pathlib import Path

from algid.files import whole_file
from algid.report.document import Document, result_document
from algid.report.table import Table
from algid.report.verdict import LEVEL_WORDS, Level
from algid.results import Result, read_result

LEVEL_SIGNS: dict[Level, str] = {"good": "✅", "reservations": "⚠️", "failed": "❌"}
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~@&])")


def markdown(result: Result) -> str:
    """Verdict, estimates, fit, logs and provenance of `result` as GitHub's Markdown."""
    return document_markdown(result_document(result))


def document_markdown(document: Document) -> str:
    """A report as GitHub's Markdown: title, verdict and tables, and its details folded away."""
    judged = document.verdict
    word = LEVEL_WORDS[judged.level]
    lines = [
        f"### {escaped(document.title)}",
        "",
        f"{LEVEL_SIGNS[judged.level]} **{word}**{escaped(judged.sentence.removeprefix(word))}",
        "",
        *([f"Likely cause: {escaped(judged.cause)}", ""] if judged.cause else []),
        *(["Run first:", "", *_code(judged.command), ""] if judged.command else []),
        *(f"- {escaped(reason)}" for reason in judged.untold),
    ]
    folded = [
        f"<details><summary>{document.summary}</summary>",
        "",
        *map(markdown_table, document.details),
        "</details>",
    ]
    tables = map(markdown_table, (*document.tables, *document.more))
    return "\n".join([*lines, "", *tables, *(folded if document.details else [])]) + "\n"


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
