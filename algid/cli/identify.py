"""`algid identify`: from logs to parameters, payload and error bars."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.output import remark, say
from algid.cli.report import ExportTo, ResultFormat, print_result
from algid.cli.settings import Choice, takes_settings
from algid.exits import Exit, exit_of
from algid.words import counted

if TYPE_CHECKING:
    from algid.results import Result


OUTPUT = "Output"


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
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", help="Folder for the result folder LOG.algid.", rich_help_panel=OUTPUT
        ),
    ] = Path(),
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
    force: Annotated[
        bool,
        typer.Option("--force", help="Replace a result that is there.", rich_help_panel=OUTPUT),
    ] = False,
    report: Annotated[
        bool,
        typer.Option(
            help="Write pages and time series beside result.json.", rich_help_panel=OUTPUT
        ),
    ] = True,
    export: ExportTo = None,
    output: Annotated[
        ResultFormat, typer.Option("--format", help="What to print.", rich_help_panel=OUTPUT)
    ] = ResultFormat.TABLE,
    quiet: Annotated[
        bool,
        typer.Option("-q", "--quiet", help="Print nothing but errors.", rich_help_panel=OUTPUT),
    ] = False,
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
    SettingError
        If a log of estimates is asked for without a report.
    typer.Exit
        As `algid.exits.exit_of` has it, where that is not `Exit.OK`.
    """
    import shlex

    from algid.errors import SettingError
    from algid.files import result_folder
    from algid.identification.identify import identify as run
    from algid.report.progress import progress
    from algid.runtime import keep_freed
    from algid.text import visible

    if export is not None and not report:
        raise SettingError("--export: the log is made from the time series; leave --no-report out")
    keep_freed()
    settings = choice.settings()
    unloaded, loaded = (
        (logs, loaded or []) if parameters is None else ([], [*logs, *(loaded or [])])
    )
    with progress("samples", quiet) as shown:
        result = run(
            unloaded,
            loaded,
            settings,
            parameters=parameters,
            profile=choice.profile(),
            out=out,
            name=name,
            force=force,
            report=report,
            export=export is not None,
            command=shlex.join(["algid", *sys.argv[1:]]),
            progress=shown,
        )
    if verbose:
        _print_reading(result)
    if not quiet:
        folder = result_folder(result.log.path, out, name)
        if output is ResultFormat.TABLE and not verbose:
            from algid.report.brief import brief

            for line in brief(result):
                say(line)
        else:
            print_result(result, output)
            for note in result.notes:
                remark(f"note: {visible(note)}")
        remark(f"wrote {folder}")
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
