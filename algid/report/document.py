"""A report, whatever shows it: a verdict, then sections of tables, figures and sentences.

The reports of an identification, a track, a fleet, a design and a comparison are one `Document`
each. Terminal, Markdown and page set it, each in one way for all of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from algid.base.text import ABSENT
from algid.base.verdict import Verdict
from algid.report.arm import ArmDrawing
from algid.report.plot import Plot

Kind = Literal["name", "number", "text", "status"]
_SIZE = r"\d[\d.,]*(?:e[+-]?\d+)?"
NUMBER = re.compile(rf"[+\-−<]?{_SIZE}(?: ± (?:{_SIZE}|{ABSENT}))?")


@dataclass(frozen=True)
class Table:
    """A titled table of finished text.

    Parameters
    ----------
    title, rows
    columns : headings with " | " between; a terminal without room for all leaves out the last ones
    note : one line below it
    links : where the names of rows lead, which only a page shows
    """

    title: str
    columns: str
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    links: Mapping[str, str] | None = None

    def without_empty(self) -> Table:
        """The table less the columns that hold nothing."""
        if not self.rows:
            return self
        pairs = zip(self.columns.split(" | "), zip(*self.rows, strict=True), strict=True)
        full = [(heading, cells) for heading, cells in pairs if set(cells) - {ABSENT, ""}]
        headings, cells = zip(*full, strict=True)
        return replace(self, columns=" | ".join(headings), rows=tuple(zip(*cells, strict=True)))

    @property
    def heads(self) -> list[tuple[str, Kind]]:
        """Headings and kinds: the row's name, a status, a number where all cells are, or text."""
        heads = list[tuple[str, Kind]]()
        for place, heading in enumerate(self.columns.split(" | ")):
            cells = {row[place] for row in self.rows} - {ABSENT, ""}
            kind: Kind = "number" if all(map(NUMBER.fullmatch, cells)) else "text"
            heads.append((heading, "status" if heading == "Status" else kind if place else "name"))
        return heads


Content = Table | Plot | str | tuple[str, ...]
"""A sentence is text, a list of them a tuple."""


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
    content: tuple[Content, ...]
    folded: bool = False

    @property
    def shown(self) -> list[Content]:
        """The content less tables without a row and empty lists."""
        return [one for one in self.content if (one.rows if isinstance(one, Table) else one)]


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
    arm : the arm, drawn beside the first section
    """

    title: str
    verdict: Verdict
    sections: tuple[Section, ...]
    kicker: str = ""
    name: str = ""
    facts: str = ""
    made: str = ""
    arm: ArmDrawing | None = None

    @property
    def parts(self) -> list[Section]:
        """The sections that show something."""
        return [one for one in self.sections if one.shown]

    @property
    def plots(self) -> list[Plot]:
        """Its figures, from top to bottom."""
        return [one for part in self.sections for one in part.content if isinstance(one, Plot)]

    def tables(self, folded: bool = False) -> list[Table]:
        """The tables of the sections that are folded, or of those that are not."""
        every = [one for part in self.parts if part.folded == folded for one in part.shown]
        return [one for one in every if isinstance(one, Table)]
