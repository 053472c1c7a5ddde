"""The columns of a flat log, chosen by a profile and by their names, and the tables made of them.

What every flat format shares. float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are
converted apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.log import IntArray, Notice, Origin, Reading, Teller, Truth, add, word_sum
from algid.readers.assemble import TableReader, reader_of
from algid.readers.joints import along_the_arm, order_notice
from algid.readers.names import COMMANDED, CURRENTS, ChannelChoice, choose, on_motor_side, other_joints, take_apart
from algid.readers.others import moving_joints
from algid.readers.table import CHANNELS, JOINT_CHANNELS, VELOCITIES, SampleTable
from algid.units import ANGLE, CURRENT, NANOSECONDS, TORQUE, unit_of
from algid.words import counted

if TYPE_CHECKING:
    from algid.profile import Profile

_LOOKED = 1 << 14
"""Samples in which the joints that are not read are looked at."""


@dataclass(frozen=True)
class Columns:
    """By canonical channel its column; the units that names state; the unit of time, where known.

    `time_told`: a name or a profile states the unit of time; otherwise it is only taken to be so. `others` has by
    joint the column of its angle, of the joints that are not read.
    """

    sources: Mapping[str, str]
    units: Mapping[str, str]
    time_unit: str | None
    notices: tuple[Notice, ...] = ()
    time_told: bool = False
    joints: tuple[str, str] | None = None
    joints_told: Teller | None = None
    others: Mapping[str, str] = field(default_factory=dict)

    def reader(
        self, path: str, kind: str, truth: Truth | None, tables_of: TablesOf, profile: Profile | None, rows: int
    ) -> TableReader:
        """A reader of these columns out of the tables that are made of them; `rows` samples are to be expected.

        Raises
        ------
        LogError
            As `reader_of`.
        """
        decided = Reading(joints=self.joints, joints_told=self.joints_told, clock="column", time_unit=self.time_unit)
        origin = Origin(path, kind, dict(self.sources), truth, decided)
        unit = (profile.theta1.unit if profile else None) or self.units.get("theta1", "rad")
        others = self.others if unit in ANGLE else {}  # of counts nobody knows how far they are
        beside = moving_joints(
            others,
            lambda paths: tables_of(replace(self, sources={"t": self.sources["t"], **paths}))(_LOOKED),
            ANGLE.get(unit, 1.0),
        )
        return reader_of(origin, tables_of(self), profile, self.units, (*self.notices, *beside), rows)


TablesOf = Callable[[Columns], Callable[[int], Iterator[SampleTable]]]
"""Makes of columns what gives a fresh pass over a file in tables of so many rows."""


def assign(
    path: str, available: Sequence[str], profile: Profile | None, stated: Mapping[str, str] | None = None
) -> Columns:
    """Choose the columns of a flat log: those a profile names, the rest by their names.

    `stated` are units by column that the file tells elsewhere than in the columns' names.

    Raises
    ------
    LogError
        If a column is missing, or stands there for more joints than two.
    """
    named = _named(path, available, profile)
    try:
        choice = choose(available, profile.joints if profile else None, named, profile.passive if profile else None)
    except LookupError as error:
        raise LogError(
            f"{path}: {error}; choose two with --joints NAME,NAME, or name each column: --set theta1.source=NAME … "
            '(profile: joints = ["…", "…"], or source of [theta1] …)'
        ) from error
    sources = dict(choice.columns) | named
    if profile and profile.passive and f"tau{3 - profile.passive}" in sources:
        # a joint without a motor needs no torque of its own: what stands in its place is not looked at
        sources.setdefault(f"tau{profile.passive}", sources[f"tau{3 - profile.passive}"])
    if (profile and not profile.velocity) or not all(name in sources for name in VELOCITIES):
        sources = {name: column for name, column in sources.items() if name not in VELOCITIES}
    missing = [name for name in ("t", *JOINT_CHANNELS) if name not in sources]
    if missing:
        flags, lines = " ".join(map(_flag_for, missing)), "; ".join(map(_line_for, missing))
        told = f"{path}: no column for {', '.join(missing)}; found {_listed(available)}"
        raise LogError(f"{told}; name them: {flags} (profile: {lines})")
    units = {name: unit for name, unit in choice.units.items() if sources.get(name) == choice.columns[name]}
    beside = {name: (stated or {})[column] for name, column in sources.items() if column in (stated or {})}
    units = {name: known for name, unit in beside.items() if (known := unit_of(unit))} | units
    units |= {name: unit for name, unit in _currents(sources).items() if units.get(name) not in CURRENT}
    foreign = {name: unit for name, unit in choice.foreign.items() if sources.get(name) == choice.columns[name]}
    foreign |= {name: unit for name, unit in beside.items() if unit_of(unit) is None}
    said = [*_of_foreign_units(path, sources, foreign, profile), *_of_motors(path, sources, profile)]
    said += _of_other_units(sources, units, beside, profile)
    time_told = (profile.time_unit if profile else None) or units.get("t")
    if all(sources[name] == name for name in ("t", *JOINT_CHANNELS)):
        units.setdefault("t", "s")  # algid's own names mean algid's own units
    joints, by, order = _joints(choice, named, profile)
    return Columns(
        sources,
        units,
        time_told or units.get("t"),
        (*_notices(sources), *order, *said),
        time_told=time_told is not None,
        joints=joints,
        joints_told=by,
        others=other_joints(available, [sources["theta1"], sources["theta2"]]),
    )


def _flag_for(name: str) -> str:
    return f"--set {'time' if name == 't' else name + '.source'}=NAME"


def _line_for(name: str) -> str:
    return 'time = "NAME"' if name == "t" else f'source = "NAME" of [{name}]'


def _joints(
    choice: ChannelChoice, named: Mapping[str, str], profile: Profile | None
) -> tuple[tuple[str, str] | None, Teller, tuple[Notice, ...]]:
    """The joints, who said which is the first, and what to tell of it."""
    if profile is not None and profile.joints is not None:
        return profile.joints, profile.told_by("joints"), ()
    if all(name in named for name in JOINT_CHANNELS):
        return None, "profile", ()
    if choice.joints is None:
        return None, "names", ()
    chosen, told = along_the_arm(choice.joints)
    return chosen, told, order_notice(choice.joints, chosen, told)


def check_written(path: str, available: Sequence[str], sums: Mapping[str, int]) -> None:
    """Refuse a file that lacks a column which algid wrote into it.

    Raises
    ------
    LogError
        If the header was changed after writing.
    """
    missing = [name for name in sums if name not in available]
    if missing:
        raise LogError(
            f"{path}: the columns {', '.join(missing)} that were written are not there: the file was changed "
            "or damaged; write it again, or remove its truth if it was changed on purpose"
        )


def _named(path: str, available: Sequence[str], profile: Profile | None) -> dict[str, str]:
    if profile is None:
        return {}
    named = {name: source for name in CHANNELS if (source := profile.channel(name).source)}
    if profile.time:
        named["t"] = profile.time
    for name, column in named.items():
        if column not in available:
            raise LogError(
                f"{path}: {name} is to be taken from {column!r}, which is not there; found {_listed(available)}; name "
                f"another: {_flag_for(name)} (profile: {_line_for(name)})"
            )
    return named


def _currents(sources: Mapping[str, str]) -> dict[str, str]:
    return {name: "A" for name in ("tau1", "tau2") if take_apart(sources[name]).stem in CURRENTS}


def _notices(sources: Mapping[str, str]) -> tuple[Notice, ...]:
    if take_apart(sources["tau1"]).stem not in COMMANDED:
        return ()
    text = f"torques are commanded ones ({sources['tau1']}, {sources['tau2']}): no measured torque in the log"
    return (Notice("COMMANDED_TORQUE", text),)


def _of_foreign_units(
    path: str, sources: Mapping[str, str], foreign: Mapping[str, str], profile: Profile | None
) -> Iterator[Notice]:
    """What to say of units that no joint's signal has; they are refused unless the user names the right one."""
    for name, unit in foreign.items():
        if name not in CHANNELS:
            continue
        usual = "N m" if name.startswith("tau") else "rad"
        told = profile.channel(name).unit if profile else None
        if told is None:
            raise LogError(
                f"{path}: the column {sources[name]!r} for {name} is in {unit!r}, which is no unit of a joint; say its "
                f'unit if that is wrong: --set {name}.unit="{usual}" (profile: unit = "{usual}" of [{name}])'
            )
        text = f"the column {sources[name]!r} for {name} states the unit {unit!r}, and is taken for {told} as told"
        yield Notice("FOREIGN_UNIT", text)


def _of_other_units(
    sources: Mapping[str, str], units: Mapping[str, str], beside: Mapping[str, str], profile: Profile | None
) -> Iterator[Notice]:
    """What to say where a file states another unit than the user does, or another beside a name than in it."""
    for name, unit in units.items():
        told = (profile.time_unit if name == "t" else profile.channel(name).unit) if profile else None
        if told is not None and told != unit and not (told in TORQUE and unit in CURRENT):
            text = f"the file states the unit {unit} for {name} ({sources[name]!r}), which is taken for {told} as told"
            yield Notice("OTHER_UNIT", text)
        other = unit_of(beside.get(name, unit))
        if told is None and other is not None and other != unit:
            source = sources[name]
            text = f"the file states the unit {other} beside {name}; its name, {source!r}, says {unit}, which holds"
            yield Notice("OTHER_UNIT", text)


def _of_motors(path: str, sources: Mapping[str, str], profile: Profile | None) -> Iterator[Notice]:
    """What to say of motors' signals; beside joints' they are refused unless the user tells the gear."""
    motors = [name for name in JOINT_CHANNELS if on_motor_side(sources[name])]
    currents = _currents(sources)
    open_ones = [
        name
        for name in motors
        if name not in currents and not (profile and "gear_ratio" in profile.channel(name).model_fields_set)
    ]
    for name in currents:
        told = profile.channel(name).unit if profile else None
        if told in TORQUE:
            text = f"{sources[name]!r} for {name} is a current by its name, and is taken for a torque in {told} as told"
            yield Notice("CURRENT_AS_TORQUE", text)
    if not open_ones:
        return
    named = ", ".join(f"{name} ({sources[name]})" for name in open_ones)
    flags, lines = " ".join(f"--set {name}.gear_ratio=N" for name in open_ones), ", ".join(open_ones)
    mend = f"turns of the motor in one of the joint, 1 for a direct drive: {flags} (profile: gear_ratio of {lines})"
    if len({name in motors for name in JOINT_CHANNELS}) > 1:
        raise LogError(f"{path}: {named}: signals of motors beside those of joints; tell the gear, {mend}")
    yield Notice("MOTOR_SIDE", f"{named}: signals of motors, taken for those of joints; tell the gear, {mend}")


def _listed(available: Sequence[str]) -> str:
    names = [repr(name[:40]) for name in available[:16]]
    return ", ".join(names) + (f" and {len(available) - 16} more" if len(available) > 16 else "")


_EPOCH = (("s", 1e8, 1e11), ("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
_LARGEST = 9.2e18
_STEPS = (("s", 0.2), ("ms", 50.0), ("us", 50_000.0))
SLOWEST_NS = 200_000_000
"""A longer median step is no recording of an arm in motion: it has 5 Hz at least."""


def time_unit(times: NDArray[Any]) -> str:
    """The unit of a time column (N,) nobody named one for: "s", "ms", "us" or "ns".

    Times since 1970 tell by their size. Times since the start of a log tell by their median step, for logs
    between 20 Hz and 20 kHz: below 0.2 it is seconds, below 50 ms, below 50,000 µs, else ns.
    """
    first = abs(float(times[0]))
    for unit, low, high in _EPOCH:
        if low <= first < high and _plausible(times, NANOSECONDS[unit]):
            return unit
    return unit_of_step(median_step(times))


def unit_of_step(step: float) -> str:
    """The unit in which a median step is one of a log: see `time_unit`."""
    return next((unit for unit, longest in _STEPS if step < longest), "ns")


def median_step(times: NDArray[Any]) -> float:
    """Median size of the steps between times (N,) that differ; 0 where none do."""
    steps = np.abs(np.diff(times.astype(np.float64)))
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def _plausible(times: NDArray[Any], nanoseconds: int) -> bool:
    """Whether the median step is between 20 µs and 10 s in a unit of so many nanoseconds, if there is one."""
    step = median_step(times)
    return step == 0 or 2e4 <= step * nanoseconds <= 1e10


def to_nanoseconds(times: NDArray[Any], unit: str) -> IntArray:
    """Times (N,) in `unit` as int64 ns, to the nearest; integers stay exact.

    Raises
    ------
    ValueError
        If a time is not finite, or out of the 292 years that int64 nanoseconds span.
    """
    factor = NANOSECONDS[unit]
    if np.issubdtype(times.dtype, np.integer):
        if times.size and max(abs(int(times.min())), abs(int(times.max()))) * factor > _LARGEST:
            raise ValueError("a time beyond 292 years")
        whole_ns = times.astype(np.int64, copy=False)
        return whole_ns * factor if factor != 1 else whole_ns
    if not np.all(np.isfinite(times)):
        raise ValueError("a time that is not finite")
    if times.size and float(np.abs(times).max()) * factor > _LARGEST:
        raise ValueError("a time beyond 292 years")
    whole = np.floor(times)
    fraction = np.rint((times - whole) * factor)
    return whole.astype(np.int64) * factor + fraction.astype(np.int64)


if TYPE_CHECKING:
    import polars as pl


def tables(
    path: str, frames: Iterator[pl.DataFrame], columns: Columns, sums: Mapping[str, int]
) -> Iterator[SampleTable]:
    """Tables out of frames that hold one column a channel, and "t".

    Raises
    ------
    LogError
        If a value is missing, a time is no time, or the sums of the values are not the file's own.
    """
    expected = {name: sums[source] for name, source in columns.sources.items() if source in sums}
    unit, seen, done = columns.time_unit, dict.fromkeys(expected, 0), 0
    for frame, cut_off in _complete(path, frames):
        if frame.height == 0 and done:
            continue
        for name in seen:
            seen[name] = add(seen[name], word_sum(frame[name].to_numpy()))
        times = frame["t"].to_numpy()
        notices = list(cut_off)
        if unit is None:
            unit = _detected(path, times, notices)
        try:
            stamps = to_nanoseconds(times, unit)
        except ValueError as error:
            raise LogError(f"{path}: {error} in column {columns.sources['t']!r}, past row {done}") from error
        if not (done or columns.time_told):
            notices += _slow(columns.sources["t"], stamps, unit)
        channels = {name: frame[name].to_numpy() for name in frame.columns if name != "t"}
        done += frame.height
        yield SampleTable(stamps, channels, tuple(notices))
    _verify(path, seen, expected)


def _detected(path: str, times: NDArray[Any], notices: list[Notice]) -> str:
    if not np.all(np.isfinite(times)):
        raise LogError(f"{path}: a time is not finite; expected a number in every row")
    if times.size == 0:
        return "s"
    unit = time_unit(times)
    if unit != "s":
        notices.append(Notice("TIME_UNIT", f"times are taken for {unit}, from their size and their steps"))
    return unit


def _slow(column: str, stamps: IntArray, unit: str) -> list[Notice]:
    """What to say where nobody told the unit of time and samples are too far apart for an arm."""
    step = median_step(stamps - stamps[:1])
    if step <= SLOWEST_NS:
        return []
    likely = unit_of_step(step / NANOSECONDS[unit])
    text = (
        f"times in {column!r} are taken for {unit}, which makes {1e9 / step:.3g} Hz, too slow for an arm in motion; "
        f'if they are in {likely}: --set time_unit={likely} (profile: time_unit = "{likely}")'
    )
    return [Notice("SLOW_CLOCK", text)]


def _complete(path: str, frames: Iterator[pl.DataFrame]) -> Iterator[tuple[pl.DataFrame, tuple[Notice, ...]]]:
    """Frames without nulls: rows that lack a value are dropped and told of; the last row may break off."""
    rows, lost, held = 0, 0, None
    for frame in frames:
        if held is not None:
            yield held, ()
        rows += frame.height
        cut_off = bool(frame.height) and any(value is None for value in frame.row(-1))
        held = frame.drop_nulls() if any(frame.null_count().row(0)) else frame
        lost += frame.height - held.height
    if held is None:
        return
    if lost == 1 and cut_off:
        yield held, (Notice("CUT_OFF", "the last row breaks off and was dropped", lossy=True),)
    elif lost:
        if lost == rows:
            raise LogError(
                f"{path}: no row has a value in every column that is needed; put the signals on common stamps"
            )
        text = f"{lost} of {counted(rows, 'row')} dropped for want of a value"
        yield held, (Notice("EMPTY_CELLS", text, lossy=True),)
    else:
        yield held, ()


def _verify(path: str, seen: Mapping[str, int], expected: Mapping[str, int]) -> None:
    wrong = [name for name, total in seen.items() if total != expected[name]]
    if wrong:
        raise LogError(
            f"{path}: the values of {', '.join(wrong)} are not those that were written: the file was changed "
            "or damaged; write it again, or remove its truth if it was changed on purpose"
        )
