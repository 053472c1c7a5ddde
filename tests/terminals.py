"""A terminal of 80 columns, what a report shows on it, and what a command does."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import struct
import termios
from typing import Any

from rich.console import Console

from algid.report.document import Document
from algid.report.terminal import print_document
from tests.processes import begin

WIDTH = 80


def shown(document: Document) -> list[str]:
    """The lines, once none is wider than the terminal and none ends in a cut word."""
    text = io.StringIO()
    print_document(document, Console(file=text, width=WIDTH))
    lines = text.getvalue().splitlines()
    assert max(map(len, lines)) <= WIDTH, lines
    assert "…" not in text.getvalue(), lines
    return lines


def on_a_terminal(*arguments: object, stdout: int | None = None, **options: Any) -> tuple[int, str]:
    """Exit code of a command, and what a terminal gets that is its stderr, and its stdout too."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, WIDTH, 0, 0))
    hidden = ("COLUMNS", "LINES", "NO_COLOR")
    env = {name: value for name, value in os.environ.items() if name not in hidden}
    printed = theirs if stdout is None else stdout
    wait = begin(*arguments, stdout=printed, stderr=theirs, env=env | {"TERM": "xterm"}, **options)
    os.close(theirs)
    seen = b""
    try:
        while part := os.read(ours, 1 << 16):
            seen += part
    except OSError:  # Linux: the other end is closed
        pass
    os.close(ours)
    return wait(), seen.decode()
