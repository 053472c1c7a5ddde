"""What a log offers, of whatever format: numbers by name, what is stated of them, its samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from algid.log import Truth
from algid.notices import Notice
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    from algid.readers.table_cells import Cell

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
    path, kind : str
        What messages call it, and its format.
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

    path: str
    kind: str
    fields: Mapping[str, Cell | TopicField]
    chosen: Mapping[str, str]
    tables: Callable[[Mapping[str, str], Clock, list[Notice], int | None], Iterator[SampleTable]]
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
        names = list(self.fields)
        listed = ", ".join(repr(name[:40]) for name in names[:_LISTED])
        if len(names) > _LISTED:
            listed += f" and {len(names) - _LISTED} more"
        if self.others:
            others = ", ".join(self.others[:_LISTED])
            listed += f"; the log also holds, of another length: {others}"
        return listed
