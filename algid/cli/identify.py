"""`algid identify`: from logs to parameters, payload and error bars."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
from algid.cli.output import remark, say
from algid.cli.settings import Choice, takes_settings
from algid.exits import Exit, exit_of
from algid.words import counted

if TYPE_CHECKING:
    from algid.api.result import Result


@takes_settings
def identify(
    choice: Choice,
    logs: Annotated[
        list[Path],
        typer.Argument(help="Logs of the arm without payload; loaded ones with --parameters."),
    ],
    loaded: Annotated[
        list[Path] | None, typer.Option(help="A log of the arm with its payload; may be repeated.")
    ] = None,
    out: Annotated[Path, out("Folder for the result folder LOG.algid.")] = Path(),
    name: Annotated[
        str | None,
        typer.Option(
            help="Of the result folder, NAME.algid; LOG's name by default.", rich_help_panel=OUTPUT
        ),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(help="Result of the arm identified before: then LOGS are of the loaded arm."),
    ] = None,
    force: Force = False,
    report: Annotated[
        bool,
        typer.Option(
            help="Write pages and time series beside result.json.", rich_help_panel=OUTPUT
        ),
    ] = True,
    export: Annotated[
        Export | None,
        typer.Option(
            help="Also write estimates.mcap, for Foxglove and PlotJuggler.", rich_help_panel=OUTPUT
        ),
    ] = None,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "-v",
            "--verbose",
            help="All tables, reasons, logs, channels and settings.",
            rich_help_panel=OUTPUT,
        ),
    ] = False,
) -> None:
    """Identify an arm's constants k1 … k7 and, with loaded logs, its payload; write LOG.algid.

    Example: algid identify run-unloaded.mcap --loaded run-loaded.mcap -o results

    Raises
    ------
    typer.Exit
        As `algid.exits.exit_of` has it, where that is not `Exit.OK`.
    """
    from algid.api.identify import as_json, document, folder_of
    from algid.api.identify import identify as run
    from algid.report.brief import brief
    from algid.report.progress import progress
    from algid.runtime import keep_freed
    from algid.text import visible

    keep_freed()
    unloaded, carried = (
        (logs, loaded or []) if parameters is None else ([], [*logs, *(loaded or [])])
    )
    with progress("samples", quiet) as shown:
        result = run(
            unloaded,
            carried,
            choice.settings(),
            parameters=parameters,
            profile=choice.profile(),
            out=out,
            name=name,
            force=force,
            report=report,
            export=export is not None,
            command=command_line(),
            progress=shown,
        )
    if verbose:
        _print_reading(result)
    if not quiet:
        if form is ResultFormat.TABLE and not verbose:
            for line in brief(result):
                say(line)
        else:
            print_report(document(result), lambda: as_json(result), form)
            for note in result.notes:
                remark(f"note: {visible(note)}")
        remark(f"wrote {folder_of(result, out, name)}")
    ended = exit_of(failed=result.verdict.failed or not result.complete, lost=result.data_lost)
    if ended is not Exit.OK:
        raise typer.Exit(ended)


def _print_reading(result: Result) -> None:
    """What was read, and how, on standard error."""
    from algid.text import visible

    for log in result.logs:
        size = f"{counted(log.rows, 'sample')}, {log.duration:.6g} s at {log.rate:.6g} Hz"
        text = f"{log.role} {log.path}: {size}, {log.format}"
        remark(visible(text))
        for signal, source in log.mapping.items():
            remark(visible(f"  {signal} from {source}"))
    for name, value in result.settings.items():
        remark(visible(f"{name} = {value}"))
