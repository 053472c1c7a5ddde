"""The tables of what is known beside the estimates: the fit, the logs, the settings, the provenance.

The tables of a result's estimates: rows of finished text, which the terminal, Markdown and HTML merely set.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from algid.report.series import TorqueLog
from algid.report.table import Column, Table
from algid.report.text import ABSENT, digits_of, file_name, interval, percent, resolved, significant, unit_text, visible
from algid.report.verdict import replaced_estimator, verdict
from algid.results import Estimate, LogSummary, Result, Table4Row, TermCriterion, TorquePrediction
from algid.words import counted

LONGEST_VALUE = 4_000  # characters: a command that names many logs is there to be copied


def fit_tables(result: Result) -> list[Table]:
    """What a statistical estimator knows beside the estimates: noise, whiteness, bounds."""
    if result.fit is None:
        return []
    tables = [_noise(result), _whiteness(result), _bounds(result)]
    return [table for table in tables if table.rows]


def terms_tables(result: Result) -> list[Table]:
    """The optional terms of the torque that were tried or given, and what each is worth."""
    tables = [] if result.fit is None else [_terms(result)]
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
        "sandwich": "a sandwich, which lets it be coloured; what differs from run to run is not in it: give four logs",
        "jackknife": "the larger of a sandwich, which lets it be coloured, and a jackknife over the logs",
    }
    note = f"The intervals rest on {how[result.fit.intervals]}."
    return Table("Whiteness of the residual", columns, rows, note).without_empty()


def chosen_terms(result: Result) -> list[Table]:
    """What became of each term of the torque, where the logs chose."""
    if result.fit is None or result.fit.model is None or result.fit.model.chosen_by != "logs":
        return []
    return [_terms(result)]


def _terms(result: Result) -> Table:
    assert result.fit is not None
    rows = tuple(_term_row(term) for term in result.fit.terms)
    columns = (
        Column("Term", "name"),
        Column("Change of BIC", "number"),
        Column("Held-out error, %", "number"),
        Column("Log odds", "number"),
        Column("Kept", "text"),
        Column("Why", "text"),
    )
    model = result.fit.model
    if model is not None and model.held_out is not None:
        note = (
            f"Held-out error: squared, of whole {model.held_out}, each predicted from the others, with the term beside"
        )
        note += " those kept against without. Log odds: of the term, its price taken off."
    else:
        note = "A negative change says that the term earns its place."
    return Table("Terms tried", columns, rows, note).without_empty()


def _term_row(term: TermCriterion) -> tuple[str, ...]:
    return (
        visible(term.term),
        ABSENT if term.delta_bic is None else f"{term.delta_bic:+.1f}",
        ABSENT if term.gain_heldout is None else f"{-100 * term.gain_heldout:+.2f}",
        ABSENT if term.evidence is None else f"{term.evidence:+.1f}",
        "yes" if term.kept else "no",
        visible(term.why),
    )


def _bounds(result: Result) -> Table:
    assert result.fit is not None
    rows = tuple(
        (visible(b.bound), significant(b.value, 4), significant(b.distance_sigma, 2)) for b in result.fit.broken_bounds
    )
    columns = (Column("Bound", "name"), Column("Value", "number"), Column("Broken by, σ", "number"))
    return Table("Physical bounds that are broken", columns, rows).without_empty()


def log_tables(result: Result) -> list[Table]:
    """The logs that were used and which channel each signal was taken from."""
    return tables_of(result.logs)


def tables_of(logs: list[LogSummary]) -> list[Table]:
    """`logs` and which channel each signal was taken from."""
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
        Table("Logs", columns, tuple(_log_row(log) for log in logs)),
        Table("Channels", channels, _channel_rows(logs)),
    ]


def _log_row(log: LogSummary) -> tuple[str, ...]:
    return file_name(log.path), log.role, visible(log.format), f"{log.rows:,}", f"{log.duration:.6g}", f"{log.rate:.6g}"


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
    rows = tuple((visible(name), visible(value, LONGEST_VALUE)) for name, value in flat_settings(settings).items())
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


def _estimator(result: Result) -> str:
    asked = replaced_estimator(result)
    return visible(result.estimator) + ("" if asked is None else f", in place of {visible(asked)}")


def provenance_table(result: Result) -> Table:
    """What made the result, from what."""
    rows = [("algid", visible(result.version)), ("estimator", _estimator(result))]
    rows += [
        (f"sha256 of {file_name(log.path)}", visible(log.sha256 or "unknown, fetched in part")) for log in result.logs
    ]
    rows += [(f"path of {file_name(log.path)}", visible(log.path)) for log in result.logs]
    return Table("Provenance", (Column("What", "name"), Column("Value", "text")), tuple(rows))


def quality_tables(torque: TorqueLog | None, result: Result) -> list[Table]:
    """What the stamps and the samples of each log look like."""
    if torque is None:
        return []
    columns = (
        Column("Log", "name"),
        Column("Samples used", "number"),
        Column("From, s", "number"),
        Column("To, s", "number"),
        Column("Period, ms", "number"),
        Column("Gaps", "number"),
        Column("Largest step, ms", "number"),
    )
    names = dict(enumerate(file_name(log.path) for log in result.logs))
    rows = tuple(
        (
            names.get(log, f"log {log + 1}"),
            f"{span.samples:,}",
            f"{span.first:.6g}",
            f"{span.last:.6g}",
            f"{1e3 * span.period:.4g}",
            str(span.gaps),
            f"{1e3 * span.largest_gap:.4g}",
        )
        for log, span in sorted(torque.ranges.items())
    )
    note = (
        f"{counted(torque.unpredicted, 'sample has', 'samples have')} no predicted torque."
        if torque.unpredicted
        else ""
    )
    return [Table("Samples that were used", columns, rows, note)]


ESTIMATE_COLUMNS = (
    Column("Parameter", "name"),
    Column("Estimate", "number"),
    Column("± std", "number", rank=2),
    Column("± std, %", "number", rank=6),
    Column("Unit", "text"),
    Column("Status", "status"),
    Column("95 % interval", "number", rank=1),
    Column("Truth", "number", rank=5),
    Column("Error %", "number", rank=3),
    Column("Paper %", "number", rank=4),
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
        known = [row for row in result.table4 if row.estimate is not None or row.truth is not None]
        rows = tuple(map(_table4_row, known))
        note = "Names and order of the paper's Table 4; Paper % is the error it reports."
        tables.append(Table("Table 4", TABLE4_COLUMNS, rows, note).without_empty())
    if verdict(result).level == "failed":
        tables = [table.doubted() for table in tables]
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
