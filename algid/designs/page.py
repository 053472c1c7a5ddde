"""A design's report: predicted deviations, active limits, the motion, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.base.text import ABSENT, counted, file_name, percent, resolved, significant, unit_text
from algid.base.verdict import Verdict, graded
from algid.designs.campaign import ARMS, SECOND, Design
from algid.designs.limits import Row
from algid.model import UNITS
from algid.notices import Notice, Remedy
from algid.report.document import Document, Section, Table
from algid.report.figures import shares_of_time
from algid.report.plot import ArmDrawing, Panels

# of what the margin leaves: a limit that is used as far is what keeps the error bars from being
# less
BINDS = 0.98
POINTS = 2_000  # of the motion that are drawn
_YES = {True: "yes", False: ""}
SIGNS = {
    "range": "rad",
    "speed": "rad/s",
    "acceleration": "rad/s²",
    "torque": "N m",
    "tip-height": "m",
}


def design_document(design: Design, source: str, doubts: Sequence[Notice] = ()) -> Document:
    """The report of a design for the arm that `source` describes."""
    campaign, name = design.campaign, file_name(source)
    information = shares_of_time(design.names, design.shares, SECOND)
    return Document(
        verdict=verdict(design, doubts),
        sections=(
            Section("numbers", "Numbers", (bound_table(design), limit_table(design))),
            Section("motion", "The motion", (motion(design),)),
            Section("information", "Information by time", (information,)),
        ),
        kicker="a planned identification",
        name=name,
        facts=f"{significant(campaign.duration, 4)} s under position control · logged at "
        f"{significant(campaign.experiment.rate, 4)} Hz · prior {name}",
        arm=_arm(design),
    )


def _arm(design: Design) -> ArmDrawing | None:
    """The arm's drawing; nothing where its lengths are not known."""
    limits = design.campaign.limits
    if not np.all(np.isfinite(limits.lengths)):
        return None
    l1, l2 = limits.lengths.tolist()
    payload = ""
    if design.campaign.experiment.runs[1]:
        mass = float(design.campaign.belief.mean[list(design.names).index("m_p")])
        payload = f"payload of {significant(mass, 3)} kg"
    reading = "Play the motion: is the space around the arm free? The grey line is the tip's path"
    height = limits.height if np.isfinite(limits.height) else None
    if height is not None:
        reading += ", the red one its limit"
    return ArmDrawing(l1, l2, design.t, design.motion.theta, f"{reading}.", payload, height)


def bound_table(design: Design) -> Table:
    """Every parameter with the error bar that the campaign will give it."""
    asked = design.campaign.asked
    mean = design.campaign.belief.mean
    rows = []
    for place, name in enumerate(design.names):
        std, worst = design.std[place], design.worst[place]
        shares = [ABSENT, ABSENT]
        if asked.known[place]:
            shares = [percent(one, asked.size[place]) for one in (std, worst)]
        numbers = (resolved(float(mean[place]), float(std)), significant(float(std), 2))
        wanted = _YES[bool(asked.wanted[place])]
        rows.append((name, *numbers, unit_text(UNITS[name]), shares[0], wanted, shares[1]))
    kinds = zip(design.campaign.experiment.runs, ("unloaded", "loaded"), strict=True)
    runs = " and ".join(counted(count, f"{kind} run") for count, kind in kinds if count)
    note = (
        f"One standard deviation, from {runs} together, if sensors are as noisy as stated. "
        f"The worst arm is the worst of {ARMS} drawn from what is believed."
    )
    return Table(
        "Predicted standard deviations",
        "Parameter | Believed | Predicted ± | Unit | ± % | Requested | Worst arm ± %",
        tuple(rows),
        note,
    )


def limit_table(design: Design) -> Table:
    """Each kind of limit with what is used of it where it is tightest, the tightest kind first."""
    most = 1 - design.campaign.margin
    tightest: dict[str, tuple[Row, float]] = {}
    for row, used in design.binding:
        tightest.setdefault(row.kind, (row, used))
    rows = []
    for kind, (row, used) in tightest.items():
        value = row.reached(used)
        numbers = (significant(value, 4), significant(row.allowed, 4), percent(used, 1.0, 3))
        binds = _YES[used >= BINDS * most]
        rows.append((kind, *numbers, binds, SIGNS[row.limit], row.place or ABSENT))
    note = (
        f"A margin of {percent(design.campaign.margin, 1.0)} % is left for what a controller "
        "overshoots. Torque is the largest that any arm of those believed possible asks for."
    )
    return Table(
        "Active limits",
        "Limit | Used | Allowed | % | Active | Unit | Tightest",
        tuple(rows),
        note,
    )


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
    relative = np.where(design.campaign.asked.wanted, design.relative, -np.inf)
    row, used = design.binding[0]
    return graded(
        f"every parameter asked for to within {percent(design.largest, 1.0)} % (one σ; "
        f"{design.names[int(np.argmax(relative))]} is the least certain); active limit: {row} "
        f"({percent(used, 1.0, 3)} %)",
        reasons,
    )


def motion(design: Design) -> Panels:
    """Angles, velocities and torques of both joints over time, with their limits."""
    limits, planned = design.campaign.limits, design.motion
    series = {
        "Angles, rad": (planned.theta, limits.low, limits.high),
        "Velocities, rad/s": (planned.omega, -limits.speed, limits.speed),
    }
    for loaded, torque in design.torque.items():
        kind = {True: "loaded", False: "unloaded"}[loaded]
        series[f"Torques, {kind}, N m"] = (torque, -limits.torque, limits.torque)
    panels = Panels("motion", list(series))
    every = max(1, design.t.size // POINTS)
    for place, (values, *sides) in enumerate(series.values()):
        size = float(np.abs(values).max())
        for joint in range(2):
            name = f"joint {joint + 1}"
            panels.add(place, design.t[::every], values[joint, ::every], name)
            for side in sides:
                if abs(side[joint]) < 3 * size:  # a limit far away would flatten the motion
                    panels.mark(place, name, float(side[joint]), way="y")
    panels.axes(len(series) - 1, "time, s")
    return panels
