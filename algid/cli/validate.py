"""`algid validate`: predict the torque of logs that the result was not made from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.api.ranges import ends
from algid.cli.common import Form, Quiet, ResultFormat, print_tables
from algid.cli.output import complain, say
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit


@takes_profile
def validate(
    choice: Choice,
    result: Annotated[
        Path, typer.Argument(help="A result folder, its result.json, or a URDF file.")
    ],
    logs: Annotated[list[Path], typer.Argument(help="Logs of the arm without payload.")],
    loaded: Annotated[
        list[Path] | None, typer.Option(help="A log of the loaded arm; may be repeated.")
    ] = None,
    max_nrmse: Annotated[
        float | None,
        typer.Option(
            help="Largest RMSE over the torque's RMS allowed, for either joint.",
            **ends("validate", "max_nrmse"),
        ),
    ] = None,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate",
            help="Also simulate the arm over 0.1, 0.5 and 2 s, and tell its angles' RMSE.",
        ),
    ] = False,
    form: Form = ResultFormat.TABLE,
    quiet: Quiet = False,
) -> None:
    """Print RMSE, normalised RMSE and R² of the predicted torque; exit code 1 past --max-nrmse.

    Example: algid validate run1-unloaded.algid run2-unloaded.mcap --max-nrmse 0.3

    Raises
    ------
    typer.Exit
        With `Exit.LIMIT` where a limit is given and the normalised RMSE is past it or missing.
    """
    from algid.api.validate import validate as run
    from algid.report.progress import progress

    with progress("samples", quiet) as shown:
        validated = run(
            result,
            logs,
            loaded,
            max_nrmse=max_nrmse,
            simulate=simulate,
            profile=choice.profile(),
            progress=shown,
        )
    if not quiet:
        for warning in validated.warnings:
            complain(warning)
        print_tables(validated.tables(), validated.as_json, form)
        if validated.over and form is ResultFormat.TABLE:
            say(f"OVER: normalised RMSE past {max_nrmse:g}")
    if validated.over:
        raise typer.Exit(Exit.LIMIT)
