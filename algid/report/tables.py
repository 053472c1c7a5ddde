"""Tables of a result: its estimates, then fit, logs, settings and provenance.

A column that holds nothing but dashes is dropped, so that a table says only what is known. What
shows a table makes its text visible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple
from typing import Any

from algid.arm import CONSTANT_NAMES
from algid.base.text import (
    ABSENT,
    as_toml,
    cells,
    file_name,
    joined,
    resolved,
    unit_text,
)
from algid.notices import NAMED, flat
from algid.report.document import Table
from algid.results import Estimate, FitSummary, LogSummary, Result, Status, TorquePrediction
from algid.results.rows import known_truth, rows_of

INTERVALS_REST_ON = {
    "likelihood": "the likelihood, which takes it to be white",
    "sandwich": "a sandwich, which lets it be coloured; what differs from run to run is not "
    "in it: give four logs",
    "jackknife": "the larger of a sandwich, which lets it be coloured, and a jackknife over "
    "the logs",
}


TABLE4 = (
    "{0.parameter} | {1} | {2:~2} | {3} | {0.truth:~5} | {0.error_percent:~4} | "
    "{0.paper_error_percent:~4}"
)
PREDICTION = "{0} | {1} | {2:~3} | {3:~3} | {4:.5f} | {5:~3} | {6:~3} | {7:~3}"
TERM = "{0.term} | {0.delta_bic:+.1f} | {0.evidence:+.1f} | {0.kept} | {0.why}"
WHITENESS = "{0} | {1.white} | {1.p_value:~2} | {1.lag1_correlation:.3f}"
BOUND = "{0.bound} | {0.value:~4} | {0.distance_sigma:~2}"
LOG = "{0} | {1.role} | {1.format} | {1.rows:,} | {1.duration:.6g} | {1.rate:.6g}"


def estimates_table(title: str, estimates: Mapping[str, Estimate], result: Result) -> Table:
    """Estimates with their intervals, the truth where it is known, and what they are."""
    return Table(
        title,
        "Parameter | Estimate | ± 95 % | Unit | Status | ±, % | Truth | Error, % | Meaning",
        [astuple(one) for one in rows_of(result, estimates)],
    )


def parameter_tables(result: Result) -> tuple[list[Table], Table, Table]:
    """The arm; the terms beside eq. (1) that differ from zero; and those that may be zero.

    The arm is its constants, its payload and the stiffness of its joints.
    """
    arm, other, zero = dict[str, Estimate](), dict[str, Estimate](), dict[str, Estimate]()
    for name, one in result.parameters.items():
        may_be = one.status is Status.NOT_SIGNIFICANT
        (arm if name in CONSTANT_NAMES else zero if may_be else other)[name] = one
    parts = {"Constants": arm, "Payload": result.payload}
    parts["Stiffness of elastic joints"] = result.fit.stiffness if result.fit else {}
    return (
        [estimates_table(title, of, result) for title, of in parts.items()],
        estimates_table("Other terms of the torque", other, result),
        estimates_table("Terms whose interval holds zero", zero, result),
    )


def paper_tables(result: Result) -> tuple[Table, ...]:
    """The payload by the paper's route, the loaded arm, and its Table 4 where a truth is known."""
    rows = []
    for row in result.table4 if known_truth(result) else ():
        half = None if row.std is None else result.quantile * row.std
        rows.append(cells(TABLE4, row, resolved(row.estimate, row.std), half, unit_text(row.unit)))
    return (
        estimates_table("Payload by the paper's route", result.paper_payload, result),
        estimates_table("Loaded arm", result.loaded, result),
        Table(
            "Table 4",
            "Parameter | Estimate | ± 95 % | Unit | Truth | Error, % | Paper, %",
            rows,
            "Names and order of the paper's Table 4; Paper, % is the error it reports. The paper "
            "does not state its torque: that of the synthetic cases was sought for this table.",
        ),
    )


def prediction_table(found: Mapping[str, TorquePrediction | None]) -> Table:
    """How well the model predicts the torque, by what is predicted; None is too short to judge.

    Also of joints while they move and while they stand, where one stands at times.
    """
    rows, filters = [], dict[str, None]()
    for where, one in found.items():
        if one is None:
            rows.append((where, "too short", *[ABSENT] * 6))
            continue
        filters[f"Filter: {one.filter}."] = None
        states = one.rmse_moving, one.rmse_rest, one.rmse_held
        for joint in (0, 1):
            values = one.rmse[joint], 100 * one.nrmse[joint], one.r2[joint]
            more = [of and of[joint] for of in states]
            rows.append(cells(PREDICTION, where, joint + 1, *values, *more))
    return Table(
        "Torque prediction",
        "Torque of | Joint | RMSE, N m | RMSE / RMS, % | R² | Moving | At rest | Beyond ± f there",
        rows,
        " ".join(filters),
    )


def terms_table(fit: FitSummary | None) -> Table:
    """Optional terms of the torque and their worth."""
    return Table(
        "Terms tried",
        "Term | Change of BIC | Beyond chance | Kept | Why",
        [cells(TERM, one) for one in (fit.terms if fit else ())],
        "A negative change of BIC, and what is explained beyond chance, favour the term.",
    )


def fit_tables(fit: FitSummary | None) -> tuple[Table, ...]:
    """Noise of the logs, whiteness of the residual, and bounds of physics that are broken."""
    if fit is None:
        return ()
    noise = []
    for name, std in fit.noise.items():
        noise.append(cells("{0} | {1:~3} | {2}", name, std, "N m" if name[:3] == "tau" else "rad"))
    return (
        Table("Noise of the logs", "Signal | Noise, std | Unit", noise),
        Table(
            "Whiteness of the residual",
            "Residual | White | p-value | Lag-one correlation",
            [cells(WHITENESS, *one) for one in fit.whiteness.items()],
            f"The intervals rest on {INTERVALS_REST_ON[fit.intervals]}.",
        ),
        Table(
            "Physical bounds that are broken",
            "Bound | Value | Broken by, σ",
            [cells(BOUND, one) for one in fit.broken_bounds],
        ),
    )


def log_tables(logs: Sequence[LogSummary]) -> tuple[Table, Table]:
    """`logs`, and from which channel each signal was taken, once for all logs that share it."""
    rows, taken = [], dict[tuple[str, str], list[str]]()
    for log in logs:
        rows.append(cells(LOG, file_name(log.path), log))
        for pair in log.mapping.items():
            taken.setdefault(pair, []).append(file_name(log.path))
    channels = []
    for pair, names in taken.items():
        channels.append((*pair, "all logs" if len(names) == len(logs) else joined(names, NAMED)))
    return (
        Table("Logs", "Log | Arm | Format | Samples | Duration, s | Rate, Hz", rows),
        Table("Channels", "Signal | Taken from | Log", channels),
    )


def settings_table(settings: Mapping[str, Any]) -> Table:
    """The settings that are set by dotted name, less those of channels."""
    rows = [one for one in in_words(settings).items() if ".channels." not in one[0]]
    return Table("Settings", "Setting | Value", rows)


def settings_of(result: Result) -> dict[str, str]:
    """What was asked for, how the first log of each kind was read, and what the logs decided."""
    every, fit = dict(result.settings), result.fit
    for log in reversed(result.logs):
        if log.reading is not None:
            every[f"{log.role} log"] = asdict(log.reading)
    if fit is not None:
        every["used"] = fit.model_dump(include={"model": {"terms"}, "torque_hold": {"used"}})
    return in_words(every)


def in_words(settings: Mapping[str, Any]) -> dict[str, str]:
    """The settings that are set, by dotted name, each value as one reads it in a profile."""
    words = {}
    for name, value in flat(settings).items():
        if value not in ("", (), []):
            words[name] = value if isinstance(value, str) else as_toml(value)
    return words


def provenance_table(rows: Sequence[tuple[str, str]], logs: Sequence[LogSummary]) -> Table:
    """What made a result: `rows` of names and values, and the files of its logs."""
    every = list(rows)
    for log in logs:
        every.append((f"path of {file_name(log.path)}", log.path))
        every.append((f"sha256 of {file_name(log.path)}", log.sha256 or "unknown, fetched in part"))
    return Table("Provenance", "What | Value", every)
