"""The tables of a result's estimates: rows of finished text, which the terminal, Markdown and HTML merely set.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from algid.report.numbers import ABSENT, digits_of, interval, percent, resolved, significant
from algid.report.table import Column, Table
from algid.report.text import unit_text, visible
from algid.results import Estimate, Result, Table4Row

ESTIMATE_COLUMNS = (
    Column("Parameter", "name"),
    Column("Estimate", "number"),
    Column("± std", "number"),
    Column("± std, %", "number", rank=2),
    Column("Unit", "text"),
    Column("Status", "status"),
    Column("95 % interval", "number", rank=3),
    Column("Truth", "number", rank=1),
    Column("Error %", "number"),
    Column("Paper %", "number"),
)
TABLE4_COLUMNS = tuple(
    column for column in ESTIMATE_COLUMNS if column.kind != "status" and "interval" not in column.heading
)


def estimate_tables(result: Result) -> list[Table]:
    """What was identified: the arm, its payload, the paper's route to it, the loaded arm, Table 4."""
    groups = [
        ("Parameters", result.parameters),
        ("Payload", result.payload),
        ("Payload by the paper's route", result.paper_payload),
        ("Loaded arm", result.loaded),
    ]
    tables = [_estimates(title, group, result.table4) for title, group in groups if group]
    if any(row.truth is not None for row in result.table4):
        rows = tuple(_table4_row(row) for row in result.table4)
        note = "Names and order of the paper's Table 4; Paper % is the error it reports."
        tables.append(Table("Table 4", TABLE4_COLUMNS, rows, note).without_empty())
    return tables


def _estimates(title: str, group: Mapping[str, Estimate], table4: Iterable[Table4Row]) -> Table:
    known = {row.parameter: row for row in table4}
    rows = tuple(_estimate_row(name, estimate, known.get(name)) for name, estimate in group.items())
    return Table(title, ESTIMATE_COLUMNS, rows).without_empty()


def _estimate_row(name: str, found: Estimate, known: Table4Row | None) -> tuple[str, ...]:
    digits = digits_of(found.estimate, found.std)
    return (
        visible(name),
        resolved(found.estimate, found.std),
        significant(found.std, 2),
        percent(found.std, found.estimate),
        unit_text(found.unit),
        found.status.value,
        ABSENT if found.ci95 is None else interval(*found.ci95, found.std),
        *_against(_of_this(known, found), digits),
    )


def _table4_row(row: Table4Row) -> tuple[str, ...]:
    return (
        visible(row.parameter),
        resolved(row.estimate, row.std),
        significant(row.std, 2),
        percent(row.std, row.estimate),
        unit_text(row.unit),
        *_against(row, digits_of(row.estimate, row.std)),
    )


def _of_this(known: Table4Row | None, found: Estimate) -> Table4Row | None:
    """What is known of `found`: where Table 4 holds another estimate of the same name, the error is its own."""
    if known is None or known.estimate == found.estimate:
        return known
    if known.truth is None or found.estimate is None:
        return known.model_copy(update={"error_percent": None})
    error = 100 * abs(found.estimate - known.truth) / abs(known.truth) if known.truth else None
    return known.model_copy(update={"error_percent": error})


def _against(known: Table4Row | None, digits: int) -> tuple[str, str, str]:
    if known is None:
        return ABSENT, ABSENT, ABSENT
    return (
        significant(known.truth, max(digits, 5)),
        significant(known.error_percent, 4),
        significant(known.paper_error_percent, 4),
    )
