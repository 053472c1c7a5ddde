"""The tables of what is known beside the estimates: the fit, the logs, the settings, the provenance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from algid.report.numbers import ABSENT, significant
from algid.report.table import Column, Table
from algid.report.text import file_name, visible
from algid.report.torquelog import TorqueLog
from algid.report.verdict import replaced_estimator
from algid.results import LogSummary, Result


def fit_tables(result: Result) -> list[Table]:
    """What a statistical estimator knows beside the estimates: noise, whiteness, terms, bounds."""
    if result.fit is None:
        return []
    tables = [_noise(result), _whiteness(result), _terms(result), _bounds(result)]
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
            significant(span.first, 6) if span.first else "0",
            significant(span.last, 6),
            significant(1e3 * span.period, 4),
            str(span.gaps),
            significant(1e3 * span.largest_gap, 4),
        )
        for log, span in sorted(torque.ranges.items())
    )
    note = f"{torque.unpredicted:,} samples have no predicted torque." if torque.unpredicted else ""
    return [Table("Samples that were used", columns, rows, note)]
