"""Tables of a result: its estimates, then fit, logs, settings and provenance.

A column that holds nothing but dashes is dropped, so that a table says only what is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from algid.methods import settles
from algid.model import DELAYS, PARAMETERS
from algid.report.document import Column, Depth, Table, filled
from algid.report.phasors import moments
from algid.report.series import TorqueLog
from algid.results import (
    Estimate,
    FitSummary,
    LogSummary,
    Result,
    Table4Row,
    TorquePrediction,
)
from algid.results.verdict import replaced_estimator
from algid.text import (
    ABSENT,
    digits_of,
    file_name,
    interval,
    percent,
    resolved,
    significant,
    unit_text,
    visible,
)
from algid.words import counted

LONGEST_VALUE = 4_000  # characters: a command that names many logs is there to be copied


def fit_tables(result: Result) -> tuple[Table, ...]:
    """What a statistical estimator knows beside the estimates: noise, whiteness, bounds."""
    fit = result.fit
    if fit is None:
        return ()
    units = {"theta1": "rad", "theta2": "rad", "tau1": "N m", "tau2": "N m"}
    noise = Table(
        "Noise that the logs carry",
        (Column("Signal", "name"), Column("Noise, std", "number"), Column("Unit", "text")),
        tuple(
            (visible(name), significant(std, 3), units.get(name, ABSENT))
            for name, std in fit.noise.items()
        ),
    )
    how = {
        "likelihood": "the likelihood, which takes it to be white",
        "sandwich": "a sandwich, which lets it be coloured; what differs from run to run is not "
        "in it: give four logs",
        "jackknife": "the larger of a sandwich, which lets it be coloured, and a jackknife over "
        "the logs",
    }
    whiteness = Table(
        "Whiteness of the residual",
        (
            Column("Residual", "name"),
            Column("White", "text"),
            Column("p-value", "number"),
            Column("Lag-one correlation", "number"),
        ),
        tuple(
            (
                visible(name),
                "yes" if test.white else "no",
                significant(test.p_value, 2),
                f"{test.lag1_correlation:.3f}",
            )
            for name, test in fit.whiteness.items()
        ),
        f"The intervals rest on {how[fit.intervals]}.",
    )
    bounds = Table(
        "Physical bounds that are broken",
        (Column("Bound", "name"), Column("Value", "number"), Column("Broken by, σ", "number")),
        tuple(
            (visible(b.bound), significant(b.value, 4), significant(b.distance_sigma, 2))
            for b in fit.broken_bounds
        ),
    )
    shown = filled(noise, whiteness.without_empty(), bounds.without_empty())
    return tuple(table.at(Depth.MARKDOWN) for table in shown)


def terms_tables(result: Result) -> tuple[Table, ...]:
    """Optional terms of the torque and their worth, first in the order if the logs chose them."""
    fit = result.fit
    if fit is None:
        return ()
    rows = tuple(
        (
            visible(term.term),
            ABSENT if term.delta_bic is None else f"{term.delta_bic:+.1f}",
            ABSENT if term.gain_heldout is None else f"{-100 * term.gain_heldout or 0.0:+.2f}",
            ABSENT if term.evidence is None else f"{term.evidence:+.1f}",
            "yes" if term.kept else "no",
            visible(term.why),
        )
        for term in fit.terms
    )
    columns = (
        Column("Term", "name"),
        Column("Change of BIC", "number"),
        Column("Held-out error, %", "number"),
        Column("Log odds", "number"),
        Column("Kept", "text"),
        Column("Why", "text"),
    )
    weighed = any(term.delta_bic is not None for term in fit.terms)
    note = "A negative change says that the term earns its place." if weighed else ""
    if fit.model is not None and fit.model.held_out is not None:
        note = (
            f"Held-out error: squared, of whole {fit.model.held_out}, each predicted from the "
            "others, with the term "
            "beside those kept against without. Log odds: of the term, its price taken off."
        )
    chosen = fit.model is not None and fit.model.chosen_by == "logs"
    table = Table("Terms tried", columns, rows, note, Depth.TERMINAL if chosen else Depth.MARKDOWN)
    return filled(table.without_empty())


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
    rows = tuple(
        (
            file_name(log.path),
            log.role,
            visible(log.format),
            f"{log.rows:,}",
            f"{log.duration:.6g}",
            f"{log.rate:.6g}",
        )
        for log in logs
    )
    channels = tuple(
        (visible(signal), visible(source), file_name(log.path) if place else "all logs")
        for place, log in enumerate(logs)
        if not place
        or log.mapping
        != logs[0].mapping  # named only where its channels differ from the first one's
        for signal, source in log.mapping.items()
    )
    heads = (Column("Signal", "name"), Column("Taken from", "text"), Column("Log", "text"))
    return Table("Logs", columns, rows, depth=Depth.FOLDED), Table(
        "Channels", heads, channels, depth=Depth.PAGE
    )


def settings_table(settings: Mapping[str, Any]) -> Table:
    """The settings, nested ones by their dotted names."""
    rows = tuple(
        (visible(name), visible(value, LONGEST_VALUE))
        for name, value in flat_settings(settings).items()
    )
    return Table(
        "Settings", (Column("Setting", "name"), Column("Value", "text")), rows, depth=Depth.PAGE
    )


def used_settings(result: Result) -> Table:
    """The settings as they were used, and what was asked for where that is something else.

    How the first log of each kind was read stands below them.
    """
    used, asked = flat_settings(result.settings), {}
    for name, value in _found(result).items():
        if value != used.get(name):
            asked[name], used[name] = used.get(name, ABSENT), value
    hold = None if result.fit is None else result.fit.torque_hold
    if hold is not None and hold.asked != hold.used:
        asked["torque_hold"] = hold.asked
    for name in CONVENTIONS:
        read = {
            log.role: setting_text(getattr(log.reading, name))
            for log in reversed(result.logs)
            if log.reading is not None
        }
        words = name.replace("_", " ")
        if len(set(read.values())) == 1:
            used[words] = next(iter(read.values()))
        else:
            used |= {f"{words} of the {role} log": value for role, value in read.items()}
    rows = tuple(
        (visible(name), visible(value, LONGEST_VALUE), visible(asked.get(name, ABSENT)))
        for name, value in used.items()
    )
    columns = (Column("Setting", "name"), Column("Used", "text"), Column("Asked for", "text"))
    return Table("Settings", columns, rows, depth=Depth.PAGE).without_empty()


def _found(result: Result) -> dict[str, str]:
    """The settings that the logs decided: estimator, terms of the torque, delay."""
    values = {"estimator": result.estimator}
    if settles(result.estimator):
        values["model"] = "plain"
    model = None if result.fit is None else result.fit.model
    delay = result.delay
    if model is not None:
        terms = [*model.terms, *(DELAYS if delay is not None else ())]
        shape = f" (Coulomb friction over {significant(model.coulomb_speed, 2)} rad/s)"
        values["model"] = (", ".join(terms) or "plain") + (shape if "coulomb" in terms else "")
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
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, list | tuple):
        return ", ".join(setting_text(item) for item in value)
    return str(value)


def provenance_table(rows: Sequence[tuple[str, str]]) -> Table:
    """What made a result, from what: `rows` of names and values, made visible here."""
    shown = tuple((visible(name), visible(value)) for name, value in rows)
    return Table(
        "Provenance", (Column("What", "name"), Column("Value", "text")), shown, depth=Depth.FOLDED
    )


def result_provenance(result: Result) -> Table:
    """What made the result, from what."""
    asked = replaced_estimator(result)
    estimator = result.estimator if asked is None else f"{result.estimator}, in place of {asked}"
    hashes = [
        (f"sha256 of {file_name(log.path)}", log.sha256 or "unknown, fetched in part")
        for log in result.logs
    ]
    paths = [(f"path of {file_name(log.path)}", log.path) for log in result.logs]
    return provenance_table([("algid", result.version), ("estimator", estimator), *hashes, *paths])


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
    lacking = counted(torque.unpredicted, "sample has", "samples have")
    note = f"{lacking} no predicted torque." if torque.unpredicted else ""
    return (Table("Samples that were used", columns, rows, note, Depth.PAGE),)


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
    groups = {
        "Parameters": result.parameters,
        "Payload": result.payload,
        "Payload by the paper's route": result.paper_payload,
        "Loaded arm": result.loaded,
    }
    tables = [
        Table(
            title,
            ESTIMATE_COLUMNS,
            tuple(_estimate_row(name, one, result) for name, one in group.items()),
        )
        for title, group in groups.items()
    ]
    tables.insert(1, _moments_table(result))
    if any(row.truth is not None for row in result.table4):
        known = [row for row in result.table4 if row.estimate is not None or row.truth is not None]
        rows = tuple(
            (
                *_number(row.parameter, row.estimate, row.std, row.unit),
                *_against(row, row.estimate, row.std),
            )
            for row in known
        )
        note = (
            "Names and order of the paper's Table 4; Paper % is the error it reports. The paper "
            "does not state "
            "its torque: that of the synthetic cases was sought for this table."
        )
        tables.append(Table("Table 4", TABLE4_COLUMNS, rows, note))
    shown = filled(*(table.without_empty() for table in tables))
    if result.verdict.failed:
        shown = tuple(table.doubted() for table in shown)
    return shown + filled(_prediction(result.fit))


def _moments_table(result: Result) -> Table:
    """The moments of a bent arm as sizes and angles; empty of a straight one."""
    columns = (
        Column("Moment", "name"),
        Column("Size", "number"),
        Column("± std", "number"),
        Column("Unit", "text"),
        Column("Angle, 95 %", "number"),
    )
    rows = tuple(
        (
            f"|{name.upper()}|",
            resolved(one.size, one.std),
            significant(one.std, 2),
            unit_text(one.unit),
            one.angle_text,
        )
        for name, one in moments(result).items()
    )
    note = (
        "K = k + i k_s: the angle of K1 is θ2's zero or link 2's centre of mass, that of K2 less "
        "it θ1's zero, that of K4 less θ1's zero the load of joint 1 off link 1's line."
    )
    return Table("Moments off the links' lines", columns, rows, note)


def _estimate_row(name: str, found: Estimate, result: Result) -> tuple[str, ...]:
    """An estimate with what is known against it.

    Truth and errors are Table 4's where it has the parameter, else (k5, k7, l1, l2) the truth
    alone; where Table 4 holds another estimate of the same name, the error is this one's own.
    """
    known = next((row for row in result.table4 if row.parameter == name), None)
    if known is None and name in result.truth:
        known = Table4Row(parameter=name, unit=found.unit, estimate=None, truth=result.truth[name])
    if known is not None and known.estimate != found.estimate:
        error = None
        if known.truth and found.estimate is not None:
            error = 100 * abs(found.estimate - known.truth) / abs(known.truth)
        known = known.model_copy(update={"error_percent": error})
    return (
        *_number(name, found.estimate, found.std, found.unit),
        found.status.value,
        ABSENT if found.ci95 is None else interval(*found.ci95, found.std),
        *_against(known, found.estimate, found.std),
        PARAMETERS[name].meaning if name in PARAMETERS else ABSENT,
    )


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


def _prediction(fit: FitSummary | None) -> Table:
    """How well the model predicts the torque: of the logs used, and of each log by the others."""
    pairs = (
        [("logs used", fit.residual), ("each log by the others", fit.cross_validation)]
        if fit
        else []
    )
    rows = tuple(
        (
            where,
            str(joint + 1),
            significant(prediction.rmse[joint], 3),
            significant(100 * prediction.nrmse[joint], 3),
            f"{prediction.r2[joint]:.5f}",
        )
        for where, prediction in pairs
        if prediction is not None
        for joint in range(2)
    )
    filters = dict.fromkeys(
        visible(prediction.filter) for _, prediction in pairs if prediction is not None
    )
    states = [
        f"{where}: {text}"
        for where, prediction in pairs
        if prediction is not None and (text := by_state(prediction))
    ]
    note = " ".join([f"Filter: {'; '.join(filters)}.", *(f"RMSE of {one}." for one in states)])
    return Table("Torque prediction", PREDICTION_COLUMNS, rows, note)


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
        pairs = [(getattr(found, name), words) for name, words in _STATES]
        known = [
            f"{significant(pair[joint], 3)} {words}"
            for pair, words in pairs
            if pair is not None and pair[joint] is not None
        ]
        if known:
            parts.append(f"joint {joint + 1} {', '.join(known)}")
    return f"{'; '.join(parts)} (N m)" if parts else ""
