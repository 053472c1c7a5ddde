"""`algid check`: fail when a reported error has grown."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import Quiet
from algid.cli.output import say
from algid.exits import Exit


class Against(StrEnum):
    """What the errors are compared with."""

    PAPER = "paper"
    TRUTH = "truth"


def check(
    result: Annotated[Path, typer.Argument(help="A result folder or its result.json.")],
    against: Annotated[
        Against,
        typer.Option(help="paper: each error at most Table 4's; truth: each at most --max-error."),
    ] = Against.TRUTH,
    max_error: Annotated[
        float | None,
        typer.Option(help="Largest error allowed, percent.", **ends("check", "max_error")),
    ] = None,
    tolerance_file: Annotated[
        Path | None,
        typer.Option(help="TOML with a table [max_error_percent]: parameter = percent."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare a result's errors with their limits, row by row; exit code 1 when one is over.

    Example: algid check case1-unloaded.algid --against truth --max-error 0.5

    Raises
    ------
    typer.Exit
        With `Exit.LIMIT` where an error is over its limit.
    """
    from algid.api.check import check as run

    rows = run(result, against.value, max_error, tolerance_file)
    for row in rows if not quiet else ():
        say(row.text)
    if not all(row.passed for row in rows):
        raise typer.Exit(Exit.LIMIT)
