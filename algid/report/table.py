"""A table of finished text: what every format sets, and none changes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

from algid.report.text import ABSENT

Kind = Literal["name", "number", "text", "status", "doubtful status"]


@dataclass(frozen=True)
class Column:
    """Heading of a column and what it holds; a narrow terminal does without it, the highest `rank` first.

    A doubtful status belongs to a result that failed: not even OK is shown as good.
    """

    heading: str
    kind: Kind
    rank: int = 0


@dataclass(frozen=True)
class Table:
    """A titled table of finished text, foreign text made visible; `note` is one line below it."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def without_empty(self) -> Table:
        """The table less the columns that hold nothing."""
        kept = [i for i, _ in enumerate(self.columns) if any(row[i] not in (ABSENT, "") for row in self.rows)]
        return self.only(kept)

    def without(self, headings: Collection[str]) -> Table:
        """The table less the columns of those headings."""
        return self.only([place for place, column in enumerate(self.columns) if column.heading not in headings])

    def doubted(self) -> Table:
        """The table as part of a result that failed."""
        kinds = [replace(c, kind="doubtful status") if c.kind == "status" else c for c in self.columns]
        return replace(self, columns=tuple(kinds))

    @property
    def most_missed(self) -> bool:
        """Whether no column is left whose rank is above 1."""
        return all(column.rank <= 1 for column in self.columns)

    def narrower(self) -> Table | None:
        """The table less the column that is missed least; None where all are needed."""
        least = max(range(len(self.columns)), key=lambda i: self.columns[i].rank, default=None)
        if least is None or self.columns[least].rank == 0:
            return None
        return self.only([i for i in range(len(self.columns)) if i != least])

    def only(self, kept: list[int]) -> Table:
        """The table with the columns `kept`."""
        return replace(
            self,
            columns=tuple(self.columns[i] for i in kept),
            rows=tuple(tuple(row[i] for i in kept) for row in self.rows),
        )
