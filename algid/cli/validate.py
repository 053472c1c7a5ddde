"""`algid validate`: predict the torque of logs that the result was not made from."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from algid.cli import EXIT_FAILED
from algid.cli.report import ResultFormat
from algid.cli.settings import Choice, takes_profile
from algid.words import counted

if TYPE_CHECKING:
    from algid.estimators.rollout import RolloutScore
    from algid.identification.validate import Simulation
    from algid.report.document import Table
    from algid.results import TorquePrediction


@takes_profile
def validate(
    choice: Choice,
    result: Annotated[Path, typer.Argument(help="A result folder, its result.json, or a URDF file.")],
    logs: Annotated[list[Path], typer.Argument(help="Logs of the arm without payload.")],
    loaded: Annotated[list[Path] | None, typer.Option(help="A log of the loaded arm; may be repeated.")] = None,
    max_nrmse: Annotated[
        float | None, typer.Option(help="Largest RMSE over the torque's RMS allowed, for either joint.", min=0)
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Also simulate the arm over 0.1, 0.5 and 2 s, and tell its angles' RMSE.")
    ] = False,
    form: Annotated[ResultFormat, typer.Option("--format", help="How to print it.")] = ResultFormat.TABLE,
) -> None:
    """Print RMSE, normalised RMSE and R² of the predicted torque; exit code 1 past --max-nrmse.

    Example: algid validate run1-unloaded.algid run2-unloaded.mcap --max-nrmse 0.3
    """
    from algid.identification.identify import reused
    from algid.identification.source import open_sources, read_otherwise
    from algid.identification.survey import Survey
    from algid.identification.validate import predictor_of
    from algid.identification.validate import simulate as roll
    from algid.identification.validate import validate as judge
    from algid.report.markdown import markdown_table
    from algid.report.progress import progress
    from algid.report.text import visible
    from algid.results import read_result

    known, meaning = None, choice.profile()
    if result.suffix == ".urdf":
        from algid.export.read_urdf import read_urdf

        model, warnings = read_urdf(result)
    else:
        known = read_result(result)
        model, warnings, meaning = predictor_of(known, str(result)), (), reused(meaning, known)
    gravity = model.model.gravity
    sources = open_sources(logs, "unloaded", meaning, gravity) + open_sources(loaded, "loaded", meaning, gravity)
    with progress("samples") as told:
        survey = Survey(sources, told)
        survey.begin("prediction")
        found = judge(model, survey)
        simulation = roll(model, survey) if simulate else None
    summaries = [survey.summary(log) for log in survey.logs]
    for warning in (*warnings, *(() if known is None else read_otherwise(summaries, known, str(result)))):
        typer.echo(f"algid: {visible(warning)}", err=True)
    total = found.total
    over = max_nrmse is not None and (total is None or max(total.nrmse) > max_nrmse)
    every = {**found.logs, "all logs": total}
    if form is ResultFormat.TABLE:
        typer.echo("\n".join(_line(name, one) for name, one in every.items()))
        if total is not None:
            typer.echo(f"filter: {total.filter}")
        if simulation is not None:
            typer.echo("\n".join(_simulated_lines(simulation)))
        if over:
            typer.echo(f"OVER: normalised RMSE past {max_nrmse:g}")
    elif form is ResultFormat.MARKDOWN:
        typer.echo(markdown_table(_table(every)), nl=False)
        if simulation is not None:
            typer.echo("\n" + markdown_table(_simulated_table(simulation)), nl=False)
    else:
        predictions = {name: None if one is None else one.model_dump(mode="json") for name, one in found.logs.items()}
        content = {"logs": predictions, "total": None if total is None else total.model_dump(mode="json"), "over": over}
        if simulation is not None:
            content["simulation"] = {name: _simulated_json(one) for name, one in _every(simulation).items()}
        typer.echo(json.dumps(content, indent=2, allow_nan=False))
    if over:
        raise typer.Exit(EXIT_FAILED)


def _table(found: Mapping[str, TorquePrediction | None]) -> Table:
    from algid.report.document import Column, Table
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


def _every(simulation: Simulation) -> dict[str, RolloutScore]:
    return {**simulation.logs, "all logs": simulation.total}


def _simulated_lines(simulation: Simulation) -> Iterator[str]:
    from algid.report.text import visible

    for name, one in _every(simulation).items():
        for row in _simulated_json(one):
            if not row["starts"]:
                yield f"{visible(name)}: simulated {row['horizon']:g} s: too short to judge"
                continue
            joints = (
                f"joint {joint}: RMSE {_number(rmse)} rad where it moved {_number(moved)} rad"
                for joint, rmse, moved in zip((1, 2), row["rmse"], row["moved"], strict=True)
            )
            yield (
                f"{visible(name)}: simulated {row['horizon']:g} s from "
                f"{counted(row['starts'], 'state')}: {'; '.join(joints)}"
            )


def _number(value: float | None) -> str:
    return "without bounds" if value is None else f"{value:.4g}"


def _simulated_table(simulation: Simulation) -> Table:
    from algid.report.document import Column, Table
    from algid.report.text import visible

    headings = ("Log", "Horizon, s", "States", "Joint", "RMSE, rad", "Moved, rad")
    rows = [
        (
            *(visible(name), f"{row['horizon']:g}", str(row["starts"]), str(joint + 1)),
            *(_number(row[kind][joint]) if row["starts"] else "-" for kind in ("rmse", "moved")),
        )
        for name, one in _every(simulation).items()
        for row in _simulated_json(one)
        for joint in range(2)
    ]
    columns = (Column(headings[0], "name"), *(Column(heading, "number") for heading in headings[1:]))
    return Table("Angles of the arm simulated forward", columns, tuple(rows))


def _simulated_json(one: RolloutScore) -> list[dict[str, Any]]:
    """A horizon a row; null where there is no start, or where the simulation runs away."""
    import numpy as np

    from algid.estimators.rollout import HORIZONS

    def numbers(pair: Iterable[float]) -> list[float | None]:
        return [float(value) if np.isfinite(value) else None for value in pair]

    rows = zip(HORIZONS, one.count.tolist(), one.rmse, one.distance, strict=True)
    return [
        {"horizon": horizon, "starts": int(count), "rmse": numbers(rmse), "moved": numbers(moved)}
        for horizon, count, rmse, moved in rows
    ]
