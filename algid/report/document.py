"""What a report says, whatever shows it: a verdict, then sections of tables, figures and words.

The reports of an identification, a track, a fleet, a design and a comparison are one `Document`
each. Terminal, Markdown and page set it, each in one way for all of them; they choose nothing but
how deep they go (`Depth`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

from algid.report.arm import ArmDrawing
from algid.report.figures.base import Figure, Missing
from algid.text import ABSENT
from algid.verdict import Verdict

Kind = Literal["name", "number", "text", "status", "doubtful status"]
Fold = Literal["", "open", "closed"]


class Depth(IntEnum):
    """How deep a reader has to look for a table."""

    TERMINAL = 0
    """It stands in every format."""
    MARKDOWN = 1
    """A terminal has no room for it."""
    FOLDED = 2
    """Markdown folds it away: what was read, and how."""
    PAGE = 3
    """Only a page has it."""


@dataclass(frozen=True)
class Column:
    """Heading of a column and what it holds.

    a narrow terminal does without it, the highest `rank` first.

    A doubtful status belongs to a result that failed: not even OK is shown as good.
    """

    heading: str
    kind: Kind
    rank: int = 0


@dataclass(frozen=True)
class Drawn:
    """A column of drawings by the name of their row, after the column `after`, or last.

    `small` ones share a line.
    """

    heading: str
    rows: Mapping[str, str]
    after: str = ""
    small: bool = False


@dataclass(frozen=True)
class Table:
    """A titled table of finished text, foreign text made visible.

    Parameters
    ----------
    title, columns, rows
    note : one line below it
    depth : which formats show it
    drawn : columns of drawings, which only a page has
    links : where the names of rows lead, which only a page tells
    upright : what stands in its place where a terminal has no room for all of its columns
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    depth: Depth = Depth.TERMINAL
    drawn: tuple[Drawn, ...] = ()
    links: Mapping[str, str] | None = None
    upright: Table | None = None

    def at(self, depth: Depth) -> Table:
        """The table that deep."""
        return replace(self, depth=depth)

    def without_empty(self) -> Table:
        """The table less the columns that hold nothing."""
        kept = []
        for place in range(len(self.columns)):
            if any(row[place] not in (ABSENT, "") for row in self.rows):
                kept.append(place)
        return self.only(kept)

    def without(self, headings: Collection[str]) -> Table:
        """The table less the columns of those headings."""
        kept = []
        for place, column in enumerate(self.columns):
            if column.heading not in headings:
                kept.append(place)
        return self.only(kept)

    def doubted(self) -> Table:
        """The table as part of a result that failed."""
        columns = []
        for column in self.columns:
            if column.kind == "status":
                column = replace(column, kind="doubtful status")
            columns.append(column)
        return replace(self, columns=tuple(columns))

    def narrower(self) -> Table | None:
        """The table less the column that is missed least; None where all are needed."""
        ranks = [column.rank for column in self.columns]
        if max(ranks, default=0) == 0:
            return None
        kept = list(range(len(ranks)))
        kept.remove(ranks.index(max(ranks)))
        return self.only(kept)

    def only(self, kept: Sequence[int]) -> Table:
        """The table with the columns `kept`."""
        return replace(
            self,
            columns=tuple(self.columns[i] for i in kept),
            rows=tuple(tuple(row[i] for i in kept) for row in self.rows),
        )


@dataclass(frozen=True)
class ReadingAid:
    """A line that tells how to read what stands above it."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """Sentences as a list, or one that says that there is none."""

    sentences: tuple[str, ...]
    otherwise: str = ""


@dataclass(frozen=True)
class References:
    """Links by what they belong to: pairs of words and place.

    Beyond `most`, the rest is counted.
    """

    groups: Mapping[str, Sequence[tuple[str, str]]]
    most: int


Content = Table | Figure | Missing | ArmDrawing | ReadingAid | Bullets | References


@dataclass(frozen=True)
class Section:
    """A part of a report; nothing is shown of one without content.

    Parameters
    ----------
    content : from top to bottom; a terminal and Markdown show its tables alone
    key, title : its heading, which a page's contents lead to; without one they lead to its figures
    beside : an arm that stands beside the content where there is room
    fold : whether a page lets it be folded away, and how it stands at first
    listed : whether a page's contents lead to it; one of many parts alike is not
    """

    content: tuple[Content, ...] = ()
    key: str = ""
    title: str = ""
    beside: ArmDrawing | None = None
    fold: Fold = ""
    listed: bool = True


@dataclass(frozen=True)
class Document:
    """One report.

    Parameters
    ----------
    title : what it is, in one line
    verdict : how far to trust what it is about
    sections : in the order in which they are read
    kicker, name, facts : a page's head: kind of page, its subject, and identifying numbers
    made : what made it, the page's last line
    tab : the browser's title where `name` is not enough
    """

    title: str
    verdict: Verdict
    sections: tuple[Section, ...]
    kicker: str = ""
    name: str = ""
    facts: str = ""
    made: str = ""
    tab: str = ""

    def content(self) -> Iterator[Content]:
        """Everything in it, from top to bottom."""
        for section in self.sections:
            yield from section.content
            if section.beside is not None:
                yield section.beside

    def tables(self, *depths: Depth) -> list[Table]:
        """Its tables of those depths."""
        return [one for one in self.content() if isinstance(one, Table) and one.depth in depths]


def filled(*tables: Table) -> tuple[Table, ...]:
    """The tables that have a row."""
    return tuple(table for table in tables if table.rows)
