"""Options that mean the same in several commands, and how results are printed."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from algid.cli.output import console, say

if TYPE_CHECKING:
    from algid.report.document import Document, Table

OUTPUT = "Output"
"""The panel of a command's help that holds them."""

Force = Annotated[
    bool, typer.Option("--force", help="Replace what is there.", rich_help_panel=OUTPUT)
]
Quiet = Annotated[
    bool, typer.Option("-q", "--quiet", help="Print nothing but errors.", rich_help_panel=OUTPUT)
]


def out(text: str) -> Any:
    """The option ``-o``: where a command writes."""
    return typer.Option("-o", "--out", help=text, rich_help_panel=OUTPUT)


class ResultFormat(StrEnum):
    """How a result is printed."""

    TABLE = "table"
    MARKDOWN = "markdown"
    JSON = "json"


Form = Annotated[
    ResultFormat, typer.Option("--format", help="What to print.", rich_help_panel=OUTPUT)
]


class Export(StrEnum):
    """Logs for other viewers."""

    MCAP = "mcap"


def command_line() -> str:
    """The call as it was typed."""
    return shlex.join(["algid", *sys.argv[1:]])


def print_report(document: Document, json: Callable[[], str], form: ResultFormat) -> None:
    """Print `document`, or the text of `json`, alone to stdout, so that it can be piped."""
    from algid.report.render import markdown
    from algid.report.terminal import print_document

    if form is ResultFormat.TABLE:
        print_document(document, console())
    else:
        say(json() if form is ResultFormat.JSON else markdown(document), end="")


def print_tables(tables: Iterable[Table], json: Callable[[], str], form: ResultFormat) -> None:
    """Print `tables`, or what `json` gives, to stdout."""
    from algid.report.render import markdown_table
    from algid.report.terminal import print_table

    if form is ResultFormat.JSON:
        say(json(), end="")
    elif form is ResultFormat.MARKDOWN:
        say("\n".join(map(markdown_table, tables)), end="")
    else:
        terminal = console()
        for table in tables:
            print_table(table, terminal)
            terminal.print()
