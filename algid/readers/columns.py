"""The columns of a flat log, chosen by a profile and by their names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.log import Notice, Origin
from algid.readers.assemble import TableReader
from algid.readers.convert import conversion
from algid.readers.names import COMMANDED, CURRENTS, choose, take_apart
from algid.readers.table import CHANNELS, JOINT_CHANNELS, VELOCITIES, Table

if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class Columns:
    """By canonical channel its column; the units that names state; the unit of time, where known.

    `time_told`: a name or a profile states the unit of time; otherwise it is only taken to be so.
    """

    sources: Mapping[str, str]
    units: Mapping[str, str]
    time_unit: str | None
    notices: tuple[Notice, ...] = ()
    time_told: bool = False

    def reader(
        self,
        origin: Origin,
        tables: Callable[[int], Iterator[Table]],
        profile: Profile | None,
        rows: int,
    ) -> TableReader:
        """A reader of these columns out of `tables`; `rows` samples are to be expected."""
        unwrap = (profile.theta1.unwrap, profile.theta2.unwrap) if profile else (False, False)
        units = conversion(origin.path, profile, self.units)
        return TableReader(origin, tables, units, unwrap, self.notices, rows)


def assign(path: str, available: Sequence[str], profile: Profile | None) -> Columns:
    """Choose the columns of a flat log: those a profile names, the rest by their names.

    Raises
    ------
    LogError
        If a column is missing, or stands there for more joints than two.
    """
    try:
        choice = choose(available, profile.joints if profile else None)
    except LookupError as error:
        raise LogError(f'{path}: {error}; choose two with joints = ["…", "…"] in a profile') from error
    sources = dict(choice.columns) | _named(path, available, profile)
    if (profile and not profile.velocity) or not all(name in sources for name in VELOCITIES):
        sources = {name: column for name, column in sources.items() if name not in VELOCITIES}
    missing = [name for name in ("t", *JOINT_CHANNELS) if name not in sources]
    if missing:
        raise LogError(
            f"{path}: no column for {', '.join(missing)}; found {_listed(available)}; "
            "rename the columns or name them in a profile"
        )
    units = {name: unit for name, unit in choice.units.items() if sources.get(name) == choice.columns[name]}
    units |= _currents(sources)
    told = (profile.time_unit if profile else None) or units.get("t")
    if all(sources[name] == name for name in ("t", *JOINT_CHANNELS)):
        units.setdefault("t", "s")  # algid's own names mean algid's own units
    return Columns(sources, units, told or units.get("t"), _notices(sources), time_told=told is not None)


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
            raise LogError(f"{path}: the profile takes {name} from {column!r}; found {_listed(available)}")
    return named


def _currents(sources: Mapping[str, str]) -> dict[str, str]:
    return {name: "A" for name in ("tau1", "tau2") if take_apart(sources[name]).stem in CURRENTS}


def _notices(sources: Mapping[str, str]) -> tuple[Notice, ...]:
    if take_apart(sources["tau1"]).stem not in COMMANDED:
        return ()
    text = f"torques are commanded ones ({sources['tau1']}, {sources['tau2']}): no measured torque in the log"
    return (Notice("COMMANDED_TORQUE", text),)


def _listed(available: Sequence[str]) -> str:
    names = [repr(name[:40]) for name in available[:16]]
    return ", ".join(names) + (f" and {len(available) - 16} more" if len(available) > 16 else "")
