"""`algid synth`: synthetic logs of an arm, with the truth inside."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from algid.cli.completion import cases, or_files
from algid.cli.output import say

if TYPE_CHECKING:
    from algid.synth.cases import Case
    from algid.synth.excitation import Torque


FIRST_YEAR, LAST_YEAR = 1970, 2037
"""Of a log's start: the stamps in messages of ROS 2 end in January 2038."""


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
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write into.")] = Path(),
    kind: Annotated[
        LogFormat, typer.Option("--format", help="Format of the logs.")
    ] = LogFormat.MCAP,
    rate: Annotated[float, typer.Option(help="Samples a second, Hz.", min=1e-3, max=1e6)] = 1000.0,
    duration: Annotated[
        float | None,
        typer.Option(help="Length of each log, s; 1, or as long as the motion.", min=1e-3, max=1e6),
    ] = None,
    torque: Annotated[
        str | None,
        typer.Option(
            autocompletion=or_files("case", "wide", "none"),
            help="case (the case's own, the default), wide (0.3 to 8 Hz), none, or a log to replay.",
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
        float, typer.Option(help="Noise of the angles, rad (standard deviation).", min=0, max=1e3)
    ] = 0.0,
    torque_noise: Annotated[
        float, typer.Option(help="Noise of the torques, N m (standard deviation).", min=0, max=1e3)
    ] = 0.0,
    encoder_bits: Annotated[
        int | None,
        typer.Option(help="Round angles to 2π / 2^bits, as an encoder does.", min=4, max=32),
    ] = None,
    jitter: Annotated[
        float, typer.Option(help="Jitter of the stamps, s (standard deviation).", min=0, max=1e3)
    ] = 0.0,
    drop: Annotated[
        float, typer.Option(help="Share of samples lost at random.", min=0, max=0.9)
    ] = 0.0,
    seed: Annotated[
        int, typer.Option(help="Seed of noise, jitter and losses.", min=0, max=2**63)
    ] = 0,
    force: Annotated[bool, typer.Option("--force", help="Overwrite logs that are there.")] = False,
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

    Raises
    ------
    SettingError
        If a flag contradicts the planned motion, or the duration is less than two samples.
    """
    from algid.errors import SettingError
    from algid.files import refuse_existing
    from algid.report.progress import progress
    from algid.synth.cases import load_case
    from algid.synth.follow import read_plan
    from algid.synth.run import EXCITATIONS, Recording, held, rehearse, synthesise, with_schedule
    from algid.synth.sensors import Sensors
    from algid.writers import write_log

    described = load_case(case)
    start_ns = 0 if start_time is None else _start_ns(start_time)
    sensors = Sensors(position_noise, torque_noise, encoder_bits, jitter, drop, seed, start_ns)
    roles = ("unloaded", "loaded") if described.payload else ("unloaded",)

    def refuse_existing_logs(roles: tuple[str, ...]) -> None:
        for role in roles:
            refuse_existing(out / f"{described.name}-{role}.{kind.value}", force)

    if motion is not None:
        for flag, value in (
            ("--initial", initial),
            ("--payload-schedule", payload_schedule),
            ("--torque", torque),
        ):
            if value is not None:
                raise SettingError(
                    f"{flag} {value}: a motion starts where it was planned and carries one payload; leave it out"
                )
        plan = read_plan(motion)
        _check_samples(rate, duration or plan.duration)
        refuse_existing_logs(roles)
        with progress("samples") as shown:
            logs = rehearse(
                described, plan, Recording(rate, duration or plan.duration, sensors=sensors), shown
            )
    else:
        recording = Recording(
            rate=rate, duration=1.0 if duration is None else duration, sensors=sensors
        )
        if initial is not None:
            recording = replace(recording, initial=_state(initial))
        _check_samples(rate, recording.duration)
        if round(rate * recording.duration) < 1:
            raise SettingError(
                f"--duration: expected at least {1 / rate:g} s, two samples at --rate {rate:g}, "
                f"found {recording.duration:g}"
            )
        named = "case" if torque is None else torque
        drive = _torque(described, named, torque_hold)
        if torque_hold is not Hold.EXACT and named in EXCITATIONS:
            drive = held(
                drive, rate, recording.duration, "zoh" if torque_hold is Hold.ZOH else "foh"
            )
        schedule = None if payload_schedule is None else _schedule(payload_schedule)
        refuse_existing_logs(roles if schedule is None else ("schedule",))
        with progress("samples") as shown:
            if schedule is None:
                logs = [*synthesise(described, drive, recording, shown)][: len(roles)]
            else:
                logs = [with_schedule(described, drive, recording, schedule, shown)]
    for log in logs:
        path = out / f"{log.origin.path}.{kind.value}"
        write_log(path, log, truth=log.origin.truth, kind=kind.value)
        say(str(path))


def _start_ns(start: datetime) -> int:
    """A date in ns since 1970, in UTC where it names no zone."""
    from algid.errors import SettingError

    found = start if start.tzinfo is not None else start.replace(tzinfo=UTC)
    if not FIRST_YEAR <= found.year <= LAST_YEAR:
        span = f"from {FIRST_YEAR} to {LAST_YEAR}"
        raise SettingError(f"--start-time: expected a date {span}, found {start.isoformat()}")
    return int(found.timestamp()) * 10**9


def _check_samples(rate: float, duration: float) -> None:
    from algid.errors import SettingError
    from algid.limits import PHYSICAL

    most = PHYSICAL.samples[1]
    if rate * duration > most:
        raise SettingError(
            f"--duration: {duration:g} s at --rate {rate:g} Hz are {rate * duration:.3g} samples; expected at most "
            f"{most:g}, more than a day at 1 kHz"
        )


def _schedule(text: str) -> list[tuple[float, float]]:
    """Times in s, increasing, and payloads in kg out of S=KG,…."""
    from algid.errors import SettingError
    from algid.limits import PHYSICAL

    try:
        schedule = [
            (float(time), float(mass))
            for time, mass in (part.split("=") for part in text.split(","))
        ]
    except ValueError:
        schedule = []
    times = [time for time, _ in schedule]
    increasing = all(earlier < later for earlier, later in pairwise(times))
    longest, heaviest = PHYSICAL.duration[1], PHYSICAL.mass[1]
    if not (
        schedule
        and increasing
        and all(0 <= time <= longest and 0 <= m <= heaviest for time, m in schedule)
    ):
        raise SettingError(
            f"--payload-schedule: expected increasing times and payloads of 0 or more like 2=0.05,4=0, found {text!r}"
        )
    return schedule


def _state(text: str) -> tuple[float, float, float, float]:
    """Two angles in rad and two velocities in rad/s out of θ1,θ2,ω1,ω2."""
    from algid.errors import SettingError
    from algid.limits import PHYSICAL

    try:
        first, second, third, fourth = (float(part) for part in text.split(","))
    except ValueError:
        first = second = third = fourth = math.nan
    if not math.isfinite(first + second + third + fourth):
        raise SettingError(f"--initial: expected four numbers like -1.57,0,0,0, found {text!r}")
    turned, fast = PHYSICAL.angle[1], PHYSICAL.speed[1]
    if max(abs(first), abs(second)) > turned or max(abs(third), abs(fourth)) > fast:
        raise SettingError(
            f"--initial: expected angles within {turned:g} rad and {fast:g} rad/s, found {text!r}"
        )
    return first, second, third, fourth


def _torque(case: Case, name: str, hold: Hold) -> Torque:
    """The excitation of that name, or the torque of the log at that path."""
    from algid.errors import SettingError
    from algid.readers import read_log
    from algid.synth.excitation import SampledTorque
    from algid.synth.run import EXCITATIONS, excitation

    if name in EXCITATIONS:
        return excitation(case, name)
    if not name or not Path(name).exists():
        raise SettingError(
            f"--torque {name}: expected {', '.join(EXCITATIONS)} or a log, found neither"
        )
    log = read_log(name)
    return SampledTorque(log.t, log.tau, "foh" if hold is Hold.FOH else "zoh")
