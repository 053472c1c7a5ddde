"""What commands print, and to where: the one place that makes text printable, whoever wrote it.

A name in a log, a status in a result that was tampered with, a path: any may hold what drives a
terminal. No pipe's reader and no terminal's alphabet can break standard output and error.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from algid.api import Manual
from algid.base import text as letters
from algid.base.errors import OutputError, without_credentials
from algid.base.progress import Progress

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    from algid.api import Answer


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
    parts = answer.shown
    if json and answer.json is not None:
        parts = [answer.json().rstrip()]
    for part in parts:
        if isinstance(part, Manual) and sys.stdout.isatty():
            from rich.markdown import Markdown

            console(width=min(console().width, 120)).print(Markdown(part))
        elif isinstance(part, Manual):
            print(part, end="")  # its examples of credentials are none
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
    for line in answer.remarks:
        remark(line)


@contextmanager
def progress(unit: str, quiet: bool = False) -> Iterator[Progress | None]:
    """Show a bar on standard error while the block runs, if that is a terminal.

    Give what the block is to tell its progress to, None where nobody looks. What is done of each
    stage is counted in `unit`. The bar is gone once the block has ended.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich import progress as bars

    parts = (
        bars.TextColumn("{task.description}", markup=False),
        bars.BarColumn(None),  # as wide as there is room
        bars.TextColumn("{task.fields[counts]}", markup=False),
        bars.TimeRemainingColumn(),
    )
    screen = console(stderr=True)
    with bars.Progress(*parts, console=screen, transient=True, redirect_stdout=False) as bar:

        def shown(stage: str, done: int, total: int) -> None:
            known = total if total >= max(done, 1) else None
            counts = f"{done:,} of {known:,} {unit}" if known else f"{done:,} {unit}" * (done > 0)
            if [(task.description, task.total) for task in bar.tasks] != [(stage, known)]:
                for before in bar.task_ids:
                    bar.remove_task(before)
                bar.add_task(stage, total=known, counts=counts)
            bar.update(bar.task_ids[0], completed=done, counts=counts)

        yield shown


class _Pipe(io.FileIO):
    """A descriptor whose reader may leave, like ``head``, or whose disk may be full.

    What is written after that goes nowhere. That a disk is full is raised, once, where there is a
    `name` to tell it by: about standard error nobody can be told.
    """

    def __init__(self, handle: int, told_as: str | None) -> None:
        super().__init__(handle, "wb", closefd=False)
        self._told_as = told_as

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            _to_nowhere(self.fileno())
            if self._told_as is not None and not isinstance(error, BrokenPipeError):
                reason = f"cannot write ({error.strerror}); send it elsewhere, or make room"
                raise OutputError(f"{self._told_as}: {reason}") from error
            return memoryview(data).nbytes


def _to_nowhere(handle: int) -> None:
    """Have what is written to a descriptor go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != handle:  # a closed one is the first that the system gives
        os.dup2(nowhere, handle)
        os.close(nowhere)


def harden_streams() -> None:
    """Let this process print to a reader that leaves, and to a terminal that lacks characters."""
    for handle, name, told_as in ((1, "stdout", "standard output"), (2, "stderr", None)):
        stream = getattr(sys, name)
        if stream is None:  # closed: else the next file to be opened would be taken for it
            _to_nowhere(handle)
            stream = open(handle, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        try:
            handle = stream.fileno()
        except (AttributeError, OSError, ValueError):  # not of this process
            continue
        stream.flush()
        if name == "stderr":  # libraries write to the descriptor itself: see `algid.guard.begin`
            handle = os.dup(handle)
        raw, lines = io.BufferedWriter(_Pipe(handle, told_as)), name == "stderr" or stream.isatty()
        text = io.TextIOWrapper(raw, stream.encoding, "backslashreplace", line_buffering=lines)
        setattr(sys, name, text)
