"""What a table of named columns, of any format, means, and its samples.

Columns are those that a profile names, the rest are known by their names. Rows that lack a value
are dropped and told, and the sums that algid wrote are checked.

float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are converted apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.arrow import whole_column
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.quantiles import median
from algid.base.units import ANGLE, CURRENT, NANOSECONDS, unit_of
from algid.log import SLOWEST, IntArray, Origin, Reading, add, word_sum
from algid.notices import Notice, Remedy
from algid.readers.annotations import lines_of, object_in, settings_unused, stated_rate, unused
from algid.readers.column_names import (
    COMMANDED,
    CURRENTS,
    choose,
    on_motor_side,
    other_joints,
    take_apart,
    time_among,
    words,
)
from algid.readers.convert import channel_readings, laws_of
from algid.readers.joints import moving_joints, reading_of
from algid.readers.log_reader import TableReader
from algid.readers.table import (
    JOINT_CHANNELS,
    REFERENCES,
    Clock,
    Offered,
    SampleTable,
    in_pairs,
)
from algid.readers.table_cells import (
    Cell,
    TableFile,
    cell_batches,
    cells_of,
    groups_in,
    units_of,
)

if TYPE_CHECKING:
    from algid.profile import Profile

INDEX = "__index_level_0__"
"""What pandas calls an index without a name where a frame becomes Arrow or Parquet."""
_AS_IN_A_PROFILE = words("zero second_angle drive passive signs offsets start end segment")
"""Of a reading."""


def offer_table(table: TableFile, profile: Profile) -> Offered:
    """The cells of a table's rows, and those of them that a profile or their names choose.

    Raises
    ------
    LogError
        If a column is missing, or stands there for more joints than two.
    """
    cells = cells_of(table)
    metadata = {
        key: text
        for key, text in table.metadata.items()
        if not (key in table.schema.names and object_in(text))  # of the column alone
    }
    gone = [name for name in table.companion.sums if name not in cells]
    if gone:
        raise LogError(
            f"the columns {', '.join(gone)} that were written are not there: the file was "
            "changed or damaged; write it again, or remove its truth if it was changed on purpose"
        )
    by_user = {name: profile.channel(name).column for name in profile.channels}
    by_user["t"] = profile.time
    index = cells.get(INDEX)
    if index and index.is_clock and not (profile.time or time_among(cells)):
        by_user["t"] = INDEX
    named = {name: column for name, column in by_user.items() if column}
    offered = Offered(
        table.kind,
        cells,
        named,
        partial(samples, table, cells),
        table.companion.truth,
        rows=table.rows or table.expected,
        units=units_of(table, cells),
        notices=(*table.notices, *groups_in(table)),
        said=(*table.said, *lines_of(metadata)),
        others=table.others,
    )
    for name, column in named.items():
        if column not in cells:
            raise LogError(
                f"{name} is to be taken from {column!r}, which is not there; "
                f"found {offered.listed()}; name another: {_naming([name])}"
            )
    try:
        choice = choose(cells, profile.joints, named, profile.passive, profile.needed)
    except LookupError as error:
        two = Remedy({"joints": None}, "choose two")
        raise LogError(f"{error}; {two}; or name each column: {_naming(['theta1'])} …") from error
    return replace(offered, chosen=choice.columns | named, joints=choice.joints)


def open_offered(path: str, offered: Offered, profile: Profile) -> TableReader:
    """A reader of what a log offers, as a profile, or the log itself, says what it means.

    Raises
    ------
    LogError
        If a channel has no source or that holds no numbers, a torque is in amperes without a torque
        constant, or an angle in counts without counts a turn.
    """
    fields = offered.fields
    sources = _sources(offered, profile)
    mapping = {"t": f"rows at {profile.rate or 0:g} Hz"}
    for name, source in sources.items():
        one = fields[source]
        mapping[name] = f"{one.topic}: {one.column}" if one.topic else source
        if not (one.is_number or (name == "t" and one.is_clock)):
            held = str(one.type).removeprefix("large_").removesuffix("_view")[:80]
            raise LogError(f"column {source!r} for {name} holds {held}; expected numbers")
    notices = list(offered.notices)
    named = all(profile.channel(name).column for name in profile.needed)
    reading = Reading(joints_told="profile" if named else "names")
    pair = [sources[name] for name in profile.needed[:2]]
    own = [one.joint for name, one in fields.items() if name in pair and one.joint]
    joints = (own[0], own[1]) if len(own) == 2 else offered.joints
    if profile.joints or (joints and not named):
        reading, order = reading_of(joints or (), profile)
        notices += order
    units, doubts = _units(offered, sources, profile)
    notices += doubts
    unit = profile.time_unit or unit_of(units.pop("t", ""))
    clock = Clock(unit, unit is not None)
    if "t" not in sources:  # any column has a cell in each row that is counted
        sources["t"], clock = sources[profile.needed[0]], Clock("ns", True, profile.rate)
    elif fields[sources["t"]].is_clock:
        clock = Clock("ns", True)
    elif unit is None and all(sources[name] == name for name in ("t", *profile.needed)):
        clock = Clock("s", False)  # algid's own names mean algid's own units
    angles = [sources[name] for name in ("theta1", "theta2") if name in sources]
    others, places = dict[str, str](), {"t": sources["t"]}
    for joint, source in other_joints(fields, angles).items():
        if fields[source].is_number and len(others) < LIMITS.other_joints:
            others[fields[source].joint or joint] = places[source] = source
    # of counts nobody knows how far they are
    angle = ANGLE.get(profile.channel("theta1").unit or units.get("theta1", "rad"))
    if angle and others:
        notices += moving_joints(others, partial(offered.tables, places, clock, []), angle)
    topics = dict.fromkeys(fields[source].topic for name, source in sources.items() if name != "t")
    channels = channel_readings(mapping, profile, units)
    reading = replace(
        reading,
        clock=offered.clock,
        time_unit=clock.unit if offered.clock == "column" else None,
        topics=tuple(filter(None, topics)),
        channels=channels,
        unwrap=(profile.theta1.unwrap, profile.theta2.unwrap),
        accepted=profile.accept,
        **{name: getattr(profile, name) for name in _AS_IN_A_PROFILE},
    )
    said = [line[: LIMITS.stated_letters] for line in offered.said[: LIMITS.stated_lines]]
    notices += unused(said, reading, profile)
    notices += settings_unused(profile, reading, mapping)
    origin = Origin(path, offered.kind, mapping, offered.truth, reading)
    tables, laws = partial(offered.tables, sources, clock), laws_of(profile)
    return TableReader(origin, tables, tuple(notices), offered.rows, stated_rate(said), laws)


def _sources(offered: Offered, profile: Profile) -> dict[str, str]:
    """By canonical channel the name of its field; of rows without a time there is no "t".

    Raises
    ------
    LogError
        If one is missing.
    """
    sources = dict(offered.chosen)
    if profile.passive and (driven := sources.get(f"tau{3 - profile.passive}")):
        # of a joint without a motor nothing is looked at
        sources.setdefault(f"tau{profile.passive}", driven)
    for reference, torque in zip(REFERENCES, ("tau1", "tau2"), strict=True):
        if getattr(profile, torque).q_des and torque in profile.channels:
            # what the controller follows makes the torque
            sources.setdefault(reference, sources[torque])
    sources = in_pairs(sources, profile.velocity)
    sources = {name: one for name, one in sources.items() if name in ("t", *profile.channels)}
    needed = profile.needed if profile.rate is not None else ("t", *profile.needed)
    missing = [name for name in needed if name not in sources]
    if missing:
        text = f"no column for {', '.join(missing)}; found {offered.listed()}; "
        text += f"name them: {_naming(missing)}"
        if "column 1" in offered.fields:  # there is no header
            named = Remedy({"columns": ["t", "theta1", "theta2", "tau1", "tau2"]})
            text += f", or all of them in their order, as {named}"
        if "t" in missing:
            rate = "; or give the samples a second of a log without a time"
            text += str(Remedy({"rate": None}, rate))
        if {"tau1", "tau2"} <= set(missing):
            text += str(Remedy({"torque_file": None}, "; or take them from another file"))
            text += (
                "; a PD law makes them of q_des, kp and kd of [tau1] and [tau2] (algid guide logs)"
            )
        raise LogError(text)
    return sources


def _naming(channels: Sequence[str]) -> Remedy:
    """Settings that name the columns of channels."""
    return Remedy({"time" if name == "t" else f"{name}.source": None for name in channels})


def _units(
    offered: Offered, sources: Mapping[str, str], profile: Profile
) -> tuple[dict[str, str], list[Notice]]:
    """By channel the unit that its column's name states, or else the file beside it.

    A current without one is in amperes. What is said: of commands, of units that file and user, or
    a name and its file, differ about, of motors' signals whose gear nobody tells. A user's word
    beats a file's.

    Raises
    ------
    LogError
        If motors' signals stand beside those of joints.
    """
    units, told = dict[str, str](), list[Notice]()
    if take_apart(sources.get("tau1", "")).stem in COMMANDED and profile.effort != "command":
        columns = f"{sources['tau1']}, {sources['tau2']}"
        told.append(Notice("COMMANDED_TORQUE", numbers={"columns": columns}))
    of_joints, of_motors = list[str](), list[str]()
    for name, column in sources.items():
        part, beside = take_apart(column), offered.units.get(column, "")
        current = name.startswith("tau") and part.stem in CURRENTS
        stated = part.unit or unit_of(beside) or beside
        if current and stated not in CURRENT and (not stated or unit_of(stated)):
            stated = "A"
        if stated:
            units[name] = stated
        user = profile.time_unit if name == "t" else profile.channel(name).unit
        unit, why = stated, "as configured"
        if not user:
            unit, why = unit_of(beside) or stated, "as its name says"
        if unit and unit != (taken := user or stated):
            numbers = {"case": "stated", "column": column, "name": name, "unit": unit}
            told.append(Notice("OTHER_UNIT", numbers={**numbers, "taken": taken, "why": why}))
        if name not in JOINT_CHANNELS:
            continue
        if offered.fields[column].topic or not on_motor_side(column):
            of_joints.append(name)
        elif not (current or "gear_ratio" in profile.channel(name).model_fields_set):
            of_motors.append(name)
    if not of_motors:
        return units, told
    named = ", ".join(f"{name} ({sources[name]})" for name in of_motors)
    gears = Remedy(
        {f"{name}.gear_ratio": None for name in of_motors},
        "tell the gear, turns of the motor in one of the joint, 1 for a direct drive",
    )
    if of_joints:
        raise LogError(f"{named}: signals of motors beside those of joints; {gears}")
    numbers = {"case": "motor", "columns": named}
    return units, [*told, Notice("OTHER_UNIT", numbers=numbers, remedies=(gears,))]


def samples(
    table: TableFile,
    cells: Mapping[str, Cell],
    sources: Mapping[str, str],
    clock: Clock,
    told: list[Notice],
) -> Iterator[SampleTable]:
    """The rows that have every value, with their stamps.

    Parameters
    ----------
    table : TableFile
    cells : mapping
        By name; the words of each column have the sums that were written with them.
    sources : mapping
        Cells by channel, the time's as "t".
    clock : Clock
    told : list of Notice
        At the end it has what is to be said of the other rows, too.

    Raises
    ------
    LogError
        If no row has every value, a time is no time, or the values are not those written.
    """
    unit, column, sums = clock.unit, sources["t"], table.companion.sums
    sources, time = {"t": column, **sources}, cells[column].type
    left = {name: sums[source] for name, source in sources.items() if source in sums}
    count = lost = done = 0
    for batch in cell_batches(table, cells, sources):
        whole = batch
        if any(values.null_count for values in batch.columns):
            whole = batch.drop_null()  # it imports what plain rows do without
        count += batch.num_rows
        lost += batch.num_rows - whole.num_rows
        channels = {name: whole_column(whole.column(name)) for name in sources}
        for name, values in channels.items():
            if name != "t" or not np.issubdtype(values.dtype, np.integer):
                with np.errstate(invalid="ignore"):  # damaged bytes may be a NaN that signals
                    channels[name] = values.astype(np.float64, copy=False)
        for name in left:
            left[name] = add(left[name], -word_sum(channels[name]))
        times = channels.pop("t")
        try:
            if unit is None and times.size:
                unit = time_unit(times)
                if unit != "s":
                    told.append(Notice("OTHER_UNIT", numbers={"case": "time", "unit": unit}))
            if clock.rate is None:
                stamps = to_nanoseconds(times, getattr(time, "unit", unit or "s"))
            else:
                stamps = np.rint((done + np.arange(times.size)) * (1e9 / clock.rate))
                stamps = stamps.astype(np.int64)
        except ValueError as error:
            raise LogError(f"{error} in column {column!r}, past row {done}") from error
        doubtful = unit and not (done or clock.stated)
        if doubtful and (step := _median_step(stamps - stamps[:1])) > 1e9 * SLOWEST:
            likely = _unit_of_step(step / NANOSECONDS[unit or "s"])
            numbers = {"case": "slow time", "column": column, "unit": unit, "rate": 1e9 / step}
            other = Remedy({"time_unit": likely}, f"if they are in {likely}")
            told.append(Notice("OTHER_UNIT", numbers=numbers, remedies=(other,)))
        done += times.size
        yield SampleTable(stamps, channels)
    if lost and lost == count:
        raise LogError(
            "no row has a value in every column that is needed; put the signals on common stamps"
        )
    if lost and clock.rate is not None:
        raise LogError(
            "rows lack a value, and without a time the rows behind them have none; "
            "fill the cells, or add a column of times"
        )
    if lost:
        numbers = {"case": "empty", "count": lost, "rows": count}
        told.append(Notice("NOT_FINITE", numbers=numbers))
    wrong = [name for name, rest in left.items() if rest]
    if wrong:
        raise LogError(
            f"the values of {', '.join(wrong)} are not those that were written: the file "
            "was changed or damaged; write it again, or remove its truth if it was changed on "
            "purpose"
        )


_EPOCH = (("s", 1e8, 1e11), ("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
_STEPS = (("s", 0.2), ("ms", 50.0), ("us", 50_000.0))


def time_unit(times: NDArray[Any]) -> str:
    """The unit of a time column (N,) nobody named one for: "s", "ms", "us" or "ns".

    Times since 1970 tell by their size, where that makes a median step of 20 µs to 10 s. Times
    since the start of a log tell by their median step, for logs between 20 Hz and 20 kHz: below
    0.2 it is seconds, below 50 ms, below 50,000 µs, else ns.

    Raises
    ------
    ValueError
        If a time is not finite.
    """
    if not np.all(np.isfinite(times)):
        raise ValueError("a time that is not finite")
    first, step = abs(float(times[0])), _median_step(times)
    for unit, low, high in _EPOCH:
        if low <= first < high and (step == 0 or 2e4 <= step * NANOSECONDS[unit] <= 1e10):
            return unit
    return _unit_of_step(step)


def _unit_of_step(step: float) -> str:
    return next((unit for unit, longest in _STEPS if step < longest), "ns")


def _median_step(times: NDArray[Any]) -> float:
    """Median size of the steps between times (N,) that differ; 0 where none do."""
    steps = np.abs(np.diff(times.astype(np.float64)))
    steps = steps[steps > 0]
    return median(steps) if steps.size else 0.0


def to_nanoseconds(times: NDArray[Any], unit: str) -> IntArray:
    """Times (N,) in `unit` as int64 ns, to the nearest; integers stay exact.

    Raises
    ------
    ValueError
        If a time is not finite, or out of the 292 years that int64 nanoseconds span.
    """
    factor = NANOSECONDS[unit]
    if not np.all(np.isfinite(times)):
        raise ValueError("a time that is not finite")
    furthest = max(abs(one.item()) for one in (times.min(), times.max())) if times.size else 0
    if furthest * factor > LIMITS.largest_time_ns:
        raise ValueError("a time beyond 292 years")
    if np.issubdtype(times.dtype, np.integer):
        return times.astype(np.int64, copy=False) * factor
    seconds = np.floor(times)
    return seconds.astype(np.int64) * factor + np.rint((times - seconds) * factor).astype(np.int64)
