"""`algid report`: write a result's or a track's pages anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli.common import OUTPUT, Export, Form, Quiet, ResultFormat, print_report
from algid.cli.output import remark


def report(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RESULT...", help="Folders of algid identify or algid track."),
    ],
    form: Form = ResultFormat.TABLE,
    export: Annotated[
        Export | None,
        typer.Option(
            help="Also write estimates.mcap, for Foxglove and PlotJuggler.", rich_help_panel=OUTPUT
        ),
    ] = None,
    shared_library: Annotated[
        bool,
        typer.Option("--shared-library", help="Put the plotting library once beside the folders."),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write report.html and report.md into each RESULT and print its table.

    Example: algid report case1-unloaded.algid --export mcap
    """
    from algid.api.report import report as run
    from algid.report.progress import progress

    for folder in results:
        with progress("samples", quiet) as shown:
            made = run(
                folder, export=export is not None, shared_library=shared_library, progress=shown
            )
        if quiet:
            continue
        print_report(made.document(), made.as_json, form)
        for path in made.written:
            remark(f"wrote {path}")
