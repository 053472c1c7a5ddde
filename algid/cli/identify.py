"""`algid identify`: from logs to parameters, payload and error bars."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from algid.cli import EXIT_INCOMPLETE
from algid.cli.report import ResultFormat, print_result
from algid.cli.settings import Choice, takes_settings


@takes_settings
def identify(
    choice: Choice,
    logs: Annotated[list[Path], typer.Argument(help="Logs of the arm without payload; loaded ones with --parameters.")],
    loaded: Annotated[
        list[Path] | None, typer.Option(help="A log of the arm with its payload; may be repeated.")
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the result folder LOG.algid.")] = Path(),
    parameters: Annotated[
        Path | None, typer.Option(help="Result of the arm identified before: then LOGS are of the loaded arm.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is there.")] = False,
    report: Annotated[bool, typer.Option(help="Write pages and time series beside result.json.")] = True,
    output: Annotated[ResultFormat, typer.Option("--format", help="What to print.")] = ResultFormat.TABLE,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Identify an arm's constants k1 … k7 and, with loaded logs, its payload; write LOG.algid.

    Exit code 3 tells that a parameter could not be identified or that samples were lost.

    Example: algid identify run-unloaded.mcap --loaded run-loaded.mcap -o results
    """
    from algid.pipeline.identify import identify as run
    from algid.results import read_result

    settings = choice.settings()
    known = None if parameters is None else read_result(parameters)
    bare, burdened = (logs, loaded or []) if known is None else ([], [*logs, *(loaded or [])])
    result = run(
        bare,
        burdened,
        settings,
        parameters=known,
        profile=choice.profile(),
        out=out,
        force=force,
        report=report,
        command=shlex.join(["algid", *sys.argv[1:]]),
    )
    if not quiet:
        print_result(result, output)
    if not result.complete or result.data_lost:
        raise typer.Exit(EXIT_INCOMPLETE)
