"""Synthetic logs of an arm, with the truth inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, date, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from algid.api import Answer
from algid.api.options import CASES, Folder, Seed, options_of, verb
from algid.base.errors import SettingError
from algid.base.files import refuse_existing
from algid.base.limits import PHYSICAL, within
from algid.log import Log
from algid.options import Option, flag
from algid.profile import parts_of
from algid.synth import run
from algid.synth.cases import load_case
from algid.synth.excitation import SampledTorque, Torque, wide_multi_sine
from algid.synth.follow import read_plan
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, simulate
from algid.writers import write_log

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.synth.cases import Case

FIRST, END = datetime(1970, 1, 1, tzinfo=UTC), datetime(2038, 1, 1, tzinfo=UTC)
"""Of a log's start: the stamps in messages of ROS 2 end in January 2038."""


def _moment(given: object) -> datetime:
    """A moment, in UTC where it names no zone."""
    start = datetime.fromisoformat(str(given))
    return start.replace(tzinfo=start.tzinfo or UTC)


def _pairs(given: Any) -> Any:
    """Pairs out of S=KG,…."""
    return [part.split("=") for part in given.split(",")] if isinstance(given, str) else given


_Angle = Annotated[float, within(PHYSICAL.angle)]
_Speed = Annotated[float, within(PHYSICAL.speed)]
_Time = Annotated[float, within((0, PHYSICAL.duration[1]))]
_Mass = Annotated[float, within((0, PHYSICAL.mass[1]))]
State = Annotated[
    Sequence[float] | str,
    Option(check=Annotated[tuple[_Angle, _Angle, _Speed, _Speed], BeforeValidator(parts_of)]),
]
Schedule = Annotated[
    Sequence[tuple[float, float]] | str,
    Option(check=Annotated[list[tuple[_Time, _Mass]], BeforeValidator(_pairs)]),
]
Moment = Annotated[
    datetime | date | str,
    Option(check=Annotated[datetime, Field(ge=FIRST, lt=END), BeforeValidator(_moment)]),
]
Noise = Annotated[float, within(PHYSICAL.noise)]

EXAMPLE = Path(__file__).with_name("example.toml")
"""The arm of the example logs, four runs with a real log's faults and one with a payload.

Its angles are zero where it hangs straight down, and its log does not say so; its joints have dry
friction, and its sensors noise and steps. What it truly is stands in none of the files.
"""
FRICTION = (0.4, 0.2)
"""N m of dry friction, which the motors overcome beside what moves the arm."""
SENSORS = Sensors(torque_noise=0.02, encoder_bits=14)
STRENGTH = 0.3
"""Of the torque that swings an arm round and round."""
RATE, DURATION, REST = 500.0, 10.0, np.zeros(2)
LOGS = ("run1", "run2", "run3", "run4", "loaded")


@verb
def synthesise(
    case: Annotated[str | Path, Option(kind=str, suggested=lambda: CASES)],
    *,
    duration: Annotated[float, within(PHYSICAL.duration)] | None = None,
    rate: Annotated[float, within(PHYSICAL.rate)] = 1000.0,
    torque: Annotated[str | Path | Log, Option(kind=str, suggested=lambda: run.EXCITATIONS)]
    | None = None,
    motion: str | Path | None = None,
    torque_hold: Literal["exact", "zoh", "foh"] = "exact",
    initial: State | None = None,
    sensors: Sensors | None = None,
    position_noise: Noise | None = None,
    torque_noise: Noise | None = None,
    encoder_bits: Annotated[int, within((4, 32))] | None = None,
    jitter: Noise | None = None,
    drop: Annotated[float, within((0, 0.9))] | None = None,
    seed: Seed | None = None,
    start_time: Moment | None = None,
    payload_schedule: Schedule | None = None,
    out: Folder | None = None,
    format: Literal["mcap", "parquet", "csv"] = "mcap",  # noqa: A002  # as the flag
    force: bool = False,
    progress: Progress | None = None,
) -> tuple[Log, Log]:
    """Write CASE-unloaded and CASE-loaded logs of a simulated arm; the truth travels with them.

    Velocities are in the logs only where angles are exact: with noise or an encoder the arm
    measures none. `example` writes four runs of a real-looking arm and one with a payload, for the
    guide's examples; its angles are zero where it hangs straight down, which no log says.

    Parameters
    ----------
    case : str
        case1, case2, example, or a TOML file that describes an arm.
    duration : float, s
        Length of each log, s; 1, or as long as the motion.
    rate : float, Hz
        Samples a second, Hz; 1000 by default.
    torque : 'case' (the default), 'wide', 'none', or a log whose torque is replayed
        case, wide (0.3 to 8 Hz), none, or a log to replay.
    motion : path
        Folder of a design to follow, instead of a torque.
    torque_hold : 'exact', 'zoh' or 'foh'
        Torque between samples: exact, zoh (held), foh (linear).
    initial : four float, rad and rad/s
        The state θ1,θ2,ω1,ω2 to start from; hanging at rest by default.
    sensors : Sensors
        All that follows down to `seed` as one value; none by default.
    position_noise : float, rad
        Noise of the angles, rad (standard deviation).
    torque_noise : float, N m
        Noise of the torques, N m (standard deviation).
    encoder_bits : int
        Round angles to 2π / 2^bits.
    jitter : float, s
        Jitter of the stamps, s (standard deviation).
    drop : float
        Share of samples lost at random.
    seed : int
        Seed of noise, jitter and losses.
    start_time : datetime
        When the log starts, UTC where it names no zone; stamps count from zero by default.
    payload_schedule : pairs of time in s and payload in kg
        One log, its payload changing: S=KG,…, like 2=0.05,4=0. Bare before the first time.
    out : Path
        Folder to write into. None writes nothing.
    format : 'mcap', 'parquet' or 'csv'
        Format of the logs: mcap, parquet or csv.
    force : bool
        Replace what is there.
    progress : callable
        Called as the simulation goes on.

    Returns
    -------
    tuple of Log
        Each of them with its truth; of an arm without payload, or of a schedule, one alone. The
        example's are five, without their truth.

    Raises
    ------
    SettingError
        If there is no such case, or a setting is wrong or contradicts another.
    OutputError
        If a log is there already and `force` is not set, or cannot be written.

    Examples
    --------
    $ algid synth case1 -o logs --position-noise 1e-3 --torque-noise 1e-2 --duration 10
    --torque wide

    >>> import algid
    >>> unloaded, loaded = algid.synthesise("case1", duration=2.0, torque="wide")
    >>> unloaded.theta.shape, loaded.origin.truth.payload
    ((2, 2001), 0.3515)
    """
    own, options, fixed, why = locals(), options_of(synthesise), set[str](), ""
    if case == "example":
        fixed, why = {*options} - {"case", "out", "force"}, "the example is always the same"
    elif motion is not None:
        fixed = {"initial", "payload_schedule", "torque"}
        why = "a motion starts where it was planned and carries one payload"
    for name in fixed:
        if own[name] not in (None, options[name].default):
            raise SettingError(f"{flag(name)}: {why}; leave it out")
    if case == "example":
        names, format, simulated = [*LOGS], "csv", example_logs  # noqa: A001
    else:
        arm, plan = load_case(str(case)), None if motion is None else read_plan(Path(motion))
        duration = duration or (1.0 if plan is None else plan.duration)
        moment: Any = start_time  # a datetime by now
        given = own | {"start_ns": moment and int(moment.timestamp()) * 10**9}
        of_sensors = {name: given[name] for name in vars(Sensors()) if given[name] is not None}
        measured = replace(sensors or Sensors(), **of_sensors)
        start: Any = initial or run.Acquisition.initial
        recording = run.Acquisition(rate, duration, start, measured)
        drive = plan or _drive(arm, "case" if torque is None else torque, torque_hold, recording)
        names = [f"{arm.name}-unloaded", f"{arm.name}-loaded"][: 1 + bool(arm.payload)]
        if payload_schedule is not None:
            names = [f"{arm.name}-schedule"]
        said: Any = (arm, drive, recording, progress, payload_schedule)
        simulated = partial(run.synthesise, *said)
    files = [] if out is None else [Path(out) / f"{name}.{format}" for name in names]
    for file in files:
        refuse_existing(file, force)
    logs = simulated()
    for file, log in zip(files, logs, strict=False):
        write_log(file, log, force=force)
    return tuple(logs)  # type: ignore[return-value]  # as many as its docstring says


def answer(logs: Sequence[Log], given: Mapping[str, Any]) -> Answer:
    """The files."""
    suffix = "csv" if given["case"] == "example" else given["format"]
    return Answer([str(Path(given["out"], f"{log.origin.path}.{suffix}")) for log in logs])


def _drive(case: Case, given: str | Path | Log, hold: Any, recording: run.Acquisition) -> Torque:
    """The excitation of that name, or the torque of a log, between whose samples it is held."""
    if isinstance(given, str) and given in run.EXCITATIONS:
        torque = run.excitation(case, given)
        if hold == "exact":
            return torque
        return run.held(torque, recording.rate, recording.duration, hold)
    if not isinstance(given, Log):
        from algid.readers import read_log

        if not str(given) or not Path(given).exists():
            raise SettingError(
                f"{flag('torque')} {given}: expected {', '.join(run.EXCITATIONS)} or a log, found "
                "neither"
            )
        given = read_log(given)
    return SampledTorque(given.t, given.tau, "foh" if hold == "foh" else "zoh")


def example_logs() -> list[Log]:
    """The runs ``run1`` to ``run4``, and ``loaded``: each its own motion, angles from hanging."""
    logs, case = [], load_case(str(EXAMPLE))
    for seed, name in enumerate(LOGS):
        sensors, strong = replace(SENSORS, seed=seed), wide_multi_sine(case.arm, seed=seed)
        k = case.constants(case.payload if name == "loaded" else 0.0)
        t = sample_times(RATE, DURATION, sensors)
        motion = simulate(k, lambda at: STRENGTH * strong(at), t, HANGING, REST)  # noqa: B023  # called at once
        tau = motion.tau + np.array(FRICTION)[:, None] * np.sign(motion.omega)
        log = record(replace(motion, tau=tau), sensors, None, name)
        logs.append(replace(log, theta=log.theta - HANGING[:, None]))
    return logs
