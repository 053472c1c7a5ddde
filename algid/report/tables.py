"""The tables of a result: rows of finished text, which the terminal, Markdown and HTML merely set.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from algid.report.numbers import ABSENT, digits_of, interval, percent, resolved, significant
from algid.report.text import file_name, unit_text, visible
from algid.results import Estimate, LogSummary, Result, Table4Row, TorquePrediction

Kind = Literal["name", "number", "text", "status"]


@dataclass(frozen=True)
class Column:
    """Heading of a column and what it holds; a narrow terminal does without it, the highest `rank` first."""

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
        """This table less the columns that hold nothing."""
        kept = [i for i, _ in enumerate(self.columns) if any(row[i] not in (ABSENT, "") for row in self.rows)]
        return self.only(kept)

    def narrower(self) -> Table | None:
        """This table less the column that is missed least; None where all are needed."""
        least = max(range(len(self.columns)), key=lambda i: self.columns[i].rank, default=None)
        if least is None or self.columns[least].rank == 0:
            return None
        return self.only([i for i in range(len(self.columns)) if i != least])

    def only(self, kept: list[int]) -> Table:
        """This table with the columns `kept`."""
        return replace(
            self,
            columns=tuple(self.columns[i] for i in kept),
            rows=tuple(tuple(row[i] for i in kept) for row in self.rows),
        )


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


def fit_tables(result: Result) -> list[Table]:
    """What a statistical estimator knows beside the estimates: noise, residual, terms, bounds."""
    if result.fit is None:
        return []
    tables = [_noise(result), _whiteness(result), _prediction(result), _terms(result), _bounds(result)]
    return [table for table in tables if table.rows]


def _noise(result: Result) -> Table:
    assert result.fit is not None
    units = {"theta1": "rad", "theta2": "rad", "tau1": "N m", "tau2": "N m"}
    rows = tuple((visible(n), significant(std, 3), units.get(n, ABSENT)) for n, std in result.fit.noise.items())
    columns = (Column("Signal", "name"), Column("Noise, std", "number"), Column("Unit", "text"))
    return Table("Noise that the logs carry", columns, rows)


def _whiteness(result: Result) -> Table:
    assert result.fit is not None
    rows = tuple(
        (visible(name), "yes" if test.white else "no", significant(test.p_value, 2), f"{test.lag1_correlation:.3f}")
        for name, test in result.fit.whiteness.items()
    )
    columns = (
        Column("Residual", "name"),
        Column("White", "text"),
        Column("p-value", "number"),
        Column("Lag-one correlation", "number"),
    )
    how = {
        "likelihood": "the likelihood, which takes it to be white",
        "sandwich": "a sandwich, which lets it be coloured",
    }
    note = f"The intervals rest on {how[result.fit.intervals]}."
    return Table("Whiteness of the residual", columns, rows, note).without_empty()


def _prediction(result: Result) -> Table:
    assert result.fit is not None
    found = [("on the logs used", result.fit.residual), ("each log left out in turn", result.fit.cross_validation)]
    rows = tuple(row for where, prediction in found if prediction is not None for row in _joints(where, prediction))
    columns = (
        Column("Torque predicted", "name"),
        Column("Joint", "text"),
        Column("RMSE, N m", "number"),
        Column("RMSE / RMS, %", "number"),
        Column("R²", "number"),
        Column("Filter", "text", rank=1),
    )
    return Table("Torque prediction", columns, rows).without_empty()


def _joints(where: str, found: TorquePrediction) -> list[tuple[str, ...]]:
    return [
        (
            where,
            str(joint + 1),
            significant(found.rmse[joint], 3),
            significant(100 * found.nrmse[joint], 3),
            f"{found.r2[joint]:.5f}",
            visible(found.filter),
        )
        for joint in range(2)
    ]


def _terms(result: Result) -> Table:
    assert result.fit is not None
    rows = tuple((visible(t.term), f"{t.delta_bic:+.1f}", "yes" if t.kept else "no") for t in result.fit.terms)
    columns = (Column("Term", "name"), Column("Change of BIC", "number"), Column("Kept", "text"))
    return Table("Terms tried", columns, rows, "A negative change says that the term earns its place.")


def _bounds(result: Result) -> Table:
    assert result.fit is not None
    rows = tuple(
        (visible(b.bound), significant(b.value, 4), significant(b.distance_sigma, 2)) for b in result.fit.broken_bounds
    )
    columns = (Column("Bound", "name"), Column("Value", "number"), Column("Broken by, σ", "number"))
    return Table("Physical bounds that are broken", columns, rows).without_empty()


def log_tables(result: Result) -> list[Table]:
    """The logs that were used and which channel each signal was taken from."""
    columns = (
        Column("Log", "name"),
        Column("Arm", "text"),
        Column("Format", "text"),
        Column("Samples", "number"),
        Column("Duration, s", "number"),
        Column("Rate, Hz", "number"),
    )
    channels = (Column("Signal", "name"), Column("Taken from", "text"), Column("Log", "text"))
    return [
        Table("Logs", columns, tuple(_log_row(log) for log in result.logs)),
        Table("Channels", channels, _channel_rows(result.logs)),
    ]


def _log_row(log: LogSummary) -> tuple[str, ...]:
    rate, duration = significant(log.rate, 6), significant(log.duration, 6)
    return file_name(log.path), log.role, visible(log.format), f"{log.rows:,}", duration, rate


def _channel_rows(logs: list[LogSummary]) -> tuple[tuple[str, ...], ...]:
    """A row a signal; a log is named only where its channels differ from the first one's."""
    first = tuple((visible(signal), visible(source), "all logs") for signal, source in logs[0].mapping.items())
    others = tuple(
        (visible(signal), visible(source), file_name(log.path))
        for log in logs[1:]
        if log.mapping != logs[0].mapping
        for signal, source in log.mapping.items()
    )
    return first + others


def settings_table(settings: Mapping[str, Any]) -> Table:
    """The settings, nested ones by their dotted names."""
    rows = tuple((visible(name), visible(value)) for name, value in flat_settings(settings).items())
    return Table("Settings", (Column("Setting", "name"), Column("Value", "text")), rows)


def flat_settings(settings: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Settings by dotted name, each value as text."""
    flat: dict[str, str] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            flat |= flat_settings(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = setting_text(value)
    return flat


def setting_text(value: object) -> str:
    """A setting's value as one reads it in a profile."""
    if value is None:
        return ABSENT
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, list | tuple):
        return ", ".join(setting_text(item) for item in value)
    return str(value)


def provenance_table(result: Result) -> Table:
    """What made the result, from what."""
    rows = [("algid", visible(result.version)), ("estimator", visible(result.estimator))]
    rows += [(f"sha256 of {file_name(log.path)}", visible(log.sha256)) for log in result.logs]
    rows += [(f"path of {file_name(log.path)}", visible(log.path)) for log in result.logs]
    return Table("Provenance", (Column("What", "name"), Column("Value", "text")), tuple(rows))
