"""How far to trust a report: a grade, a headline, its reasons, and what to run first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from algid.notices import Notice, codes_of

Grade = Literal["good", "reservations", "failed"]
GRADE_WORDS: dict[Grade, str] = {
    "good": "Good",
    "reservations": "With reservations",
    "failed": "Failed",
}
MOST_REASONS = 3
"""Reasons that a terminal or a page shows at first."""


@dataclass(frozen=True)
class Verdict:
    """A judgement.

    Parameters
    ----------
    grade : 'good', 'reservations' or 'failed'
    headline : what there is to say in one clause
    reasons : what makes it doubtful, the weightiest first
    notes : what was seen of the data and is no reason to doubt it
    command : what to run first, to mend it or to find out
    """

    grade: Grade
    headline: str
    reasons: tuple[Notice, ...] = ()
    notes: tuple[Notice, ...] = ()
    command: str | None = None

    def __repr__(self) -> str:
        codes = ", ".join(codes_of(self.reasons)) or "none"
        return f"Verdict({self.grade!r}, {self.headline!r}, reasons: {codes})"

    @property
    def word(self) -> str:
        """The word of its grade."""
        return GRADE_WORDS[self.grade]

    @property
    def sentence(self) -> str:
        """Grade and headline, and where it is usable with reservations the first of them."""
        if self.grade == "reservations" and self.reasons:
            return f"{self.word}: {self.headline}, but {self.reasons[0].text}."
        return f"{self.word}: {self.headline}."

    @property
    def failed(self) -> bool:
        """Whether what it is about must not be used."""
        return self.grade == "failed"


def graded(
    headline: str,
    reasons: Sequence[Notice] = (),
    notes: Sequence[Notice] = (),
    *,
    failure: str | None = None,
    things: str = "numbers",
    command: str | None = None,
) -> Verdict:
    """The verdict on `headline`: failed on a `failure`, after which `things` must not be used."""
    grade: Grade = "good"
    if failure is not None:
        grade, headline = "failed", f"{failure}; do not use these {things}"
    elif reasons:
        grade = "reservations"
    return Verdict(grade, headline, tuple(reasons), tuple(notes), command)
