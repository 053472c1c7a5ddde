"""What a log offers, of whatever format: numbers by name, what is stated of them, its samples.

Samples are in the file's own units, not yet converted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.names import concatenated, rows_of
from algid.base.text import joined
from algid.log import IntArray, Truth
from algid.notices import Notice

if TYPE_CHECKING:
    from algid.readers.table_cells import Cell

JOINT_CHANNELS = ("theta1", "theta2", "tau1", "tau2")
VELOCITIES = ("omega1", "omega2")
REFERENCES = ("q_des1", "q_des2")
CHANNELS = JOINT_CHANNELS + VELOCITIES + REFERENCES


@contextmanager
def as_log_error(kind: str, mend: str = "copy it again") -> Iterator[None]:
    """Turn what a library raises about a file of some `kind` into a `LogError`.

    A `LogError` passes. A panic of polars is no Exception.

    Raises
    ------
    LogError
        If anything is raised within.
    """
    try:
        yield
    except LogError:
        raise
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = str(error).partition("\n")[0][:200]
        raise LogError(
            f"the {kind} file is damaged or not one that can be read "
            f"({type(error).__name__}: {reason}); {mend}"
        ) from error


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Successive samples: stamps (N,) in ns, channels (N,) by canonical name, file's units."""

    stamp_ns: IntArray
    columns: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    def part(self, first: int, last: int) -> SampleTable:
        """Rows `first` to `last` - 1 as views."""
        return self.take(slice(first, last))

    def take(self, rows: slice | IntArray | NDArray[np.bool_]) -> SampleTable:
        """The rows of a slice, an index or a mask."""
        return SampleTable(self.stamp_ns[rows], rows_of(self.columns, rows))

    def only(self, mask: NDArray[np.bool_]) -> SampleTable:
        """The rows of a mask: the table itself where that is all of them."""
        return self if mask.all() else self.take(mask)


def stack(tables: Sequence[SampleTable]) -> SampleTable:
    """One table out of several with the same channels, in their order."""
    if len(tables) == 1:
        return tables[0]
    stamps = np.concatenate([table.stamp_ns for table in tables])
    return SampleTable(stamps, concatenated([table.columns for table in tables]))


def cut(tables: Iterator[SampleTable], rows: int) -> Iterator[SampleTable]:
    """The same samples in tables of at most `rows` rows, none of which is empty."""
    for table in tables:
        for first in range(0, len(table), rows):
            yield table.part(first, min(first + rows, len(table)))


def in_pairs(sources: Mapping[str, str], velocity: str | None) -> dict[str, str]:
    """Sources by channel; velocities and references of both joints where they are read, or none."""
    gone = set[str]()
    for pair in (VELOCITIES, REFERENCES):
        if not sources.keys() >= set(pair) or (pair is VELOCITIES and velocity == "observer"):
            gone |= set(pair)
    return {name: one for name, one in sources.items() if name not in gone}


BLOCK_ROWS = 1 << 18
ROWS = 1 << 16
"""Rows a table: few enough to stay in a core's cache between decoding and copying."""
_LISTED = 16
"""Names that a message lists."""


class Clock(NamedTuple):
    """Unit of a time column, whether anybody states it, and rate in Hz of rows without a time."""

    unit: str | None
    stated: bool
    rate: float | None = None


@dataclass(frozen=True)
class TopicField:
    """A number in a topic's messages, by its path; `joint` is what they call the joint it is of.

    A time is of the messages themselves, or without a `topic` of their recorder.
    """

    column: str
    topic: str = ""
    joint: str = ""
    is_clock: bool = False
    is_number: ClassVar[bool] = True
    type: ClassVar[str] = "numbers"


@dataclass(frozen=True, eq=False)
class Offered:
    """What a log offers.

    Attributes
    ----------
    kind : str
        Its format.
    fields : mapping
        Its numbers and times by name.
    chosen : mapping
        By canonical channel the name that the user, or the names themselves, choose for it.
    tables : callable
        A fresh pass over some of the fields by channel, the time as "t": see `samples`.
    truth : Truth, optional
        What it tells of a simulated arm.
    clock : str
        Where its times are from, as in a `Reading`.
    joints : pair of str, optional
        The joints' own names that the columns' names show.
    rows : int
        Samples to expect, 0 where nobody knows.
    units : mapping
        By name the unit that is stated elsewhere than in the name.
    notices : tuple of Notice
        What is to be said of it.
    said : tuple of str
        What it states in words.
    others : tuple of str
        What else it holds, of another length.
    """

    kind: str
    fields: Mapping[str, Cell | TopicField]
    chosen: Mapping[str, str]
    tables: Callable[[Mapping[str, str], Clock, list[Notice]], Iterator[SampleTable]]
    truth: Truth | None
    clock: str = "column"
    joints: tuple[str, str] | None = None
    rows: int = 0
    units: Mapping[str, str] = field(default_factory=dict)
    notices: tuple[Notice, ...] = ()
    said: tuple[str, ...] = ()
    others: tuple[str, ...] = ()

    def listed(self) -> str:
        """The names, for a message."""
        listed = joined([repr(name[:40]) for name in self.fields], _LISTED)
        if self.others:
            others = ", ".join(self.others[:_LISTED])
            listed += f"; the log also holds, of another length: {others}"
        return listed
