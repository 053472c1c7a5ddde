"""The whole application, as `algid --help` shows it, and its commands called in this process."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from algid.api.options import meant, set_by
from algid.cli.app import app, run
from algid.profile import Profile

__all__ = ["app", "call", "profile_from"]


@dataclass(frozen=True)
class Done:
    """What a command returned and printed."""

    code: int
    out: str
    err: str


def call(*arguments: str | Path) -> Done:
    """Run a command in this process."""
    words = list(map(str, arguments))
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), patch.dict(os.environ, COLUMNS="200"):
        code = run(words)
    return Done(int(code), out.getvalue(), err.getvalue())


def profile_from(flags: Mapping[str, Any]) -> Profile | None:
    """The profile that flags mean, as a command hands them to its verb."""
    options = {name: value for name, value in flags.items() if name != "set"}
    return meant(None, options | set_by(flags.get("set", ()), Profile.model_fields))
