"""`algid report`: a result's page, made again, and its other forms."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from algid.results import Result


class ResultFormat(StrEnum):
    """How a result is printed."""

    TABLE = "table"
    MARKDOWN = "markdown"
    JSON = "json"


class Export(StrEnum):
    """Logs for other viewers."""

    MCAP = "mcap"


ExportTo = Annotated[Export | None, typer.Option(help="Also write estimates.mcap, for Foxglove and PlotJuggler.")]


def report(
    results: Annotated[list[Path], typer.Argument(metavar="RESULT...", help="Result folders of algid identify.")],
    form: Annotated[ResultFormat, typer.Option("--format", help="How to print the result.")] = ResultFormat.TABLE,
    export: ExportTo = None,
    shared_library: Annotated[
        bool, typer.Option("--shared-library", help="Put the plotting library once beside the folders.")
    ] = False,
) -> None:
    """Write report.html and report.md into each RESULT and print its table.

    Example: algid report case1-unloaded.algid --export mcap
    """
    from algid.report import export_mcap, write_markdown, write_report
    from algid.report.progress import progress
    from algid.results import read_result

    for folder in results:
        result = read_result(folder)
        with progress("samples") as told:
            written = [write_report(folder, shared_library, told), write_markdown(folder)]
            if export is Export.MCAP:
                written.append(export_mcap(folder, told))
        print_result(result, form)
        for path in written:
            typer.echo(f"wrote {path}", err=True)


def print_result(result: Result, form: ResultFormat) -> None:
    """Print a result to stdout: nothing but the result, so that it can be piped."""
    from rich.console import Console

    from algid.report import markdown, print_table
    from algid.results import result_json

    if form is ResultFormat.TABLE:
        print_table(result, Console())
    else:
        typer.echo(markdown(result) if form is ResultFormat.MARKDOWN else result_json(result), nl=False)
