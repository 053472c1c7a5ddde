"""A design's tables: what every parameter will be known to, and what of the limits is used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.base.text import ABSENT, percent, resolved, significant, unit_text
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.designs.campaign import Design
from algid.designs.limits import Row
from algid.model import UNITS
from algid.notices import Notice, Remedy
from algid.report.document import Kind, Table

# of what the margin leaves: a limit that is used as far is what keeps the error bars from being
# less
BINDS = 0.98
_YES = {True: "yes", False: ""}
SIGNS = {
    "range": "rad",
    "speed": "rad/s",
    "acceleration": "rad/s²",
    "torque": "N m",
    "tip-height": "m",
}


def bound_table(design: Design) -> Table:
    """Every parameter with the error bar that the campaign will give it."""
    asked = design.campaign.asked
    mean = design.campaign.belief.mean
    rows = []
    for place, name in enumerate(design.names):
        relative = worst = ABSENT
        if asked.known[place]:
            relative = percent(design.std[place], asked.size[place])
            worst = percent(design.worst[place], asked.size[place])
        rows.append(
            (
                name,
                resolved(float(mean[place]), float(design.std[place])),
                significant(float(design.std[place]), 2),
                unit_text(UNITS[name]),
                relative,
                _YES[bool(asked.wanted[place])],
                worst,
            )
        )
    columns: dict[str, Kind] = {
        "Parameter": "name", "Believed": "number", "Predicted ±": "number", "Unit": "text",
        "± %": "number", "Requested": "text", "Worst arm ± %": "number",
    }  # fmt: skip
    runs = design.campaign.experiment.runs
    note = (
        f"One standard deviation, from {_runs(runs)} together, if sensors are as noisy as stated. "
        "The worst arm is the worst of 20 drawn from what is believed."
    )
    return Table("Predicted standard deviations", columns, tuple(rows), note)


def _runs(runs: tuple[int, int]) -> str:
    """The numbers of runs of each kind, in words."""
    words = []
    for count, kind in zip(runs, ("unloaded", "loaded"), strict=True):
        if count:
            words.append(counted(count, f"{kind} run"))
    return " and ".join(words)


def limit_table(design: Design) -> Table:
    """Each kind of limit with what is used of it where it is tightest, the tightest kind first."""
    most = 1 - design.campaign.margin
    tightest: dict[str, tuple[Row, float]] = {}
    for row, used in design.binding:
        tightest.setdefault(kind_name(row), (row, used))
    rows = []
    for kind, (row, used) in tightest.items():
        limit, value = amounts(design, row, used)
        rows.append(
            (
                kind,
                significant(value, 4),
                significant(limit, 4),
                percent(used, 1.0, 3),
                _YES[used >= BINDS * most],
                SIGNS[row.limit],
                place_name(row) or ABSENT,
            )
        )
    columns: dict[str, Kind] = {
        "Limit": "name", "Used": "number", "Allowed": "number", "%": "number", "Active": "text",
        "Unit": "text", "Tightest": "text",
    }  # fmt: skip
    note = (
        f"A margin of {percent(design.campaign.margin, 1.0)} % is left for what a controller "
        "overshoots. Torque is the largest that any arm of those believed possible asks for."
    )
    return Table("Active limits", columns, tuple(rows), note)


def kind_name(row: Row) -> str:
    """What a limit is of, in words."""
    if row.limit == "rest":
        return "velocity at the end"
    load = {None: "", True: ", loaded", False: ", unloaded"}[row.loaded]
    return f"{row.limit.replace('-', ' ')}{load}"


def place_name(row: Row) -> str:
    """Where a limit is: a joint, and which way."""
    if row.joint is None:
        return ""
    joint = f"joint {row.joint + 1}"
    if row.limit == "rest":
        return joint
    if row.upper:
        return f"{joint}, up"
    return f"{joint}, down"


def limit_name(row: Row) -> str:
    """A limit, its joint and its side in words."""
    kind, comma, load = kind_name(row).partition(",")
    if row.joint is None:
        return f"{kind}{comma}{load}"
    return f"{kind} of {place_name(row)}{comma}{load}"


def amounts(design: Design, row: Row, used: float) -> tuple[float, float]:
    """A limit and the most extreme value of the motion, in the limit's unit and with its sign."""
    limits = design.campaign.limits
    if row.joint is None:
        reach = float(limits.lengths.sum())
        return limits.height, reach - used * (reach - limits.height)
    if row.limit == "range":
        low, high = float(limits.low[row.joint]), float(limits.high[row.joint])
        middle, half = 0.5 * (low + high), used * 0.5 * (high - low)
        if row.upper:
            return high, middle + half
        return low, middle - half
    limit = float(getattr(limits, row.limit)[row.joint])
    if not row.upper:
        limit = -limit
    return limit, used * limit


_WIDER = tuple(Remedy({name: None}, "widen") for name in ("range", "speed", "torque", "runs"))


def verdict(design: Design, doubts: Sequence[Notice] = ()) -> Verdict:
    """The design in one clause, with reasons: `doubts` about its prior, undetermined parameters."""
    reasons = []
    if design.open_parameters:
        numbers = {"names": list(design.open_parameters)}
        reasons.append(
            Notice("NOT_REACHED", numbers={"case": "parameters"} | numbers, remedies=_WIDER)
        )
    reasons += doubts
    if design.interrupted:
        reasons.append(Notice("NOT_REACHED", numbers={"case": "stopped"}))
    return graded(_headline(design), reasons)


def _headline(design: Design) -> str:
    asked = design.campaign.asked
    relative = np.where(asked.wanted, design.relative, -np.inf)
    name = design.names[int(np.argmax(relative))]
    row, used = design.binding[0]
    return (
        f"every parameter asked for to within {percent(design.largest, 1.0)} % (one σ; {name} is "
        f"the least certain); active limit: {limit_name(row)} ({percent(used, 1.0, 3)} %)"
    )
