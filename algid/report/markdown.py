"""A document as Markdown, for pull requests and CI summaries."""

from __future__ import annotations

import re
from collections.abc import Sequence

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
    ]
    for reason in judged.reasons:
        lines.append(f"- {escaped(visible(reason.sentence))}")
    lines.append("")
    if judged.command:
        lines += ["Run first:", ""] + _code(judged.command) + [""]
    lines += map(markdown_table, document.tables(Depth.TERMINAL, Depth.MARKDOWN))
    folded = document.tables(Depth.FOLDED)
    if folded:
        lines += ["<details><summary>Logs and provenance</summary>", ""]
        lines += map(markdown_table, folded)
        lines.append("</details>")
    return "\n".join(lines) + "\n"


def markdown_table(table: Table) -> str:
    """One table with its title and note."""
    headings, alignments = [], []
    for column in table.columns:
        headings.append(column.heading)
        alignments.append("--:" if column.kind == "number" else ":--")
    lines = [f"**{escaped(table.title)}**", "", _row(headings), f"| {' | '.join(alignments)} |"]
    lines += map(_row, table.rows)
    if table.note:
        lines += ["", escaped(table.note)]
    lines.append("")
    return "\n".join(lines)


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(map(escaped, cells))} |"


def escaped(text: str) -> str:
    """`text` so that Markdown shows it as it is: no markup, no HTML, no mention of anybody."""
    return _SPECIAL.sub(r"\\\1", text)


def _code(text: str) -> list[str]:
    """A block of code that no row of backticks in `text` can end."""
    longest = max(map(len, re.findall("`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return [f"{fence}sh", text, fence]
