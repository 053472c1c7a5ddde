"""Synthetic logs of an arm, with the truth inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from algid.api.answer import Answer
from algid.api.given import numbers
from algid.api.options import Folder, Force, Seed, cases
from algid.api.signature import options_of, verb
from algid.base.errors import SettingError
from algid.base.files import refuse_existing, whole_file
from algid.base.limits import PHYSICAL
from algid.log import Log
from algid.options import Option, flag
from algid.synth import run
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors
from algid.writers import write_log

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.synth.cases import Case
    from algid.synth.excitation import Torque

FIRST_YEAR, LAST_YEAR = 1970, 2037
"""Of a log's start: the stamps in messages of ROS 2 end in January 2038."""
MOST = (PHYSICAL.angle[1], PHYSICAL.angle[1], PHYSICAL.speed[1], PHYSICAL.speed[1])
"""Of a state: angles in rad and velocities in rad/s."""

State = Sequence[float]
Noise = Annotated[float, Option(range=PHYSICAL.noise)]
Schedule = Sequence[tuple[float, float]]


@verb
def synthesise(
    case: Annotated[str | Path, Option(kind=str, suggested=cases)],
    *,
    duration: Annotated[float, Option(range=PHYSICAL.duration)] | None = None,
    rate: Annotated[float, Option(range=PHYSICAL.rate)] = 1000.0,
    torque: Annotated[str | Path | Log, Option(kind=str, suggested=lambda: [*run.EXCITATIONS])]
    | None = None,
    motion: str | Path | None = None,
    torque_hold: Literal["exact", "zoh", "foh"] = "exact",
    initial: State | str | None = None,
    sensors: Sensors | None = None,
    position_noise: Noise | None = None,
    torque_noise: Noise | None = None,
    encoder_bits: Annotated[int, Option(range=(4, 32))] | None = None,
    jitter: Noise | None = None,
    drop: Annotated[float, Option(range=(0, 0.9))] | None = None,
    seed: Seed | None = None,
    start_time: datetime | date | str | None = None,
    payload_schedule: Schedule | str | None = None,
    out: Folder | None = None,
    format: Literal["mcap", "parquet", "csv"] = "mcap",  # noqa: A002  # as the flag
    force: Force = False,
    progress: Progress | None = None,
) -> tuple[Log, Log]:
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
    own = locals()
    if case == "example":
        return _example(own)  # type: ignore[return-value]  # five
    arm = load_case(str(case))
    of_sensors = {one.name: own.get(one.name) for one in fields(Sensors)}
    measured = replace(
        sensors or Sensors(),
        **{name: value for name, value in of_sensors.items() if value is not None},
    )
    if start_time is not None:
        measured = replace(measured, start_ns=_start_ns(start_time))
    plan = None
    if motion is not None:
        from algid.synth.follow import read_plan

        for name in ("initial", "payload_schedule", "torque"):
            if own[name] is not None:
                raise SettingError(
                    f"{flag(name)} {own[name]}: a motion starts where it was planned and carries "
                    "one payload; leave it out"
                )
        plan = read_plan(Path(motion))
        duration = duration or plan.duration
    duration = duration or 1.0
    samples, (least, most) = round(rate * duration) + 1, PHYSICAL.samples
    if not least <= samples <= most:
        raise SettingError(
            f"{flag('duration')}: {duration:g} s at {flag('rate')} {rate:g} Hz are "
            f"{samples:.3g} samples; expected {least:g} to {most:g}"
        )
    recording = run.Acquisition(rate, duration, sensors=measured)
    if initial is not None:
        state = numbers("initial", initial, MOST, "four numbers like -1.57,0,0,0")
        recording = replace(recording, initial=state)
    drive = _drive(arm, "case" if torque is None else torque, torque_hold, recording)
    roles, schedule = ["unloaded", "loaded"][: 1 + bool(arm.payload)], None
    if payload_schedule is not None:
        roles, schedule = ["schedule"], _schedule(payload_schedule)
    files = _files(out, [f"{arm.name}-{role}.{format}" for role in roles], force)
    logs = run.synthesise(arm, plan or drive, recording, progress, schedule)
    for file, log in zip(files, logs, strict=False):
        write_log(file, log, truth=log.origin.truth, force=force)
    return tuple(logs)  # type: ignore[return-value]  # of a schedule one, as its docstring says


def answer(logs: Sequence[Log], given: Mapping[str, Any]) -> Answer:
    """The files."""
    names = [f"{log.origin.path}.{given['format']}" for log in logs]
    if given["case"] == "example":
        names = _example_names()
    return Answer(lambda: [str(Path(given["out"]) / name) for name in names])


def _example_names() -> list[str]:
    from algid.api.example import LOGS, PROFILE

    return [*(f"{name}.csv" for name in LOGS), PROFILE]


def _example(given: Mapping[str, Any]) -> tuple[Log, ...]:
    """The logs of `algid.api.example`, which are what they are."""
    from algid.api.example import PROFILE_TEXT, example_logs

    for name, one in options_of(synthesise).items():
        if name not in ("case", "out", "force") and given[name] not in (None, one.default):
            raise SettingError(f"{one.flag}: the example is always the same; leave it out")
    force = given["force"]
    files, logs = _files(given["out"], _example_names(), force), example_logs()
    for file, log in zip(files, logs, strict=False):
        write_log(file, log, force=force)
    for file in files[len(logs) :]:
        with whole_file(file, force=force) as temporary:
            temporary.write_text(PROFILE_TEXT, encoding="utf-8")
    return tuple(logs)


def _files(out: str | Path | None, names: Sequence[str], force: bool) -> list[Path]:
    """What is to be written, of which nothing is there yet; nothing where there is no `out`."""
    files = [] if out is None else [Path(out) / name for name in names]
    for file in files:
        refuse_existing(file, force)
    return files


def _start_ns(given: datetime | date | str) -> int:
    """A date in ns since 1970, in UTC where it names no zone."""
    with suppress(ValueError):
        start = datetime.fromisoformat(str(given))
        if FIRST_YEAR <= start.year <= LAST_YEAR:
            return int(start.replace(tzinfo=start.tzinfo or UTC).timestamp()) * 10**9
    raise SettingError(
        f"{flag('start_time')}: expected a date from {FIRST_YEAR} to {LAST_YEAR} like "
        f"2026-01-31T12:00:00, found {given!r:.60}"
    )


def _schedule(given: Schedule | str) -> list[tuple[float, float]]:
    """Times in s, increasing, and payloads in kg out of pairs, or of S=KG,…."""
    pairs: Any = given
    if isinstance(given, str):
        pairs = [part.split("=") for part in given.split(",")]
    longest, heaviest = PHYSICAL.duration[1], PHYSICAL.mass[1]
    with suppress(TypeError, ValueError):
        schedule = [(float(time), float(mass)) for time, mass in pairs]
        within = all(0 <= time <= longest and 0 <= mass <= heaviest for time, mass in schedule)
        times = [time for time, _ in schedule]
        if schedule and within and times == sorted(set(times)):
            return schedule
    raise SettingError(
        f"{flag('payload_schedule')}: expected increasing times and payloads of 0 or more like "
        f"2=0.05,4=0, found {given!r}"
    )


def _drive(case: Case, given: str | Path | Log, hold: Any, recording: run.Acquisition) -> Torque:
    """The excitation of that name, or the torque of a log, between whose samples it is held."""
    from algid.synth.excitation import SampledTorque

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
