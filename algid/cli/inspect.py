"""`algid inspect`: what a log holds and is worth, before anyone identifies anything."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from algid.cli.common import OUTPUT, Quiet
from algid.cli.output import console, say
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit, exit_of
from algid.text import lines_of


@takes_profile
def inspect(
    choice: Choice,
    log: Annotated[Path, typer.Argument(help="CSV, Parquet or MCAP log, or a rosbag2 folder.")],
    form: Annotated[
        Literal["table", "json"],
        typer.Option("--format", help="What to print.", rich_help_panel=OUTPUT),
    ] = "table",
    quiet: Quiet = False,
) -> None:
    """Show what a log holds, which channels would be used, and what is wrong with it.

    Example: algid inspect arm.mcap --joints shoulder,elbow --zero hanging

    Raises
    ------
    typer.Exit
        At the end: with 2 for a log that would be refused, 3 where physics contradicts its
        convention, 4 where samples are missing, else with 0.
    """
    from algid.api.inspect import as_json, content
    from algid.api.inspect import inspect as run
    from algid.report.document import Table
    from algid.report.terminal import print_table
    from algid.runtime import keep_freed

    keep_freed()
    inspection = run(log, profile=choice.profile())
    if not quiet and form == "json":
        say(as_json(inspection), end="")
    elif not quiet:
        terminal = console()
        for part in content(inspection):
            if isinstance(part, Table):
                print_table(part, terminal)
                terminal.print()
            else:
                for line in lines_of(part, terminal.width, rest="    "):
                    say(line)
    raise typer.Exit(
        Exit.USAGE
        if inspection.refused
        else exit_of(failed=inspection.contradicted, lost=inspection.lossy)
    )
