"""`algid validate`: predict the torque of logs that the result was not made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli import EXIT_FAILED
from algid.cli.report import ResultFormat
from algid.cli.settings import Choice, takes_profile

if TYPE_CHECKING:
    from algid.report.table import Table
    from algid.results import TorquePrediction


@takes_profile
def validate(
    choice: Choice,
    result: Annotated[Path, typer.Argument(help="A result folder or its result.json.")],
    logs: Annotated[list[Path], typer.Argument(help="Logs of the arm without payload.")],
    loaded: Annotated[list[Path] | None, typer.Option(help="A log of the loaded arm; may be repeated.")] = None,
    max_nrmse: Annotated[
        float | None, typer.Option(help="Largest RMSE over the torque's RMS allowed, for either joint.", min=0)
    ] = None,
    form: Annotated[ResultFormat, typer.Option("--format", help="How to print it.")] = ResultFormat.TABLE,
) -> None:
    """Print RMSE, normalised RMSE and R² of the predicted torque; exit code 1 past --max-nrmse.

    Example: algid validate run1-unloaded.algid run2-unloaded.mcap --max-nrmse 0.3
    """
    from algid.identification.identify import reused
    from algid.identification.source import Survey, open_sources, read_otherwise
    from algid.identification.validate import validate as judge
    from algid.report.markdown import markdown_table
    from algid.report.progress import progress
    from algid.report.text import visible
    from algid.results import read_result

    known = read_result(result)
    meaning = reused(choice.profile(), known)
    gravity = float(known.settings.get("gravity", 9.81))
    sources = open_sources(logs, "unloaded", meaning, gravity) + open_sources(loaded, "loaded", meaning, gravity)
    with progress("samples") as told:
        survey = Survey(sources, told)
        survey.begin("prediction")
        found = judge(known, survey, str(result))
    for warning in read_otherwise([survey.summary(log) for log in survey.logs], known, str(result)):
        typer.echo(f"algid: {visible(warning)}", err=True)
    total = found.total
    over = max_nrmse is not None and (total is None or max(total.nrmse) > max_nrmse)
    every = {**found.logs, "all logs": total}
    if form is ResultFormat.TABLE:
        typer.echo("\n".join(_line(name, one) for name, one in every.items()))
        if total is not None:
            typer.echo(f"filter: {total.filter}")
        if over:
            typer.echo(f"OVER: normalised RMSE past {max_nrmse:g}")
    elif form is ResultFormat.MARKDOWN:
        typer.echo(markdown_table(_table(every)), nl=False)
    else:
        predictions = {name: None if one is None else one.model_dump(mode="json") for name, one in found.logs.items()}
        judged = {"logs": predictions, "total": None if total is None else total.model_dump(mode="json"), "over": over}
        typer.echo(json.dumps(judged, indent=2))
    if over:
        raise typer.Exit(EXIT_FAILED)


def _table(found: Mapping[str, TorquePrediction | None]) -> Table:
    from algid.report.table import Column, Table
    from algid.report.text import ABSENT, significant, visible

    headings = ("Log", "Joint", "RMSE, N m", "RMSE / RMS", "R²")
    rows = []
    for name, one in found.items():
        if one is None:
            rows.append((visible(name), *[ABSENT] * 4))
            continue
        for joint in range(2):
            figures = (one.rmse[joint], one.nrmse[joint], one.r2[joint])
            rows.append((visible(name), str(joint + 1), *(significant(figure, 4) for figure in figures)))
    columns = (Column(headings[0], "name"), *(Column(heading, "number") for heading in headings[1:]))
    return Table("Torque prediction", columns, tuple(rows))


def _line(name: str, found: TorquePrediction | None) -> str:
    if found is None:
        return f"{name}: too short to judge"
    joints = (
        f"joint {joint}: RMSE {rmse:.4g} N m, normalised {nrmse:.4g}, R² {r2:.4f}"
        for joint, rmse, nrmse, r2 in zip((1, 2), found.rmse, found.nrmse, found.r2, strict=True)
    )
    return f"{name}: {'; '.join(joints)}"
