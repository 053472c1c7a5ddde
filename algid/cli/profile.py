"""`algid profile new`: a profile for a log, to edit."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from algid.cli.common import Force, Quiet, out
from algid.cli.output import remark, say

NAME = "algid.toml"


def new(
    log: Annotated[Path, typer.Argument(help="The log to write a profile for.")],
    out: Annotated[Path, out("File or folder to write it to.")] = Path(NAME),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a profile with everything that can be set, filled in with what a log tells.

    Example: algid profile new arm.mcap -o algid.toml
    """
    from algid.api.write import profile_for

    file = out / NAME if out.is_dir() else out
    profile_for(log, file, force)
    if not quiet:
        remark(f"wrote {file}; edit it, then try:")
        say(f"algid inspect {quote(str(log))} --profile {quote(str(file))}")
