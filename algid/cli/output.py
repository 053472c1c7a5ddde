"""What commands print, and to where: the one place that makes lines printable, whoever wrote them.

A name in a log, a status in a result that was tampered with, a path: any may hold what drives a
terminal. No pipe's reader and no terminal's alphabet can break standard output and error.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from algid.api import Manual
from algid.base.progress import Progress
from algid.base.text import printable

if TYPE_CHECKING:
    from algid.api import Answer


CLEAR = "\r\x1b[2K"
"""Has a terminal begin its line anew."""


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
    """Give the terminal back a blank line, after a process that was showing one."""
    if sys.stderr.isatty():
        print(CLEAR, end="", file=sys.stderr, flush=True)


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
        if isinstance(part, Manual):
            if not sys.stdout.isatty():
                print(part, end="")  # its examples of credentials are none
                continue
            from rich.console import Console
            from rich.markdown import Markdown

            Console(width=min(Console().width, 120)).print(Markdown(part))
        elif isinstance(part, str):
            say(part)
        else:
            from rich.console import Console

            from algid.report.document import Table
            from algid.report.terminal import print_document, print_table

            terminal = Console()
            if isinstance(part, Table):
                print_table(part, terminal)
                terminal.print()
            else:
                print_document(part, terminal)
    for line in answer.remarks:
        remark(line)


@contextmanager
def progress(quiet: bool) -> Iterator[Progress | None]:
    """Show a line on standard error while the block runs, if that is a terminal.

    Give what the block is to tell its progress to, None where nobody looks. The line is gone once
    the block has ended.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return

    def shown(stage: str, done: int, total: int) -> None:
        counts = f"{done:,}" * (done > 0)
        if total >= max(done, 1):
            counts = f"{done:,} of {total:,} ({done / total:.0%})"
        line = f"{printable(stage)}  {counts}"[: shutil.get_terminal_size().columns - 1]
        print(f"{CLEAR}{line}", end="", file=sys.stderr, flush=True)

    try:
        yield shown
    finally:
        clear_line()


class _Pipe(io.FileIO):
    """A descriptor whose reader may leave, like ``head``: what is written after that goes nowhere.

    That a disk is full is raised, once, of standard output: about standard error nobody can be
    told.
    """

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if self.fileno() == 1 and not isinstance(error, BrokenPipeError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                error.filename = "standard output"
                raise
            return memoryview(data).nbytes


def harden_streams() -> None:
    """Let this process print to a reader that leaves, and to a terminal that lacks characters."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        # the number of a closed one is taken: else the next file to be opened would have it
        handle = stream.fileno() if stream else os.open(os.devnull, os.O_WRONLY)
        if name == "stderr":  # libraries write to the descriptor itself: see `algid.guard.begin`
            handle = os.dup(handle)
        raw = io.BufferedWriter(_Pipe(handle, "wb", closefd=False))
        text = io.TextIOWrapper(
            raw, getattr(stream, "encoding", "utf-8"), "backslashreplace", line_buffering=True
        )
        setattr(sys, name, text)
