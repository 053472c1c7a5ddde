"""A document as Markdown, for pull requests and CI summaries."""

from __future__ import annotations

import re

from algid.report.document import Depth, Document, Table
from algid.text import visible
from algid.verdict import Grade

GRADE_SIGNS: dict[Grade, str] = {"good": "✅", "reservations": "⚠️", "failed": "❌"}
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~@&])")


def markdown(document: Document) -> str:
    """`document` as GitHub's Markdown: title, verdict, tables, and folded reading and method."""
    judged = document.verdict
    lines = [
        f"### {escaped(document.title)}",
        "",
        f"{GRADE_SIGNS[judged.grade]} **{judged.word}**: {escaped(visible(judged.headline))}.",
        "",
        *(f"- {escaped(visible(reason.sentence))}" for reason in judged.reasons),
        "",
        *(["Run first:", "", *_code(judged.command), ""] if judged.command else []),
        *map(markdown_table, document.tables(Depth.TERMINAL, Depth.MARKDOWN)),
    ]
    folded = document.tables(Depth.FOLDED)
    if folded:
        lines += [
            "<details><summary>Logs and provenance</summary>",
            "",
            *map(markdown_table, folded),
            "</details>",
        ]
    return "\n".join(lines) + "\n"


def markdown_table(table: Table) -> str:
    """One table with its title and note."""
    cells = [
        [escaped(cell) for cell in row]
        for row in ([column.heading for column in table.columns], *table.rows)
    ]
    cells.insert(1, ["--:" if column.kind == "number" else ":--" for column in table.columns])
    note = ["", escaped(table.note)] if table.note else []
    return "\n".join(
        [f"**{escaped(table.title)}**", "", *(f"| {' | '.join(row)} |" for row in cells), *note, ""]
    )


def escaped(text: str) -> str:
    """`text` so that Markdown shows it as it is: no markup, no HTML, no mention of anybody."""
    return _SPECIAL.sub(r"\\\1", text)


def _code(text: str) -> list[str]:
    """A block of code that no row of backticks in `text` can end."""
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", text)), default=0))
    return [f"{fence}sh", text, fence]
