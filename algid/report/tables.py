"""Tables of a result: its estimates, then fit, logs, settings and provenance.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from algid.methods import settles
from algid.model import DELAYS, PARAMETERS
from algid.notices import NAMED
from algid.report.document import Column, Depth, Table, filled
from algid.report.phasors import moments
from algid.report.series import TorqueLog
from algid.results import (
    Estimate,
    FitSummary,
    LogSummary,
    Result,
    Table4Row,
    TermCriterion,
    TorquePrediction,
)
from algid.results.verdict import replaced_estimator
from algid.text import (
    ABSENT,
    digits_of,
    file_name,
    formatted,
    interval,
    joined,
    percent,
    resolved,
    significant,
    unit_text,
    visible,
    yes_or_no,
)
from algid.words import counted

LONGEST_VALUE = 4_000  # characters: a command that names many logs is there to be copied


def fit_tables(result: Result) -> tuple[Table, ...]:
    """What a statistical estimator knows beside the estimates: noise, whiteness, bounds."""
    fit = result.fit
    if fit is None:
        return ()
    shown = filled(
        _noise_table(fit),
        _whiteness_table(fit).without_empty(),
        _bounds_table(fit).without_empty(),
    )
    return tuple(table.at(Depth.MARKDOWN) for table in shown)


def _noise_table(fit: FitSummary) -> Table:
    units = {"theta1": "rad", "theta2": "rad", "tau1": "N m", "tau2": "N m"}
    rows = []
    for name, std in fit.noise.items():
        rows.append((visible(name), significant(std, 3), units.get(name, ABSENT)))
    columns = (Column("Signal", "name"), Column("Noise, std", "number"), Column("Unit", "text"))
    return Table("Noise that the logs carry", columns, tuple(rows))


INTERVALS_REST_ON = {
    "likelihood": "the likelihood, which takes it to be white",
    "sandwich": "a sandwich, which lets it be coloured; what differs from run to run is not "
    "in it: give four logs",
    "jackknife": "the larger of a sandwich, which lets it be coloured, and a jackknife over "
    "the logs",
}


def _whiteness_table(fit: FitSummary) -> Table:
    columns = (
        Column("Residual", "name"),
        Column("White", "text"),
        Column("p-value", "number"),
        Column("Lag-one correlation", "number"),
    )
    rows = []
    for name, test in fit.whiteness.items():
        p_value = significant(test.p_value, 2)
        rows.append((visible(name), yes_or_no(test.white), p_value, f"{test.lag1_correlation:.3f}"))
    note = f"The intervals rest on {INTERVALS_REST_ON[fit.intervals]}."
    return Table("Whiteness of the residual", columns, tuple(rows), note)


def _bounds_table(fit: FitSummary) -> Table:
    columns = (
        Column("Bound", "name"),
        Column("Value", "number"),
        Column("Broken by, σ", "number"),
    )
    rows = []
    for one in fit.broken_bounds:
        distance = significant(one.distance_sigma, 2)
        rows.append((visible(one.bound), significant(one.value, 4), distance))
    return Table("Physical bounds that are broken", columns, tuple(rows))


def terms_tables(result: Result) -> tuple[Table, ...]:
    """Optional terms of the torque and their worth, first in the order if the logs chose them."""
    fit = result.fit
    if fit is None:
        return ()
    columns = (
        Column("Term", "name"),
        Column("Change of BIC", "number"),
        Column("Held-out error, %", "number"),
        Column("Log odds", "number"),
        Column("Kept", "text"),
        Column("Why", "text"),
    )
    note = ""
    if any(term.delta_bic is not None for term in fit.terms):
        note = "A negative change says that the term earns its place."
    depth = Depth.MARKDOWN
    if fit.model is not None:
        if fit.model.held_out is not None:
            note = (
                f"Held-out error: squared, of whole {fit.model.held_out}, each predicted from the "
                "others, with the term "
                "beside those kept against without. Log odds: of the term, its price taken off."
            )
        if fit.model.chosen_by == "logs":
            depth = Depth.TERMINAL
    return filled(Table("Terms tried", columns, _term_rows(fit.terms), note, depth).without_empty())


def _term_rows(terms: Sequence[TermCriterion]) -> tuple[tuple[str, ...], ...]:
    """A row a term; those without a number of which the same is said share one."""
    rows: list[tuple[str, ...]] = []
    alike: dict[tuple[str, ...], int] = {}
    for term in terms:
        row = _term_row(term)
        if term.gain_heldout is not None or term.evidence is not None or term.delta_bic is not None:
            rows.append(row)
        elif row[1:] in alike:
            place = alike[row[1:]]
            rows[place] = (f"{rows[place][0]}, {row[0]}", *row[1:])
        else:
            alike[row[1:]] = len(rows)
            rows.append(row)
    return tuple(rows)


def _term_row(term: TermCriterion) -> tuple[str, ...]:
    change = None
    if term.gain_heldout is not None:
        change = -100 * term.gain_heldout or 0.0  # no −0.00
    return (
        visible(term.term),
        formatted(term.delta_bic, "+.1f"),
        formatted(change, "+.2f"),
        formatted(term.evidence, "+.1f"),
        yes_or_no(term.kept),
        visible(term.why),
    )


def log_tables(logs: list[LogSummary]) -> tuple[Table, Table]:
    """`logs` and which channel each signal was taken from."""
    columns = (
        Column("Log", "name"),
        Column("Arm", "text"),
        Column("Format", "text"),
        Column("Samples", "number"),
        Column("Duration, s", "number"),
        Column("Rate, Hz", "number"),
    )
    heads = (Column("Signal", "name"), Column("Taken from", "text"), Column("Log", "text"))
    rows = tuple(_log_row(log) for log in logs)
    channels = tuple(_channel_rows(logs))
    return (
        Table("Logs", columns, rows, depth=Depth.FOLDED),
        Table("Channels", heads, channels, depth=Depth.PAGE),
    )


def _log_row(log: LogSummary) -> tuple[str, ...]:
    return (
        file_name(log.path),
        log.role,
        visible(log.format),
        f"{log.rows:,}",
        f"{log.duration:.6g}",
        f"{log.rate:.6g}",
    )


def _channel_rows(logs: Sequence[LogSummary]) -> Iterator[tuple[str, ...]]:
    """Each signal and where it was taken from, once for all logs that have it from there."""
    taken: dict[str, dict[str, list[str]]] = {}
    for log in logs:
        for signal, source in log.mapping.items():
            taken.setdefault(signal, {}).setdefault(source, []).append(file_name(log.path))
    for signal, sources in taken.items():
        for source, names in sources.items():
            yield visible(signal), visible(source), _these(names, len(logs))


def _these(names: list[str], every: int) -> str:
    """Logs by their names, of many the first."""
    if len(names) == every:
        return "all logs"
    if len(names) <= NAMED:
        return joined(names)
    return f"{names[0]} and {len(names) - 1} more"


def settings_table(settings: Mapping[str, Any]) -> Table:
    """The settings, nested ones by their dotted names."""
    columns = (Column("Setting", "name"), Column("Value", "text"))
    rows = []
    for name, value in flat_settings(settings).items():
        rows.append((visible(name), visible(value, LONGEST_VALUE)))
    return Table("Settings", columns, tuple(rows), depth=Depth.PAGE)


def used_settings(result: Result) -> Table:
    """The settings as they were used, and what was asked for where that is something else.

    How the first log of each kind was read stands below them.
    """
    used, asked = flat_settings(result.settings), {}
    for name, value in _found(result).items():
        if value != used.get(name):
            asked[name], used[name] = used.get(name, ABSENT), value
    if result.fit is not None:
        hold = result.fit.torque_hold
        if hold is not None and hold.asked != hold.used:
            asked["torque_hold"] = hold.asked
    used |= _conventions(result.logs)
    rows = []
    for name, value in used.items():
        wished = visible(asked.get(name, ABSENT))
        rows.append((visible(name), visible(value, LONGEST_VALUE), wished))
    columns = (Column("Setting", "name"), Column("Used", "text"), Column("Asked for", "text"))
    return Table("Settings", columns, tuple(rows), depth=Depth.PAGE).without_empty()


def _conventions(logs: Sequence[LogSummary]) -> dict[str, str]:
    """How the first log of each kind was read; said once where both are read alike."""
    firsts = {}
    for log in reversed(logs):
        if log.reading is not None:
            firsts[log.role] = log.reading
    read = {}
    for name in CONVENTIONS:
        words = name.replace("_", " ")
        values = {role: setting_text(getattr(one, name)) for role, one in firsts.items()}
        if len(set(values.values())) == 1:
            read[words] = next(iter(values.values()))
        else:
            for role, value in values.items():
                read[f"{words} of the {role} log"] = value
    return read


def _found(result: Result) -> dict[str, str]:
    """The settings that the logs decided: estimator, terms of the torque, delay."""
    values = {"estimator": result.estimator}
    if settles(result.estimator):
        values["model"] = "plain"
    model, delay = result.torque_model, result.delay
    if model is not None:
        terms = list(model.terms)
        if delay is not None:
            terms += DELAYS
        values["model"] = ", ".join(terms) or "plain"
        if "coulomb" in terms:
            speed = significant(model.coulomb_speed, 2)
            values["model"] += f" (Coulomb friction over {speed} rad/s)"
    if delay is not None and delay.estimate is not None:
        values["delay"] = f"{1e3 * delay.estimate:.3g} ms".replace("-", "−")
    return values


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
    columns = (Column("What", "name"), Column("Value", "text"))
    shown = tuple((visible(name), visible(value)) for name, value in rows)
    return Table("Provenance", columns, shown, depth=Depth.FOLDED)


def result_provenance(result: Result) -> Table:
    """What made the result, from what."""
    asked = replaced_estimator(result)
    estimator = result.estimator
    if asked is not None:
        estimator += f", in place of {asked}"
    rows = [("algid", result.version), ("estimator", estimator)]
    for log in result.logs:
        known = log.sha256 or "unknown, fetched in part"
        rows.append((f"sha256 of {file_name(log.path)}", known))
    for log in result.logs:
        rows.append((f"path of {file_name(log.path)}", log.path))
    return provenance_table(rows)


def quality_tables(torque: TorqueLog | None, result: Result) -> tuple[Table, ...]:
    """What the stamps and the samples of each log look like."""
    if torque is None:
        return ()
    columns = (
        Column("Log", "name"),
        Column("Samples used", "number"),
        Column("From, s", "number"),
        Column("To, s", "number"),
        Column("Period, ms", "number"),
        Column("Gaps", "number"),
        Column("Largest step, ms", "number"),
    )
    names = [file_name(log.path) for log in result.logs]
    rows = []
    for log, span in sorted(torque.ranges.items()):
        rows.append(
            (
                names[log] if log < len(names) else f"log {log + 1}",
                f"{span.samples:,}",
                f"{span.first:.6g}",
                f"{span.last:.6g}",
                f"{1e3 * span.period:.4g}",
                str(span.gaps),
                f"{1e3 * span.largest_gap:.4g}",
            )
        )
    note = ""
    if torque.unpredicted:
        lacking = counted(torque.unpredicted, "sample has", "samples have")
        note = f"{lacking} no predicted torque."
    return (Table("Samples that were used", columns, tuple(rows), note, Depth.PAGE),)


CONVENTIONS = ("zero", "second_angle", "drive", "signs", "offsets")
"""How the angles and torques of a log were taken."""
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
    Column("Meaning", "text", rank=7),
)
TABLE4_COLUMNS = tuple(
    column
    for column in ESTIMATE_COLUMNS
    if column.kind != "status" and column.heading not in ("95 % interval", "Meaning")
)
PREDICTION_COLUMNS = (
    Column("Torque predicted", "name"),
    Column("Joint", "text"),
    Column("RMSE, N m", "number"),
    Column("RMSE / RMS, %", "number"),
    Column("R²", "number"),
)


def estimate_tables(result: Result) -> tuple[Table, ...]:
    """Estimates: arm, payload, the paper's route, loaded arm, Table 4, and prediction."""
    every = (
        _estimate_table("Parameters", result.parameters, result),
        _moments_table(result),
        _estimate_table("Payload", result.payload, result),
        _estimate_table("Payload by the paper's route", result.paper_payload, result),
        _estimate_table("Loaded arm", result.loaded, result),
        _table4(result),
    )
    shown = [table.without_empty() for table in every if table.rows]
    if result.verdict.failed:
        shown = [table.doubted() for table in shown]
    if result.fit is not None:
        shown += filled(_prediction(result.fit))
    return tuple(shown)


def _estimate_table(title: str, estimates: Mapping[str, Estimate], result: Result) -> Table:
    rows = tuple(_estimate_row(name, one, result) for name, one in estimates.items())
    return Table(title, ESTIMATE_COLUMNS, rows)


def _table4(result: Result) -> Table:
    """The paper's Table 4; empty where no truth is known."""
    rows = []
    for row in result.table4:
        if row.estimate is not None or row.truth is not None:
            number = _number(row.parameter, row.estimate, row.std, row.unit)
            rows.append(number + _against(row, row.estimate, row.std))
    if all(row.truth is None for row in result.table4):
        rows = []
    note = (
        "Names and order of the paper's Table 4; Paper % is the error it reports. The paper "
        "does not state "
        "its torque: that of the synthetic cases was sought for this table."
    )
    return Table("Table 4", TABLE4_COLUMNS, tuple(rows), note)


def known_truth(result: Result) -> dict[str, float]:
    """What a synthetic log was made with, by parameter."""
    truth = {row.parameter: row.truth for row in result.table4 if row.truth is not None}
    return truth | result.truth


def _moments_table(result: Result) -> Table:
    """The moments of a bent arm as sizes and angles; empty of a straight one."""
    columns = (
        Column("Moment", "name"),
        Column("Size", "number"),
        Column("± std", "number"),
        Column("Unit", "text"),
        Column("Angle, 95 %", "number"),
    )
    rows = []
    for name, one in moments(result).items():
        size, std = resolved(one.size, one.std), significant(one.std, 2)
        rows.append((f"|{name.upper()}|", size, std, unit_text(one.unit), one.angle_text))
    note = (
        "K = k + i k_s: the angle of K1 is θ2's zero or link 2's centre of mass, that of K2 less "
        "it θ1's zero, that of K4 less θ1's zero the load of joint 1 off link 1's line."
    )
    return Table("Moments off the links' lines", columns, tuple(rows), note)


def _estimate_row(name: str, found: Estimate, result: Result) -> tuple[str, ...]:
    """An estimate with what is known against it.

    Truth and errors are Table 4's where it has the parameter, else (k5, k7, l1, l2) the truth
    alone; where Table 4 holds another estimate of the same name, the error is this one's own.
    """
    rows = {row.parameter: row for row in result.table4}
    known = rows.get(name)
    if known is None and name in result.truth:
        known = Table4Row(parameter=name, unit=found.unit, estimate=None, truth=result.truth[name])
    if known is not None and known.estimate != found.estimate:
        error = None
        if known.truth and found.estimate is not None:
            error = 100 * abs(found.estimate - known.truth) / abs(known.truth)
        known = known.model_copy(update={"error_percent": error})
    number = _number(name, found.estimate, found.std, found.unit)
    bounds = meaning = ABSENT
    if found.ci95 is not None:
        low, high = found.ci95
        bounds = interval(low, high, found.std)
    if name in PARAMETERS:
        meaning = PARAMETERS[name].meaning
    errors = _against(known, found.estimate, found.std)
    return number + (found.status.value, bounds) + errors + (meaning,)


def _number(name: str, value: float | None, std: float | None, unit: str) -> tuple[str, ...]:
    """Name, number, standard deviation, the same in percent, unit."""
    return (
        visible(name),
        resolved(value, std),
        significant(std, 2),
        percent(std, value),
        unit_text(unit),
    )


def _against(
    known: Table4Row | None, value: float | None, std: float | None
) -> tuple[str, str, str]:
    """The truth, the error against it, and the paper's."""
    if known is None:
        return ABSENT, ABSENT, ABSENT
    return (
        significant(known.truth, max(digits_of(value, std), 5)),
        significant(known.error_percent, 4),
        significant(known.paper_error_percent, 4),
    )


def _prediction(fit: FitSummary) -> Table:
    """How well the model predicts the torque: of the logs used, and of each log by the others."""
    rows: list[tuple[str, ...]] = []
    filters: list[str] = []
    states: list[str] = []
    for where, prediction in (
        ("logs used", fit.residual),
        ("each log by the others", fit.cross_validation),
    ):
        if prediction is None:
            continue
        for joint in range(2):
            rmse = significant(prediction.rmse[joint], 3)
            share = significant(100 * prediction.nrmse[joint], 3)
            rows.append((where, str(joint + 1), rmse, share, f"{prediction.r2[joint]:.5f}"))
        by_filter = visible(prediction.filter)
        if by_filter not in filters:
            filters.append(by_filter)
        text = by_state(prediction)
        if text:
            states.append(f" RMSE of {where}: {text}.")
    note = f"Filter: {'; '.join(filters)}.{''.join(states)}"
    return Table("Torque prediction", PREDICTION_COLUMNS, tuple(rows), note)


_STATES = (
    ("rmse_moving", "moving"),
    ("rmse_rest", "at rest"),
    ("rmse_held", "at rest beyond ± f of dry friction"),
)


def by_state(found: TorquePrediction) -> str:
    """The RMSE of joints that move and of joints that stand, in words; empty where none stands."""
    if found.rmse_rest is None or found.rmse_rest == (None, None):
        return ""
    parts = []
    for joint in range(2):
        known = []
        for name, words in _STATES:
            pair = getattr(found, name)
            if pair is not None and pair[joint] is not None:
                known.append(f"{significant(pair[joint], 3)} {words}")
        if known:
            parts.append(f"joint {joint + 1} {', '.join(known)}")
    return f"{'; '.join(parts)} (N m)"
