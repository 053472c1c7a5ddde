"""`algid track`: the payload in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import (
    OUTPUT,
    Export,
    Force,
    Form,
    Quiet,
    ResultFormat,
    command_line,
    out,
    print_report,
)
from algid.cli.output import remark
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit, exit_of


@takes_profile
def track(
    choice: Choice,
    log: Annotated[
        Path, typer.Argument(help="A log of the arm while objects are picked and placed.")
    ],
    parameters: Annotated[Path, typer.Option(help="Result of the arm, with error bars.")],
    out: Annotated[Path, out("Folder for the folder LOG.track.")] = Path(),
    l1: Annotated[
        float | None,
        typer.Option(
            "--l1",
            help="Length of link 1, m; what the result knows best by default.",
            **ends("track", "l1"),
        ),
    ] = None,
    l2: Annotated[
        float | None,
        typer.Option(
            "--l2", help="Length of link 2, m; the result's by default.", **ends("track", "l2")
        ),
    ] = None,
    force: Force = False,
    export: Annotated[
        Export | None,
        typer.Option(
            help="Also write track.mcap, for Foxglove and PlotJuggler.", rich_help_panel=OUTPUT
        ),
    ] = None,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
) -> None:
    """Find when the payload changed and what each stretch weighs; write LOG.track.

    Example: algid track picking.mcap --parameters case1-unloaded.algid -o tracks

    Raises
    ------
    typer.Exit
        As `algid.exits.exit_of` has it, where that is not `Exit.OK`.
    """
    from algid.api.track import as_json, document, failed, folder_of
    from algid.api.track import track as run
    from algid.report.progress import progress

    with progress("passes", quiet) as shown:
        result = run(
            log,
            parameters,
            l1=l1,
            l2=l2,
            profile=choice.profile(),
            out=out,
            force=force,
            export=export is not None,
            command=command_line(),
            progress=shown,
        )
    if not quiet:
        print_report(document(result), lambda: as_json(result), form)
        remark(f"wrote {folder_of(log, out)}")
    ended = exit_of(failed=failed(result), lost=result.data_lost)
    if ended is not Exit.OK:
        raise typer.Exit(ended)
