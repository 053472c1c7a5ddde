"""`algid example`: logs to try algid on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import say


def example(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write into.")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that are there.")] = False,
) -> None:
    """Write four runs of an arm, one with a payload, and their profile: what the guide's pages are typed along with.

    Example: algid example -o try
    """
    from algid.example import write_example

    for path in write_example(out, force):
        say(str(path))
