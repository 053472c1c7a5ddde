"""A report, whatever shows it: a verdict, then sections of tables, figures and sentences.

The reports of an identification, a track, a fleet, a design and a comparison are one `Document`
each. Terminal, Markdown and page set it, each in one way for all of them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from algid.base.text import ABSENT
from algid.notices import Verdict
from algid.report.plot import ArmDrawing, Panels

Kind = Literal["name", "number", "text", "status"]
_SIZE = r"\d[\d.,]*(?:e[+-]?\d+)?"
NUMBER = re.compile(rf"[+\-−<]?{_SIZE}(?: ± (?:{_SIZE}|{ABSENT}))?")


@dataclass(frozen=True)
class Table:
    """A titled table of finished text.

    Parameters
    ----------
    title, rows
    columns : headings with " | " between; one that holds nothing but dashes is not shown, and a
        terminal without room for all leaves out the last ones
    note : one line below it
    """

    title: str
    columns: str
    rows: Sequence[tuple[str, ...]]
    note: str = ""

    @property
    def heads(self) -> list[tuple[int, str, Kind]]:
        """Place, heading and kind of each column that holds something.

        The row's name, a status, a number where all cells are, or text.
        """
        heads = list[tuple[int, str, Kind]]()
        for place, heading in enumerate(self.columns.split(" | ")):
            cells = {row[place] for row in self.rows} - {ABSENT, ""}
            kind: Kind = "number" if all(map(NUMBER.fullmatch, cells)) else "text"
            kind = "status" if heading == "Status" else kind if place else "name"
            if cells:
                heads.append((place, heading, kind))
        return heads


Content = Table | Panels | str | Sequence[str] | None
"""A sentence is text; where there is nothing to show it is None."""


@dataclass(frozen=True)
class Section:
    """A part of a report; nothing is shown of one without content.

    Parameters
    ----------
    key, title : its heading, which a page's contents lead to; the first section has none
    content : from top to bottom; a terminal and Markdown show its tables alone
    folded : whether page and Markdown fold it away, and a terminal leaves it out
    """

    key: str
    title: str
    content: Sequence[Content]
    folded: bool = False

    @property
    def shown(self) -> list[Content]:
        """The content less tables without a row, and what is empty."""
        return [one for one in self.content if (one.rows if isinstance(one, Table) else one)]


@dataclass(frozen=True)
class Document:
    """One report.

    Parameters
    ----------
    verdict : how far to trust what it is about
    sections : in the order in which they are read
    kicker, name, facts : its head: what it is, its subject, and identifying numbers
    arm : the arm, drawn beside the first section
    """

    verdict: Verdict
    sections: Sequence[Section]
    kicker: str
    name: str
    facts: str = ""
    arm: ArmDrawing | None = None

    @property
    def parts(self) -> list[Section]:
        """The sections that show something."""
        return [one for one in self.sections if one.shown]

    @property
    def plots(self) -> list[Panels]:
        """Its figures, from top to bottom."""
        return [one for part in self.sections for one in part.content if isinstance(one, Panels)]

    def tables(self, folded: bool = False) -> list[Table]:
        """The tables of the sections that are folded, or of those that are not."""
        of = [part for part in self.sections if part.folded == folded]
        return [one for part in of for one in part.shown if isinstance(one, Table)]
