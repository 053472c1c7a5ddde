"""`algid report`: write a result's or a track's pages anew."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from algid.cli.common import OUTPUT, Export, Form, Quiet, ResultFormat, print_report
from algid.cli.output import remark


class PlotFormat(StrEnum):
    """How figures are saved."""

    PDF = "pdf"
    PNG = "png"


SavePlots = Annotated[
    Path | None,
    typer.Option(
        help="Folder for each figure as a file of its own, for papers; needs matplotlib: "
        "algid[plots]."
    ),
]


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
    save_plots: SavePlots = None,
    plot_format: Annotated[
        PlotFormat, typer.Option(help="What --save-plots writes.")
    ] = PlotFormat.PDF,
    shared_library: Annotated[
        bool,
        typer.Option("--shared-library", help="Put the plotting library once beside the folders."),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write report.html and report.md into each RESULT and print its table.

    Example: algid report case1-unloaded.algid --save-plots figures
    """
    from algid.api.report import report as run
    from algid.report.progress import progress

    for folder in results:
        with progress("samples", quiet) as shown:
            made = run(
                folder, export=export is not None, shared_library=shared_library, progress=shown
            )
        written = made.written
        if save_plots is not None:
            written += made.save_plots(save_plots, folder.resolve().stem, plot_format.value)
        if quiet:
            continue
        print_report(made.document(), made.as_json, form)
        for path in written:
            remark(f"wrote {path}")
