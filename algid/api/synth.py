"""Synthetic logs of an arm, with the truth inside."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, overload

from algid.api.answer import Answer
from algid.api.given import parts_of
from algid.api.options import Folder, Force, cases
from algid.api.signature import check, keywords
from algid.base.errors import SettingError
from algid.base.files import refuse_existing
from algid.base.limits import PHYSICAL
from algid.log import Log
from algid.options import Option, flag
from algid.synth import run
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.synth.cases import Case
    from algid.synth.excitation import Torque

FIRST_YEAR, LAST_YEAR = 1970, 2037
"""Of a log's start: the stamps in messages of ROS 2 end in January 2038."""

State = Sequence[float]
Schedule = Sequence[tuple[float, float]]


@overload
def synthesise(
    case: str,
    *,
    duration: float | None = None,
    rate: float = 1000.0,
    excitation: str | Path | Log | None = None,
    motion: str | Path | None = None,
    torque_hold: Literal["exact", "zoh", "foh"] = "exact",
    initial: State | str | None = None,
    sensors: Sensors | None = None,
    position_noise: float | None = None,
    torque_noise: float | None = None,
    encoder_bits: int | None = None,
    jitter: float | None = None,
    drop: float | None = None,
    seed: int | None = None,
    start_time: datetime | None = None,
    payload_schedule: None = None,
    out: str | Path | None = None,
    kind: Literal["mcap", "parquet", "csv"] = "mcap",
    force: bool = False,
    progress: Progress | None = None,
) -> tuple[Log, Log]: ...
@overload
def synthesise(case: str, *, payload_schedule: Schedule | str, **options: Any) -> tuple[Log]: ...
def synthesise(  # type: ignore[misc]  # its options are the keywords of the other
    case: Annotated[str | Path, Option(kind=str, words=cases)],
    *,
    duration: Annotated[float, Option(range=PHYSICAL.duration)] | None = None,
    rate: Annotated[float, Option(range=PHYSICAL.rate)] = 1000.0,
    excitation: Annotated[
        str | Path | Log, Option(kind=str, flag="--torque", words=lambda: [*run.EXCITATIONS])
    ]
    | None = None,
    motion: str | Path | None = None,
    torque_hold: Literal["exact", "zoh", "foh"] = "exact",
    initial: Annotated[State | str, Option(kind=str)] | None = None,
    sensors: Sensors | None = None,
    position_noise: Annotated[float, Option(range=PHYSICAL.noise)] | None = None,
    torque_noise: Annotated[float, Option(range=PHYSICAL.noise)] | None = None,
    encoder_bits: Annotated[int, Option(range=(4, 32))] | None = None,
    jitter: Annotated[float, Option(range=PHYSICAL.noise)] | None = None,
    drop: Annotated[float, Option(range=(0, 0.9))] | None = None,
    seed: Annotated[int, Option(range=(0, 2**63))] | None = None,
    start_time: Annotated[datetime | date | str, Option(kind=str)] | None = None,
    payload_schedule: Annotated[Schedule | str, Option(kind=str)] | None = None,
    out: Folder | None = None,
    kind: Annotated[Literal["mcap", "parquet", "csv"], Option(flag="--format")] = "mcap",
    force: Force = False,
    progress: Progress | None = None,
) -> tuple[Log, ...]:
    """Write CASE-unloaded and CASE-loaded logs of a simulated arm; the truth travels with them.

    Velocities are in the logs only where angles are exact: with noise or an encoder the arm
    measures none. `example` writes four runs of a real-looking arm, one with a payload and their
    profile, for the guide's examples.

    Parameters
    ----------
    case : str
        case1, case2, example, or a TOML file that describes an arm.
    duration : float, s
        Length of each log, s; 1, or as long as the motion.
    rate : float, Hz
        Samples a second, Hz; 1000 by default.
    excitation : 'case' (the default), 'wide', 'none', or a log whose torque is replayed
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
    kind : 'mcap', 'parquet' or 'csv'
        Format of the logs: mcap, parquet or csv.
    force : bool
        Replace what is there.
    progress : callable
        Called as the simulation goes on.

    Returns
    -------
    tuple of Log
        Each of them with its truth; of an arm without payload the first alone. The example's are
        five, without their truth.

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
    >>> unloaded, loaded = algid.synthesise("case1", duration=2.0, excitation="wide")
    >>> unloaded.theta.shape, loaded.origin.truth.payload
    ((2, 2001), 0.3515)
    """
    own = locals()
    check(synthesise, own)
    if case == "example":
        return _example(own)
    sensed = ("position_noise", "torque_noise", "encoder_bits", "jitter", "drop", "seed")
    given = {name: own[name] for name in sensed}
    described = load_case(str(case))
    wished = {name: value for name, value in given.items() if value is not None}
    measured = replace(sensors or Sensors(), **wished)
    if start_time is not None:
        measured = replace(measured, start_ns=_start_ns(start_time))
    asked = _Asked(described, rate, duration, measured, _Files(out, kind, force), progress)
    if motion is not None:
        _refuse_beside_motion(initial, payload_schedule, excitation)
        logs = _followed(asked, Path(motion))
    else:
        logs = _driven(asked, excitation, torque_hold, initial, payload_schedule)
    asked.files.write(logs)
    return tuple(logs)


def answer(logs: Sequence[Log], given: Mapping[str, Any]) -> Answer:
    """The files."""
    from algid.api.example import PROFILE

    names = [f"{log.origin.path}.{given['kind']}" for log in logs]
    if given["case"] == "example":
        names = [*(f"{log.origin.path}.csv" for log in logs), PROFILE]
    return Answer(lambda: [str(Path(given["out"]) / name) for name in names])


def _example(given: Mapping[str, Any]) -> tuple[Log, ...]:
    """The logs of `algid.api.example`, which are what they are."""
    from algid.api.example import example_logs, write_example

    for name, one in keywords(synthesise).items():
        default = inspect.signature(synthesise).parameters[name].default
        if name not in ("case", "out", "force") and given[name] not in (None, default):
            raise SettingError(f"{one.flag}: the example is always the same; leave it out")
    logs = example_logs()
    if given["out"] is not None:
        write_example(given["out"], logs, given["force"])
    return tuple(logs)


@dataclass(frozen=True)
class _Files:
    """Where logs are written, if anywhere."""

    out: str | Path | None
    kind: str
    force: bool

    def path(self, name: str) -> Path:
        return Path(self.out or "") / f"{name}.{self.kind}"

    def refuse_existing(self, case: Case, roles: Sequence[str]) -> None:
        if self.out is None:
            return
        for role in roles:
            refuse_existing(self.path(f"{case.name}-{role}"), self.force)

    def write(self, logs: Sequence[Log]) -> None:
        if self.out is None:
            return
        from algid.writers import write_log

        for log in logs:
            path = self.path(log.origin.path)
            write_log(path, log, truth=log.origin.truth, kind=self.kind, force=self.force)


@dataclass(frozen=True)
class _Asked:
    """What every way to a log needs."""

    case: Case
    rate: float
    duration: float | None
    sensors: Sensors
    files: _Files
    progress: Progress | None

    @property
    def roles(self) -> tuple[str, ...]:
        if self.case.payload:
            return "unloaded", "loaded"
        return ("unloaded",)

    def recording(self, duration: float) -> run.Acquisition:
        """How it is recorded; raises `SettingError` for fewer than two samples, or too many."""
        most = PHYSICAL.samples[1]
        if self.rate * duration > most:
            raise SettingError(
                f"{flag('duration')}: {duration:g} s at {flag('rate')} {self.rate:g} Hz are "
                f"{self.rate * duration:.3g} samples; expected at most {most:g}, more than a day "
                "at 1 kHz"
            )
        if round(self.rate * duration) < 1:
            raise SettingError(
                f"{flag('duration')}: expected at least {1 / self.rate:g} s, two samples at "
                f"{flag('rate')} {self.rate:g}, found {duration:g}"
            )
        return run.Acquisition(self.rate, duration, sensors=self.sensors)


def _refuse_beside_motion(initial: object, schedule: object, excitation: object) -> None:
    given = {
        "initial": initial,
        "payload_schedule": schedule,
        "torque": excitation,
    }
    for option, value in given.items():
        if value is not None:
            raise SettingError(
                f"{flag(option)} {value}: a motion starts where it was planned and carries one "
                "payload; leave it out"
            )


def _followed(asked: _Asked, motion: Path) -> list[Log]:
    """The logs of a controller that follows a plan."""
    from algid.synth.follow import read_plan

    plan = read_plan(motion)
    recording = asked.recording(asked.duration or plan.duration)
    asked.files.refuse_existing(asked.case, asked.roles)
    return run.rehearse(asked.case, plan, recording, asked.progress)


def _driven(
    asked: _Asked,
    excitation: str | Path | Log | None,
    hold: str,
    initial: State | str | None,
    payload_schedule: Schedule | str | None,
) -> list[Log]:
    """The logs of an arm under a torque."""
    duration = asked.duration
    if duration is None:
        duration = 1.0
    recording = asked.recording(duration)
    if initial is not None:
        recording = replace(recording, initial=_state(initial))
    if excitation is None:
        excitation = "case"
    drive = _torque(asked.case, excitation, hold)
    if excitation in run.EXCITATIONS and hold == "zoh":
        drive = run.held(drive, asked.rate, recording.duration, "zoh")
    elif excitation in run.EXCITATIONS and hold == "foh":
        drive = run.held(drive, asked.rate, recording.duration, "foh")
    if payload_schedule is not None:
        schedule = _schedule(payload_schedule)
        asked.files.refuse_existing(asked.case, ("schedule",))
        return [run.with_schedule(asked.case, drive, recording, schedule, asked.progress)]
    asked.files.refuse_existing(asked.case, asked.roles)
    logs = run.synthesise(asked.case, drive, recording, asked.progress)
    return list(logs)[: len(asked.roles)]


def _start_ns(given: datetime | date | str) -> int:
    """A date in ns since 1970, in UTC where it names no zone."""
    try:
        start = datetime.fromisoformat(str(given))
    except ValueError:
        raise SettingError(
            f"{flag('start_time')}: expected a date like 2026-01-31T12:00:00, found {given!r:.60}"
        ) from None
    if not FIRST_YEAR <= start.year <= LAST_YEAR:
        span = f"from {FIRST_YEAR} to {LAST_YEAR}"
        raise SettingError(
            f"{flag('start_time')}: expected a date {span}, found {start.isoformat()}"
        )
    if start.tzinfo is None:
        start = start.replace(tzinfo=UTC)
    return int(start.timestamp()) * 10**9


def _schedule(given: Schedule | str) -> list[tuple[float, float]]:
    """Times in s, increasing, and payloads in kg out of pairs, or of S=KG,…."""
    pairs: Sequence[Sequence[float | str]] | Schedule = given
    if isinstance(given, str):
        pairs = [part.split("=") for part in given.split(",")]
    try:
        schedule = [(float(time), float(mass)) for time, mass in pairs]
    except (TypeError, ValueError):
        schedule = []
    if not _is_schedule(schedule):
        raise SettingError(
            f"{flag('payload_schedule')}: expected increasing times and payloads of 0 or more like "
            f"2=0.05,4=0, found {given!r}"
        )
    return schedule


def _is_schedule(schedule: Sequence[tuple[float, float]]) -> bool:
    """Whether times increase, and times and payloads are such as a log and an arm may have."""
    longest, heaviest = PHYSICAL.duration[1], PHYSICAL.mass[1]
    before = -math.inf
    for time, mass in schedule:
        if not (before < time and 0 <= time <= longest and 0 <= mass <= heaviest):
            return False
        before = time
    return bool(schedule)


def _state(given: State | str) -> tuple[float, float, float, float]:
    """Two angles in rad and two velocities in rad/s out of four numbers, or of θ1,θ2,ω1,ω2."""
    try:
        first, second, third, fourth = (float(part) for part in parts_of(given))
    except (TypeError, ValueError):
        first = second = third = fourth = math.nan
    if not math.isfinite(first + second + third + fourth):
        raise SettingError(
            f"{flag('initial')}: expected four numbers like -1.57,0,0,0, found {given!r}"
        )
    turned, fast = PHYSICAL.angle[1], PHYSICAL.speed[1]
    if max(abs(first), abs(second)) > turned or max(abs(third), abs(fourth)) > fast:
        raise SettingError(
            f"{flag('initial')}: expected angles within {turned:g} rad and {fast:g} rad/s, found "
            f"{given!r}"
        )
    return first, second, third, fourth


def _torque(case: Case, given: str | Path | Log, hold: str) -> Torque:
    """The excitation of that name, or the torque of a log."""
    from algid.synth.excitation import SampledTorque

    if isinstance(given, str) and given in run.EXCITATIONS:
        return run.excitation(case, given)
    if not isinstance(given, Log):
        from algid.readers import read_log

        if not str(given) or not Path(given).exists():
            raise SettingError(
                f"{flag('torque')} {given}: expected {', '.join(run.EXCITATIONS)} or a log, found "
                "neither"
            )
        given = read_log(given)
    if hold == "foh":
        return SampledTorque(given.t, given.tau, "foh")
    return SampledTorque(given.t, given.tau, "zoh")
