"""`algid synth`: synthetic logs of an arm, with the truth inside."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from algid.api.ranges import ends
from algid.cli.common import Force, Quiet, out
from algid.cli.completion import cases, or_files
from algid.cli.output import say


class LogFormat(StrEnum):
    """Formats that logs are written in."""

    MCAP = "mcap"
    PARQUET = "parquet"
    CSV = "csv"


class Hold(StrEnum):
    """What the drive does between two torque samples."""

    EXACT = "exact"
    ZOH = "zoh"
    FOH = "foh"


def synth(
    case: Annotated[
        str,
        typer.Argument(
            autocompletion=cases,
            help="case1, case2, or a TOML file that describes an arm.",
        ),
    ],
    out: Annotated[Path, out("Folder to write into.")] = Path(),
    kind: Annotated[
        LogFormat, typer.Option("--format", help="Format of the logs.")
    ] = LogFormat.MCAP,
    rate: Annotated[
        float, typer.Option(help="Samples a second, Hz.", **ends("synth", "rate"))
    ] = 1000.0,
    duration: Annotated[
        float | None,
        typer.Option(
            help="Length of each log, s; 1, or as long as the motion.", **ends("synth", "duration")
        ),
    ] = None,
    torque: Annotated[
        str | None,
        typer.Option(
            autocompletion=or_files("case", "wide", "none"),
            help="case (the case's own, the default), wide (0.3 to 8 Hz), none, or a log to "
            "replay.",
        ),
    ] = None,
    motion: Annotated[
        Path | None,
        typer.Option(
            help="Folder of algid design: a controller follows its motion, instead of --torque."
        ),
    ] = None,
    torque_hold: Annotated[
        Hold,
        typer.Option(
            help="Whether the drive holds (zoh) or ramps (foh) the torque between samples."
        ),
    ] = Hold.EXACT,
    initial: Annotated[
        str | None,
        typer.Option(
            help="Initial state θ1,θ2,ω1,ω2 in rad and rad/s; hanging at rest by default."
        ),
    ] = None,
    position_noise: Annotated[
        float,
        typer.Option(
            help="Noise of the angles, rad (standard deviation).", **ends("synth", "position_noise")
        ),
    ] = 0.0,
    torque_noise: Annotated[
        float,
        typer.Option(
            help="Noise of the torques, N m (standard deviation).", **ends("synth", "torque_noise")
        ),
    ] = 0.0,
    encoder_bits: Annotated[
        int | None,
        typer.Option(
            help="Round angles to 2π / 2^bits, as an encoder does.", **ends("synth", "encoder_bits")
        ),
    ] = None,
    jitter: Annotated[
        float,
        typer.Option(
            help="Jitter of the stamps, s (standard deviation).", **ends("synth", "jitter")
        ),
    ] = 0.0,
    drop: Annotated[
        float, typer.Option(help="Share of samples lost at random.", **ends("synth", "drop"))
    ] = 0.0,
    seed: Annotated[
        int, typer.Option(help="Seed of noise, jitter and losses.", **ends("synth", "seed"))
    ] = 0,
    force: Force = False,
    quiet: Quiet = False,
    start_time: Annotated[
        datetime | None,
        typer.Option(help="When the log starts, in UTC; its stamps count from zero by default."),
    ] = None,
    payload_schedule: Annotated[
        str | None,
        typer.Option(
            help="One log instead, its payload changing: S=KG,…, like 2=0.05,4=0; bare before."
        ),
    ] = None,
) -> None:
    """Write CASE-unloaded and CASE-loaded logs of a simulated arm; the truth travels with them.

    Velocities are in the logs only where angles are exact: with noise or an encoder the arm
    measures none.

    Example: algid synth case1 -o logs --position-noise 1e-3 --torque-noise 1e-2 --duration 10
    --torque wide

    """
    from algid.api.synthesise import synthesise
    from algid.report.progress import progress

    options: dict[str, Any] = {
        "duration": duration,
        "rate": rate,
        "excitation": torque,
        "motion": motion,
        "torque_hold": torque_hold.value,
        "initial": initial,
        "position_noise": position_noise,
        "torque_noise": torque_noise,
        "encoder_bits": encoder_bits,
        "jitter": jitter,
        "drop": drop,
        "seed": seed,
        "start_time": start_time,
        "payload_schedule": payload_schedule,
    }
    with progress("samples", quiet) as shown:
        logs = synthesise(case, **options, out=out, kind=kind.value, force=force, progress=shown)
    for log in logs if not quiet else ():
        say(str(out / f"{log.origin.path}.{kind.value}"))
