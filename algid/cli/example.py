"""`algid example`: logs to try algid on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from algid.cli.common import Force, Quiet, out
from algid.cli.output import say


def example(
    out: Annotated[Path, out("Folder to write into.")] = Path(),
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write four runs of an arm, one with a payload, and their profile, for the guide's examples.

    Example: algid example -o try
    """
    from algid.api.write import example as run

    for path in run(out, force):
        if not quiet:
            say(str(path))
