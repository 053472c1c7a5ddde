"""`algid report`: a result's page, made again, and its other forms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.output import console, remark, say

if TYPE_CHECKING:
    from algid.report.document import Document
    from algid.report.figures.base import Figure, Missing
    from algid.results import Result
    from algid.tracks.result import TrackResult

    Written = tuple[list[Path], Callable[[], Sequence[Figure | Missing]]]
    """The files that were written, and what gives the figures."""


class ResultFormat(StrEnum):
    """How a result is printed."""

    TABLE = "table"
    MARKDOWN = "markdown"
    JSON = "json"


class Export(StrEnum):
    """Logs for other viewers."""

    MCAP = "mcap"


ExportTo = Annotated[
    Export | None,
    typer.Option(
        help="Also write estimates.mcap, for Foxglove and PlotJuggler.", rich_help_panel="Output"
    ),
]


class PlotFormat(StrEnum):
    """How figures are saved."""

    PDF = "pdf"
    PNG = "png"


SavePlots = Annotated[
    Path | None,
    typer.Option(
        help="Folder for each figure as a file of its own, for papers; needs matplotlib: algid[plots]."
    ),
]


def report(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RESULT...", help="Folders of algid identify or algid track."),
    ],
    form: Annotated[
        ResultFormat, typer.Option("--format", help="How to print the result.")
    ] = ResultFormat.TABLE,
    export: ExportTo = None,
    save_plots: SavePlots = None,
    plot_format: Annotated[
        PlotFormat, typer.Option(help="What --save-plots writes.")
    ] = PlotFormat.PDF,
    shared_library: Annotated[
        bool,
        typer.Option("--shared-library", help="Put the plotting library once beside the folders."),
    ] = False,
) -> None:
    """Write report.html and report.md into each RESULT and print its table.

    Example: algid report case1-unloaded.algid --save-plots figures
    """
    from algid.tracks.read import is_track

    for folder in results:
        if is_track(folder):
            written, figures = _track(folder, form, mcap=export is not None)
        else:
            written, figures = _identification(
                folder, form, shared_library, mcap=export is not None
            )
        if save_plots is not None:
            from algid.report.plots import save_plots as save

            written += save(figures(), save_plots, folder.resolve().stem, plot_format.value)
        for path in written:
            remark(f"wrote {path}")


def _identification(
    folder: Path, form: ResultFormat, shared_library: bool, *, mcap: bool
) -> Written:
    """Write a result's pages and print it."""
    from algid.report.export import export_mcap
    from algid.report.gallery import gallery
    from algid.report.page import write_markdown, write_report
    from algid.report.progress import progress
    from algid.results import read_result

    result = read_result(folder)
    with progress("samples") as shown:
        written = [write_report(folder, shared_library, shown), write_markdown(folder)]
        if mcap:
            written.append(export_mcap(folder, shown))
    print_result(result, form)
    return written, lambda: gallery(folder, result).every


def _track(folder: Path, form: ResultFormat, *, mcap: bool) -> Written:
    """Write a track's pages and print it."""
    from algid.tracks.figures import figures
    from algid.tracks.page import write_pages
    from algid.tracks.read import read_track

    result = read_track(folder)
    written = write_pages(result, folder, mcap)
    print_track(result, form)
    return written, lambda: figures(result)


def print_track(result: TrackResult, form: ResultFormat) -> None:
    """Print a track to stdout."""
    from algid.tracks.page import track_document
    from algid.tracks.result import track_json

    print_report(track_document(result), lambda: track_json(result), form)


def print_result(result: Result, form: ResultFormat) -> None:
    """Print a result to stdout."""
    from algid.report.page import result_document
    from algid.results import result_json

    print_report(result_document(result), lambda: result_json(result), form)


def print_report(document: Document, json: Callable[[], str], form: ResultFormat) -> None:
    """Print `document`, or what `json` gives, to stdout: nothing but it, so that it can be piped."""
    from algid.report.markdown import markdown
    from algid.report.terminal import print_document

    if form is ResultFormat.TABLE:
        print_document(document, console())
    else:
        say(json() if form is ResultFormat.JSON else markdown(document), end="")
