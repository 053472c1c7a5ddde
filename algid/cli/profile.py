"""`algid profile new`: a profile for a log, to edit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import say


def new(
    log: Annotated[Path, typer.Argument(help="The log to write a profile for.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Where to write it.")] = Path(
        "algid.toml"
    ),
    force: Annotated[bool, typer.Option(help="Overwrite the profile.")] = False,
) -> None:
    """Write a profile with everything that can be set, filled in with what a log tells.

    Example: algid profile new arm.mcap -o algid.toml
    """
    from algid.files import refuse_existing, whole_file
    from algid.inspection.draft import draft_profile

    refuse_existing(out, force)
    text = draft_profile(log)
    with whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    say(f"{out}: written; edit it, then try: algid inspect {log} --profile {out}")
