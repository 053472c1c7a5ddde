"""A module a verb: a function that Python calls, and what its command shows of what it gives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from algid.base.errors import Exit

if TYPE_CHECKING:
    from algid.report.document import Document, Table


class Manual(str):
    """Markdown, which a terminal shows as such."""


@dataclass(frozen=True)
class Answer:
    """What is printed, and the exit code.

    Parameters
    ----------
    shown : documents, tables and lines for standard output
    json : callable, or None
        Gives the same as the text of a JSON file.
    remarks : sequence of str
        Lines for standard error.
    complaints : sequence of str
        Lines for standard error that say what is wrong.
    exit : Exit
    """

    shown: Iterable[Document | Table | str] = ()
    json: Callable[[], str] | None = None
    remarks: Sequence[str] = ()
    complaints: Sequence[str] = ()
    exit: Exit = Exit.OK
