"""`algid track`: the payload in time."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from algid.cli.output import remark
from algid.cli.report import Export, ResultFormat, print_track
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit, exit_of


@takes_profile
def track(
    choice: Choice,
    log: Annotated[
        Path, typer.Argument(help="A log of the arm while objects are picked and placed.")
    ],
    parameters: Annotated[Path, typer.Option(help="Result of the arm, with error bars.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the folder LOG.track.")
    ] = Path(),
    l1: Annotated[
        float | None,
        typer.Option(
            "--l1", help="Length of link 1, m; the result's by default.", min=1e-3, max=1e3
        ),
    ] = None,
    l2: Annotated[
        float | None,
        typer.Option(
            "--l2", help="Length of link 2, m; the result's by default.", min=1e-3, max=1e3
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a track that is there.")] = False,
    export: Annotated[
        Export | None, typer.Option(help="Also write track.mcap, for Foxglove and PlotJuggler.")
    ] = None,
    form: Annotated[
        ResultFormat, typer.Option("--format", help="What to print.")
    ] = ResultFormat.TABLE,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Find when the payload changed and what each stretch weighs; write LOG.track.

    Example: algid track picking.mcap --parameters case1-unloaded.algid -o tracks

    Raises
    ------
    typer.Exit
        As `algid.exits.exit_of` has it, where that is not `Exit.OK`.
    """
    import shlex

    from algid.files import refuse_existing, whole_folder
    from algid.report.progress import progress
    from algid.tracks.page import track_folder, write_track
    from algid.tracks.run import track_log
    from algid.tracks.tables import verdict

    folder = track_folder(str(log), out)
    refuse_existing(folder, force)
    settings = {"command": shlex.join(["algid", *sys.argv[1:]])}
    with progress("passes", quiet) as shown:
        if shown is not None:
            shown("weighing the payload", 0, 0)
        result = track_log(
            log, parameters, l1=l1, l2=l2, profile=choice.profile(), settings=settings
        )
        with whole_folder(folder, force) as temporary:
            write_track(result, temporary, mcap=export is Export.MCAP)
    if not quiet:
        print_track(result, form)
        remark(f"wrote {folder}")
    ended = exit_of(failed=verdict(result).failed or not result.complete, lost=result.data_lost)
    if ended is not Exit.OK:
        raise typer.Exit(ended)
