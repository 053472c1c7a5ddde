"""Tables of a result: its estimates, then fit, logs, settings and provenance.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from algid.arm import CONSTANT_NAMES
from algid.base.text import (
    ABSENT,
    file_name,
    formatted,
    joined,
    resolved,
    significant,
    unit_text,
    visible,
    yes_or_no,
)
from algid.methods import settles
from algid.model import DELAYS
from algid.notices import NAMED
from algid.report.document import Kind, Table
from algid.report.phasors import moments
from algid.report.series import LogFacts
from algid.results import Estimate, FitSummary, LogSummary, Result, Status, TorquePrediction
from algid.results.rows import known_truth, rows_of
from algid.results.verdict import replaced_estimator

LONGEST_VALUE = 4_000  # characters: a command that names many logs is there to be copied
CONVENTIONS = ("zero", "second_angle", "drive", "signs", "offsets")
"""How the angles and torques of a log were taken."""
INTERVALS_REST_ON = {
    "likelihood": "the likelihood, which takes it to be white",
    "sandwich": "a sandwich, which lets it be coloured; what differs from run to run is not "
    "in it: give four logs",
    "jackknife": "the larger of a sandwich, which lets it be coloured, and a jackknife over "
    "the logs",
}
STATES = (
    ("rmse_moving", "moving"),
    ("rmse_rest", "at rest"),
    ("rmse_held", "at rest beyond ± f of dry friction"),
)


def estimates_table(title: str, estimates: Mapping[str, Estimate], result: Result) -> Table:
    """Estimates with their intervals, the truth where it is known, and what they are."""
    columns: dict[str, Kind] = {
        "Parameter": "name", "Estimate": "number", "± 95 %": "number", "Unit": "text",
        "Status": "status", "±, %": "number", "Truth": "number", "Error, %": "number",
        "Meaning": "text",
    }  # fmt: skip
    rows = []
    for one in rows_of(result, estimates):
        known = (one.status, one.share, one.truth, one.error, one.meaning)
        rows.append((one.name, one.value, one.half, one.unit, *known))
    return Table(title, columns, tuple(rows)).without_empty()


def arm_tables(result: Result) -> tuple[Table, ...]:
    """The arm first: its constants, the payload, and the moments of a bent arm."""
    constants = {name: one for name, one in result.parameters.items() if name in CONSTANT_NAMES}
    rows = []
    for name, one in moments(result).items():
        size, half = resolved(one.size, one.std), significant(one.half, 2)
        rows.append((f"|{name.upper()}|", size, half, unit_text(one.unit), one.angle_text))
    note = (
        "K = k + i k_s: the angle of K1 is θ2's zero or link 2's centre of mass, that of K2 less "
        "it θ1's zero, that of K4 less θ1's zero the load of joint 1 off link 1's line."
    )
    columns: dict[str, Kind] = {
        "Moment": "name", "Size": "number", "± 95 %": "number", "Unit": "text",
        "Angle, 95 %": "number",
    }  # fmt: skip
    return (
        estimates_table("Constants", constants, result),
        estimates_table("Payload", result.payload, result),
        Table("Moments off the links' lines", columns, tuple(rows), note),
    )


def nuisance_tables(result: Result) -> tuple[Table, Table]:
    """The terms beside eq. (1): those that differ from zero, and those that may be zero."""
    terms = {n: one for n, one in result.parameters.items() if n not in CONSTANT_NAMES}
    zero = {n: one for n, one in terms.items() if one.status is Status.NOT_SIGNIFICANT}
    other = {n: one for n, one in terms.items() if n not in zero}
    return (
        estimates_table("Other terms of the torque", other, result),
        estimates_table("Terms whose interval holds zero", zero, result),
    )


def paper_tables(result: Result) -> tuple[Table, ...]:
    """The payload by the paper's route, the loaded arm, and its Table 4 where a truth is known."""
    columns: dict[str, Kind] = {
        "Parameter": "name", "Estimate": "number", "± 95 %": "number", "Unit": "text",
        "Truth": "number", "Error, %": "number", "Paper, %": "number",
    }  # fmt: skip
    rows: list[tuple[str, ...]] = []
    for row in result.table4 if known_truth(result) else ():
        half = None if row.std is None else result.quantile * row.std
        rows.append(
            (
                visible(row.parameter),
                resolved(row.estimate, row.std),
                significant(half, 2),
                unit_text(row.unit),
                significant(row.truth),
                significant(row.error_percent, 4),
                significant(row.paper_error_percent, 4),
            )
        )
    note = (
        "Names and order of the paper's Table 4; Paper, % is the error it reports. The paper does "
        "not state its torque: that of the synthetic cases was sought for this table."
    )
    return (
        estimates_table("Payload by the paper's route", result.paper_payload, result),
        estimates_table("Loaded arm", result.loaded, result),
        Table("Table 4", columns, tuple(rows), note).without_empty(),
    )


def prediction_table(fit: FitSummary) -> Table:
    """How well the model predicts the torque: of the logs used, and of each log by the others."""
    predictions = {"logs used": fit.residual, "each log by the others": fit.cross_validation}
    rows, filters, states = [], list[str](), ""
    for where, one in predictions.items():
        if one is None:
            continue
        for joint in range(2):
            rmse, share = significant(one.rmse[joint], 3), significant(100 * one.nrmse[joint], 3)
            rows.append((where, str(joint + 1), rmse, share, f"{one.r2[joint]:.5f}"))
        filters.append(visible(one.filter))
        text = by_state(one)
        if text:
            states += f" RMSE of {where}: {text}."
    columns: dict[str, Kind] = {
        "Torque predicted": "name", "Joint": "text", "RMSE, N m": "number",
        "RMSE / RMS, %": "number", "R²": "number",
    }  # fmt: skip
    note = f"Filter: {'; '.join(dict.fromkeys(filters))}.{states}"
    return Table("Torque prediction", columns, tuple(rows), note)


def by_state(found: TorquePrediction) -> str:
    """The RMSE of joints that move and of joints that stand, in words; empty where none stands."""
    if found.rmse_rest is None or found.rmse_rest == (None, None):
        return ""
    parts = []
    for joint in range(2):
        known = []
        for name, words in STATES:
            pair = getattr(found, name)
            if pair is not None and pair[joint] is not None:
                known.append(f"{significant(pair[joint], 3)} {words}")
        if known:
            parts.append(f"joint {joint + 1} {', '.join(known)}")
    return f"{'; '.join(parts)} (N m)"


def terms_table(fit: FitSummary) -> Table:
    """Optional terms of the torque and their worth; those alike without a number share a row."""
    rows: list[list[str]] = []
    alike: dict[tuple[str, ...], list[str]] = {}
    for term in fit.terms:
        change = None if term.gain_heldout is None else -100 * term.gain_heldout or 0.0  # no −0.00
        numbers = (
            formatted(term.delta_bic, "+.1f"),
            formatted(change, "+.2f"),
            formatted(term.evidence, "+.1f"),
        )
        rest = (*numbers, yes_or_no(term.kept), visible(term.why))
        if {*numbers} == {ABSENT} and rest in alike:
            alike[rest][0] += f", {visible(term.term)}"
            continue
        rows.append([visible(term.term), *rest])
        alike[rest] = rows[-1]
    note = ""
    if any(term.delta_bic is not None for term in fit.terms):
        note = "A negative change of BIC favours the term."
    if fit.model is not None and fit.model.held_out is not None:
        note = (
            f"Held-out error: squared, of whole {fit.model.held_out}, each predicted from the "
            "others; negative: the term lowers it. A term is kept if it does and its log odds are "
            "positive."
        )
    columns: dict[str, Kind] = {
        "Term": "name", "Change of BIC": "number", "Held-out error, %": "number",
        "Log odds": "number", "Kept": "text", "Why": "text",
    }  # fmt: skip
    return Table("Terms tried", columns, tuple(map(tuple, rows)), note).without_empty()


def fit_tables(fit: FitSummary) -> tuple[Table, ...]:
    """Noise of the logs, whiteness of the residual, and bounds of physics that are broken."""
    units = {"theta1": "rad", "theta2": "rad", "tau1": "N m", "tau2": "N m"}
    noise = []
    for name, std in fit.noise.items():
        noise.append((visible(name), significant(std, 3), units.get(name, ABSENT)))
    tests, bounds = [], []
    for name, test in fit.whiteness.items():
        numbers = (significant(test.p_value, 2), f"{test.lag1_correlation:.3f}")
        tests.append((visible(name), yes_or_no(test.white), *numbers))
    for one in fit.broken_bounds:
        distance = significant(one.distance_sigma, 2)
        bounds.append((visible(one.bound), significant(one.value, 4), distance))
    white: dict[str, Kind] = {
        "Residual": "name", "White": "text", "p-value": "number", "Lag-one correlation": "number",
    }  # fmt: skip
    rest_on = f"The intervals rest on {INTERVALS_REST_ON[fit.intervals]}."
    broken: dict[str, Kind] = {"Bound": "name", "Value": "number", "Broken by, σ": "number"}
    return (
        Table(
            "Noise of the logs",
            {"Signal": "name", "Noise, std": "number", "Unit": "text"},
            tuple(noise),
        ),
        Table("Whiteness of the residual", white, tuple(tests), rest_on),
        Table("Physical bounds that are broken", broken, tuple(bounds)),
    )


def samples_table(logs: Mapping[int, LogFacts], names: Sequence[str]) -> Table:
    """What the stamps and the samples of each log look like."""
    rows = []
    for log, one in sorted(logs.items()):
        span = (f"{one.samples:,}", f"{one.first:.6g}", f"{one.last:.6g}")
        steps = (f"{1e3 * one.period:.4g}", str(one.gaps), f"{1e3 * one.largest_step:.4g}")
        rows.append((names[log], *span, *steps))
    columns: dict[str, Kind] = {
        "Log": "name", "Samples used": "number", "From, s": "number", "To, s": "number",
        "Period, ms": "number", "Gaps": "number", "Largest step, ms": "number",
    }  # fmt: skip
    return Table("Samples that were used", columns, tuple(rows))


def log_tables(logs: Sequence[LogSummary]) -> tuple[Table, Table]:
    """`logs`, and from which channel each signal was taken, once for all logs that share it."""
    rows = []
    taken: dict[tuple[str, str], list[str]] = {}
    for log in logs:
        numbers = (f"{log.rows:,}", f"{log.duration:.6g}", f"{log.rate:.6g}")
        rows.append((file_name(log.path), log.role, visible(log.format), *numbers))
        for pair in log.mapping.items():
            taken.setdefault(pair, []).append(file_name(log.path))
    channels = []
    for (signal, source), names in taken.items():
        these = f"{names[0]} and {len(names) - 1} more"
        if len(names) <= NAMED:
            these = joined(names)
        if len(names) == len(logs):
            these = "all logs"
        channels.append((visible(signal), visible(source), these))
    columns: dict[str, Kind] = {
        "Log": "name", "Arm": "text", "Format": "text", "Samples": "number",
        "Duration, s": "number", "Rate, Hz": "number",
    }  # fmt: skip
    heads: dict[str, Kind] = {"Signal": "name", "Taken from": "text", "Log": "text"}
    return Table("Logs", columns, tuple(rows)), Table("Channels", heads, tuple(channels))


def settings_table(used: Mapping[str, Any], asked: Mapping[str, str] | None = None) -> Table:
    """Settings by dotted name, beside what was asked for where that is something else."""
    columns: dict[str, Kind] = {"Setting": "name", "Used": "text", "Asked for": "text"}
    rows = []
    for name, value in flat_settings(used).items():
        wished = visible((asked or {}).get(name, ABSENT))
        rows.append((visible(name), visible(value, LONGEST_VALUE), wished))
    return Table("Settings", columns, tuple(rows)).without_empty()


def used_settings(result: Result) -> Table:
    """The settings as they were used; below them how the first log of each kind was read."""
    used, asked = flat_settings(result.settings), dict[str, str]()
    decided = {"estimator": result.estimator}
    if settles(result.estimator):
        decided["model"] = "plain"
    model, delay = result.torque_model, result.delay
    if model is not None:
        terms = [*model.terms, *(DELAYS if delay is not None else ())]
        decided["model"] = ", ".join(terms) or "plain"
        if "coulomb" in terms:
            speed = significant(model.coulomb_speed, 2)
            decided["model"] += f" (Coulomb friction over {speed} rad/s)"
    if delay is not None and delay.estimate is not None:
        decided["delay"] = f"{1e3 * delay.estimate:.3g} ms".replace("-", "−")
    for name, value in decided.items():
        if value != used.get(name):
            asked[name], used[name] = used.get(name, ABSENT), value
    hold = result.fit.torque_hold if result.fit is not None else None
    if hold is not None and hold.asked != hold.used:
        asked["torque_hold"] = hold.asked
    firsts = {log.role: log.reading for log in reversed(result.logs) if log.reading is not None}
    for name in CONVENTIONS:
        words = name.replace("_", " ")
        values = {role: setting_text(getattr(one, name)) for role, one in firsts.items()}
        if len(set(values.values())) == 1:
            used[words] = next(iter(values.values()))
        else:
            used |= {f"{words} of the {role} log": value for role, value in values.items()}
    return settings_table(used, asked)


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
        return yes_or_no(value)
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, list | tuple):
        return ", ".join(setting_text(item) for item in value)
    return str(value)


def provenance_table(rows: Sequence[tuple[str, str]]) -> Table:
    """What made a result, from what: `rows` of names and values, made visible here."""
    shown = tuple((visible(name), visible(value)) for name, value in rows)
    return Table("Provenance", {"What": "name", "Value": "text"}, shown)


def result_provenance(result: Result) -> Table:
    """What made the result, from what."""
    asked = replaced_estimator(result)
    estimator = result.estimator if asked is None else f"{result.estimator}, in place of {asked}"
    rows = [("algid", result.version), ("estimator", estimator)]
    for log in result.logs:
        known = log.sha256 or "unknown, fetched in part"
        rows.append((f"sha256 of {file_name(log.path)}", known))
    for log in result.logs:
        rows.append((f"path of {file_name(log.path)}", log.path))
    return provenance_table(rows)
