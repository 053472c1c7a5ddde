"""Estimates as they are printed: the one source of every table, line and page that shows them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from algid.base.text import ABSENT, digits_of, percent, resolved, significant, unit_text, visible
from algid.model import PARAMETERS

if TYPE_CHECKING:
    from algid.results import Estimate, Result

LEAST_ERROR = 0.01
"""Percent of the truth: a smaller error is said to be smaller."""


@dataclass(frozen=True)
class EstimateRow:
    """An estimate in finished text, every number as fine as its standard deviation.

    `half` is half the 95 % interval, `share` the same in percent of the estimate; `error` is the
    deviation from the `truth` in percent.
    """

    name: str
    value: str
    half: str
    unit: str
    status: str
    share: str
    truth: str
    error: str
    meaning: str

    @property
    def with_half(self) -> str:
        """The estimate and half its interval."""
        return ABSENT if self.value == ABSENT else f"{self.value} ± {self.half}"


def known_truth(result: Result) -> dict[str, float]:
    """What a synthetic log was made with, by parameter."""
    truth = {row.parameter: row.truth for row in result.table4 if row.truth is not None}
    return truth | result.truth


def rows_of(result: Result, estimates: Mapping[str, Estimate]) -> Iterator[EstimateRow]:
    """A row an estimate, in their order, beside the truth, where that is known."""
    known = known_truth(result)
    for name, found in estimates.items():
        value, half, error, truth = found.estimate, found.half, ABSENT, known.get(name)
        if value is not None and truth:
            off = 100 * (value - truth) / abs(truth)
            error = f"{off:+.2g}" if abs(off) >= LEAST_ERROR else f"<{LEAST_ERROR:g}"
        yield EstimateRow(
            name=visible(name),
            value=resolved(value, found.std),
            half=significant(half, 2),
            share=percent(half, value),
            unit=unit_text(found.unit),
            status=found.status.value,
            truth=significant(truth, max(digits_of(value, found.std), 5)),
            error=error,
            meaning=PARAMETERS[name].meaning if name in PARAMETERS else ABSENT,
        )
