"""What commands print: the one place that makes text printable, whoever wrote it.

A name in a log, a status in a result that was tampered with, a path: any may hold what drives a
terminal.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from algid.api.answer import Manual
from algid.base import text as letters
from algid.base.errors import without_credentials

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    from algid.api.answer import Answer
    from algid.report.document import Document, Table


def printable(text: str) -> str:
    """Text as a terminal may have it: what would drive it is escaped, credentials are left out."""
    return letters.printable(without_credentials(text))


def say(text: str) -> None:
    """Print to standard output, which carries results."""
    print(printable(text))


def remark(text: str) -> None:
    """Print to standard error, which carries all that is no result."""
    print(printable(text), file=sys.stderr)


def complain(text: str) -> None:
    """Print one line of error to standard error; line feeds in foreign names are escaped."""
    remark("algid: " + text.replace("\n", "\\n"))


def clear_line() -> None:
    """Give the terminal back a blank line and its cursor, after a process that was showing one."""
    if sys.stderr.isatty():
        print("\r\x1b[2K\x1b[?25h", end="", file=sys.stderr, flush=True)


def console(**options: Any) -> Console:
    """A terminal whose text is printable; `options` are those of rich."""
    from rich.console import Console
    from rich.segment import Segment

    class Printable(Console):
        """Shows what a segment would do to the terminal, but for what rich itself has it do."""

        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterable[Segment]:
            """The segments of `renderable`, their text printable."""
            for segment in super().render(renderable, options):
                yield (
                    segment if segment.control else Segment(printable(segment.text), segment.style)
                )

    return Printable(**options)


def shown(answer: Answer, json: bool, quiet: bool) -> None:
    """Print what a verb gave: results alone to standard output, so that they can be piped."""
    for line in answer.complaints:
        complain(line)
    if quiet:
        return
    if json and answer.json is not None:
        say(answer.json().rstrip())
    else:
        for part in answer.shown:
            _print(part)
    for line in answer.remarks:
        remark(line)


def _print(part: Document | Table | str) -> None:
    if isinstance(part, Manual):
        if not sys.stdout.isatty():
            print(part, end="")  # its examples of credentials are none
            return
        from rich.markdown import Markdown

        console(width=min(console().width, 120)).print(Markdown(part))
    elif isinstance(part, str):
        say(part)
    else:
        from algid.report.document import Table
        from algid.report.terminal import print_document, print_table

        terminal = console()
        if isinstance(part, Table):
            print_table(part, terminal)
            terminal.print()
        else:
            print_document(part, terminal)
