"""`algid validate`: predict the torque of logs that the result was not made from."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from algid.cli.output import complain, say
from algid.cli.report import ResultFormat
from algid.cli.settings import Choice, takes_profile
from algid.exits import Exit
from algid.words import counted

if TYPE_CHECKING:
    from algid.estimators.rollout import RolloutScore
    from algid.report.document import Table
    from algid.results import TorquePrediction

    Simulated = Mapping[str, list[dict[str, Any]]]
    """The rows of `_rows` by log."""


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
            help="Largest RMSE over the torque's RMS allowed, for either joint.", min=0, max=1e9
        ),
    ] = None,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate",
            help="Also simulate the arm over 0.1, 0.5 and 2 s, and tell its angles' RMSE.",
        ),
    ] = False,
    form: Annotated[
        ResultFormat, typer.Option("--format", help="How to print it.")
    ] = ResultFormat.TABLE,
) -> None:
    """Print RMSE, normalised RMSE and R² of the predicted torque; exit code 1 past --max-nrmse.

    Example: algid validate run1-unloaded.algid run2-unloaded.mcap --max-nrmse 0.3

    Raises
    ------
    typer.Exit
        With `Exit.LIMIT` where a limit is given and the normalised RMSE is past it or missing.
    """
    from algid.identification.identify import reused
    from algid.identification.source import open_sources, read_otherwise
    from algid.identification.survey import Survey
    from algid.identification.validate import predictor_of
    from algid.identification.validate import simulate as roll
    from algid.identification.validate import validate as judge
    from algid.report.markdown import markdown_table
    from algid.report.progress import progress
    from algid.results import read_result

    known, meaning = None, choice.profile()
    if result.suffix == ".urdf":
        from algid.exports.read_urdf import read_urdf

        model, warnings = read_urdf(result)
    else:
        known = read_result(result)
        model, warnings, meaning = predictor_of(known, str(result)), (), reused(meaning, known)
    gravity = model.model.gravity
    sources = open_sources(logs, "unloaded", meaning, gravity) + open_sources(
        loaded, "loaded", meaning, gravity
    )
    with progress("samples") as shown:
        survey = Survey(sources, shown)
        survey.begin("prediction")
        found = judge(model, survey)
        rolled = roll(model, survey) if simulate else None
    summaries = [survey.summary(log) for log in survey.logs]
    otherwise = (
        []
        if known is None
        else [one.sentence for one in read_otherwise(summaries, known, str(result))]
    )
    for warning in (*warnings, *otherwise):
        complain(warning)
    total = found.total
    over = max_nrmse is not None and (total is None or max(total.nrmse) > max_nrmse)
    every = {**found.logs, "all logs": total}
    simulation = {} if rolled is None else {**rolled.logs, "all logs": rolled.total}
    simulated = {name: _rows(one) for name, one in simulation.items()}
    if form is ResultFormat.TABLE:
        say("\n".join(_lines(every, simulated)))
        if over:
            say(f"OVER: normalised RMSE past {max_nrmse:g}")
    elif form is ResultFormat.MARKDOWN:
        say("\n".join(map(markdown_table, _tables(every, simulated))), end="")
    else:
        predictions = {
            name: None if one is None else one.model_dump(mode="json")
            for name, one in every.items()
        }
        content: dict[str, Any] = {
            "logs": predictions,
            "total": predictions.pop("all logs"),
            "over": over,
        }
        if simulated:
            content["simulation"] = simulated
        say(json.dumps(content, indent=2, allow_nan=False))
    if over:
        raise typer.Exit(Exit.LIMIT)


def _rows(one: RolloutScore) -> list[dict[str, Any]]:
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


def _lines(every: Mapping[str, TorquePrediction | None], simulated: Simulated) -> Iterator[str]:
    """The predictions in words, then the simulations."""
    from algid.text import visible

    for name, one in every.items():
        if one is None:
            yield f"{name}: too short to judge"
            continue
        joints = (
            f"joint {joint}: RMSE {rmse:.4g} N m, normalised {nrmse:.4g}, R² {r2:.4f}"
            for joint, rmse, nrmse, r2 in zip((1, 2), one.rmse, one.nrmse, one.r2, strict=True)
        )
        yield f"{name}: {'; '.join(joints)}"
    if (total := every["all logs"]) is not None:
        yield f"filter: {total.filter}"
    for name, rows in simulated.items():
        for row in rows:
            head = f"{visible(name)}: simulated {row['horizon']:g} s"
            joints = (
                f"joint {joint}: RMSE {_number(rmse)} rad where it moved {_number(moved)} rad"
                for joint, rmse, moved in zip((1, 2), row["rmse"], row["moved"], strict=True)
            )
            states = f"from {counted(row['starts'], 'state')}: {'; '.join(joints)}"
            yield f"{head} {states}" if row["starts"] else f"{head}: too short to judge"


def _tables(every: Mapping[str, TorquePrediction | None], simulated: Simulated) -> Iterator[Table]:
    """The predictions, and the simulations if there are any."""
    from algid.report.document import Column, Table
    from algid.text import ABSENT, significant, visible

    def table(title: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> Table:
        columns = (
            Column(headings[0], "name"),
            *(Column(heading, "number") for heading in headings[1:]),
        )
        return Table(title, columns, tuple(rows))

    predicted: list[tuple[str, ...]] = []
    for name, one in every.items():
        if one is None:
            predicted.append((visible(name), *[ABSENT] * 4))
            continue
        for joint, figures in enumerate(zip(one.rmse, one.nrmse, one.r2, strict=True), start=1):
            predicted.append(
                (visible(name), str(joint), *(significant(figure, 4) for figure in figures))
            )
    yield table("Torque prediction", ("Log", "Joint", "RMSE, N m", "RMSE / RMS", "R²"), predicted)
    if simulated:
        rolled = [
            (
                *(visible(name), f"{row['horizon']:g}", str(row["starts"]), str(joint + 1)),
                *(
                    _number(row[kind][joint]) if row["starts"] else "-"
                    for kind in ("rmse", "moved")
                ),
            )
            for name, rows in simulated.items()
            for row in rows
            for joint in range(2)
        ]
        headings = ("Log", "Horizon, s", "States", "Joint", "RMSE, rad", "Moved, rad")
        yield table("Angles of the arm simulated forward", headings, rolled)


def _number(value: float | None) -> str:
    return "without bounds" if value is None else f"{value:.4g}"
