"""A terminal of 80 columns, and what a report shows on it."""

from __future__ import annotations

import io

from algid.cli.output import console
from algid.report.document import Document
from algid.report.terminal import print_document

WIDTH = 80


def shown(document: Document) -> list[str]:
    """The lines, once none is wider than the terminal and none ends in a cut word."""
    text = io.StringIO()
    print_document(document, console(file=text, width=WIDTH))
    lines = text.getvalue().splitlines()
    assert max(map(len, lines)) <= WIDTH, lines
    assert "…" not in text.getvalue(), lines
    return lines
