"""The tables of a result's estimates: rows of finished text, which the terminal, Markdown and HTML merely set.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Mapping

from algid.report.numbers import ABSENT, digits_of, interval, percent, resolved, significant
from algid.report.table import Column, Table
from algid.report.text import unit_text, visible
from algid.results import Estimate, Result, Table4Row, TorquePrediction

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
PREDICTION_COLUMNS = (
    Column("Torque predicted", "name"),
    Column("Joint", "text"),
    Column("RMSE, N m", "number"),
    Column("RMSE / RMS, %", "number"),
    Column("R²", "number"),
)


def estimate_tables(result: Result) -> list[Table]:
    """What was identified: the arm, its payload, the paper's route to it, the loaded arm, Table 4, how it predicts."""
    groups = [
        ("Parameters", result.parameters),
        ("Payload", result.payload),
        ("Payload by the paper's route", result.paper_payload),
        ("Loaded arm", result.loaded),
    ]
    tables = [_estimates(title, group, result) for title, group in groups if group]
    if any(row.truth is not None for row in result.table4):
        rows = tuple(_table4_row(row) for row in result.table4)
        note = "Names and order of the paper's Table 4; Paper % is the error it reports."
        tables.append(Table("Table 4", TABLE4_COLUMNS, rows, note).without_empty())
    prediction = _prediction(result)
    return [*tables, prediction] if prediction.rows else tables


def _prediction(result: Result) -> Table:
    """How well the model predicts the torque: of the logs used, and of each log by the others."""
    fit = result.fit
    pairs = [("logs used", fit.residual), ("each log by the others", fit.cross_validation)] if fit else []
    found = [(where, prediction) for where, prediction in pairs if prediction is not None]
    rows = tuple(row for where, prediction in found for row in _joints(where, prediction))
    notes = dict.fromkeys(visible(prediction.filter) for _, prediction in found)
    return Table("Torque prediction", PREDICTION_COLUMNS, rows, f"Filter: {'; '.join(notes)}.")


def _joints(where: str, found: TorquePrediction) -> list[tuple[str, ...]]:
    return [
        (
            where,
            str(joint + 1),
            significant(found.rmse[joint], 3),
            significant(100 * found.nrmse[joint], 3),
            f"{found.r2[joint]:.5f}",
        )
        for joint in range(2)
    ]


def _estimates(title: str, group: Mapping[str, Estimate], result: Result) -> Table:
    rows = tuple(_estimate_row(name, estimate, _known(name, estimate, result)) for name, estimate in group.items())
    return Table(title, ESTIMATE_COLUMNS, rows).without_empty()


def _known(name: str, found: Estimate, result: Result) -> Table4Row | None:
    """Truth and errors: Table 4's where it has the parameter, else (k5, k7, l1, l2) the truth alone."""
    row = next((row for row in result.table4 if row.parameter == name), None)
    if row is None and name in result.truth:
        row = Table4Row(parameter=name, unit=found.unit, estimate=None, truth=result.truth[name])
    return None if row is None else _of_this(row, found)


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
        *_against(known, digits),
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


def _of_this(known: Table4Row, found: Estimate) -> Table4Row:
    """What is known of `found`: where Table 4 holds another estimate of the same name, the error is its own."""
    if known.estimate == found.estimate:
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
