"""The whole application, as `algid --help` shows it, and its commands called in this process."""

from __future__ import annotations

import io
import os
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from typer.main import get_command

from algid.cli.app import COMMANDS, called, gathered
from algid.errors import AlgidError
from algid.exits import Exit

app = gathered(COMMANDS)
_COMMANDS = get_command(app).commands  # type: ignore[attr-defined]
NAMES = [name for name, one in _COMMANDS.items() if not hasattr(one, "commands")]
"""What the application calls its commands, without the group of those about profiles."""


@dataclass(frozen=True)
class Done:
    """What a command returned and printed."""

    code: int
    out: str
    err: str

    @property
    def boxed(self) -> str:
        """What stands in typer's box about a wrong call, as one line."""
        return " ".join(
            line.strip("│").strip() for line in self.err.splitlines() if line.startswith("│")
        )


def call(*arguments: str | Path) -> Done:
    """Run a command in this process; an error of algid's is told as the command line tells it."""
    words = list(map(str, arguments))
    out, err, code = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(out), redirect_stderr(err), patch.dict(os.environ, COLUMNS="200"):
        try:
            _command(words[0])(words)
        except AlgidError as error:
            print(f"algid: {error}", file=err)
            code = Exit.USAGE
        except SystemExit as end:
            code = int(end.code or 0)
    return Done(code, out.getvalue(), err.getvalue())


@cache
def _command(first: str) -> Any:
    """What reads a call that begins so: typer takes long to make it."""
    return get_command(called([first]))
