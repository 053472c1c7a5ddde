"""Tables of a result: its estimates, then fit, logs, settings and provenance.

A column that holds nothing but dashes is dropped, so that a table says only what is known. What
shows a table makes its text visible.
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
    yes_or_no,
)
from algid.notices import NAMED
from algid.report.document import Table
from algid.results import Estimate, FitSummary, LogSummary, Result, Status, TorquePrediction
from algid.results.rows import known_truth, rows_of

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
    rows = []
    for one in rows_of(result, estimates):
        known = (one.status, one.share, one.truth, one.error, one.meaning)
        rows.append((one.name, one.value, one.half, one.unit, *known))
    return Table(
        title,
        "Parameter | Estimate | ± 95 % | Unit | Status | ±, % | Truth | Error, % | Meaning",
        tuple(rows),
    ).without_empty()


def arm_tables(result: Result) -> tuple[Table, ...]:
    """The arm first: its constants, its payload and the stiffness of its joints."""
    constants = {name: one for name, one in result.parameters.items() if name in CONSTANT_NAMES}
    stiffness = result.fit.stiffness if result.fit else {}
    return (
        estimates_table("Constants", constants, result),
        estimates_table("Payload", result.payload, result),
        estimates_table("Stiffness of elastic joints", stiffness, result),
    )


def nuisance_tables(result: Result) -> tuple[Table, Table]:
    """The terms beside eq. (1): those that differ from zero, and those that may be zero."""
    other, zero = dict[str, Estimate](), dict[str, Estimate]()
    for name, one in result.parameters.items():
        if name not in CONSTANT_NAMES:
            (zero if one.status is Status.NOT_SIGNIFICANT else other)[name] = one
    return (
        estimates_table("Other terms of the torque", other, result),
        estimates_table("Terms whose interval holds zero", zero, result),
    )


def paper_tables(result: Result) -> tuple[Table, ...]:
    """The payload by the paper's route, the loaded arm, and its Table 4 where a truth is known."""
    rows = []
    for row in result.table4 if known_truth(result) else ():
        half = None if row.std is None else result.quantile * row.std
        errors = [significant(one, 4) for one in (row.error_percent, row.paper_error_percent)]
        numbers = (resolved(row.estimate, row.std), significant(half, 2), unit_text(row.unit))
        rows.append((row.parameter, *numbers, significant(row.truth), *errors))
    return (
        estimates_table("Payload by the paper's route", result.paper_payload, result),
        estimates_table("Loaded arm", result.loaded, result),
        Table(
            "Table 4",
            "Parameter | Estimate | ± 95 % | Unit | Truth | Error, % | Paper, %",
            tuple(rows),
            "Names and order of the paper's Table 4; Paper, % is the error it reports. The paper "
            "does not state its torque: that of the synthetic cases was sought for this table.",
        ).without_empty(),
    )


def prediction_table(fit: FitSummary) -> Table:
    """How well the model predicts the torque: of the logs used, and of each log by the others."""
    rows, notes = [], list[str]()
    for where, one in (
        ("logs used", fit.residual), ("each log by the others", fit.cross_validation)
    ):  # fmt: skip
        if one is None:
            continue
        for joint, rmse, nrmse, r2 in zip("12", one.rmse, one.nrmse, one.r2, strict=True):
            numbers = (significant(rmse, 3), significant(100 * nrmse, 3), f"{r2:.5f}")
            rows.append((where, joint, *numbers))
        states = by_state(one)
        notes += [f"Filter: {one.filter}.", *([f"RMSE of {where}: {states}."] if states else [])]
    return Table(
        "Torque prediction",
        "Torque predicted | Joint | RMSE, N m | RMSE / RMS, % | R²",
        tuple(rows),
        " ".join(dict.fromkeys(notes)),
    )


def by_state(found: TorquePrediction) -> str:
    """The RMSE of joints that move and of joints that stand, in words; empty where none stands."""
    if found.rmse_rest in (None, (None, None)):
        return ""
    parts = []
    for joint in range(2):
        known = []
        for name, words in STATES:
            rmse = (getattr(found, name) or (None, None))[joint]
            if rmse is not None:
                known.append(f"{significant(rmse, 3)} {words}")
        if known:
            parts.append(f"joint {joint + 1} {', '.join(known)}")
    return f"{'; '.join(parts)} (N m)"


def terms_table(fit: FitSummary) -> Table:
    """Optional terms of the torque and their worth."""
    rows = []
    for term in fit.terms:
        change = None if term.gain_heldout is None else -100 * term.gain_heldout or 0.0  # no −0.00
        numbers = ((term.delta_bic, "+.1f"), (change, "+.2f"), (term.evidence, "+.1f"))
        cells = (formatted(value, form) for value, form in numbers)
        rows.append((term.term, *cells, yes_or_no(term.kept), term.why))
    note = ""
    if any(term.delta_bic is not None for term in fit.terms):
        note = "A negative change of BIC favours the term."
    if fit.model is not None and fit.model.held_out is not None:
        note = (
            f"Held-out error: squared, of whole {fit.model.held_out}, each predicted from the "
            "others; negative: the term lowers it. A term is kept if it does and its log odds are "
            "positive."
        )
    return Table(
        "Terms tried",
        "Term | Change of BIC | Held-out error, % | Log odds | Kept | Why",
        tuple(rows),
        note,
    ).without_empty()


def fit_tables(fit: FitSummary) -> tuple[Table, ...]:
    """Noise of the logs, whiteness of the residual, and bounds of physics that are broken."""
    noise, tests, bounds = [], [], []
    for name, std in fit.noise.items():
        noise.append((name, significant(std, 3), "N m" if name.startswith("tau") else "rad"))
    for name, test in fit.whiteness.items():
        numbers = (significant(test.p_value, 2), f"{test.lag1_correlation:.3f}")
        tests.append((name, yes_or_no(test.white), *numbers))
    for one in fit.broken_bounds:
        bounds.append((one.bound, significant(one.value, 4), significant(one.distance_sigma, 2)))
    return (
        Table(
            "Noise of the logs",
            "Signal | Noise, std | Unit",
            tuple(noise),
        ),
        Table(
            "Whiteness of the residual",
            "Residual | White | p-value | Lag-one correlation",
            tuple(tests),
            f"The intervals rest on {INTERVALS_REST_ON[fit.intervals]}.",
        ),
        Table(
            "Physical bounds that are broken",
            "Bound | Value | Broken by, σ",
            tuple(bounds),
        ),
    )


def log_tables(logs: Sequence[LogSummary]) -> tuple[Table, Table]:
    """`logs`, and from which channel each signal was taken, once for all logs that share it."""
    rows, taken = [], dict[tuple[str, str], list[str]]()
    for log in logs:
        numbers = (f"{log.rows:,}", f"{log.duration:.6g}", f"{log.rate:.6g}")
        rows.append((file_name(log.path), log.role, log.format, *numbers))
        for pair in log.mapping.items():
            taken.setdefault(pair, []).append(file_name(log.path))
    channels = []
    for pair, names in taken.items():
        these = joined(names)
        if len(names) > NAMED:
            these = f"{names[0]} and {len(names) - 1} more"
        channels.append((*pair, "all logs" if len(names) == len(logs) else these))
    return (
        Table(
            "Logs",
            "Log | Arm | Format | Samples | Duration, s | Rate, Hz",
            tuple(rows),
        ),
        Table("Channels", "Signal | Taken from | Log", tuple(channels)),
    )


def settings_table(settings: Mapping[str, Any]) -> Table:
    """Settings by dotted name."""
    rows = tuple(flat_settings(settings).items())
    return Table("Settings", "Setting | Value", rows)


def result_settings(result: Result) -> Table:
    """What was asked for, what the logs decided, and how the first log of each kind was read."""
    settings, decided = dict(result.settings), dict[str, Any]()
    model, delay, fit = result.torque_model, result.delay, result.fit
    if model is not None:
        decided["terms"] = ", ".join(model.terms) or "plain"
        if "coulomb" in model.terms:
            decided["Coulomb friction over"] = f"{significant(model.coulomb_speed, 2)} rad/s"
    if delay is not None and delay.estimate is not None:
        decided["delay"] = f"{1e3 * delay.estimate:.3g} ms".replace("-", "−")
    if fit is not None and fit.torque_hold is not None:
        decided["torque_hold"] = fit.torque_hold.used
    for log in reversed(result.logs):
        if log.reading is not None:
            read = {name.replace("_", " "): getattr(log.reading, name) for name in CONVENTIONS}
            settings[f"{log.role} log"] = read
    return settings_table(settings | {"used": decided})


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


def provenance_table(rows: Sequence[tuple[str, str]], logs: Sequence[LogSummary]) -> Table:
    """What made a result: `rows` of names and values, and the files of its logs."""
    every = list(rows)
    for log in logs:
        every.append((f"path of {file_name(log.path)}", log.path))
        every.append((f"sha256 of {file_name(log.path)}", log.sha256 or "unknown, fetched in part"))
    return Table("Provenance", "What | Value", tuple(every))
