"""A design's folder: the trajectory for controllers, players and people, and what it predicts.

``trajectory.csv``, ``.parquet`` and ``.mcap``, ``joint_trajectory.yaml``, ``design.json`` and
``report.html`` with predicted deviations, active limits, the motion, and a verdict.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from algid import __version__
from algid.arm import FloatArray
from algid.base.files import whole_file
from algid.base.text import ABSENT, counted, file_name, percent, resolved, significant, unit_text
from algid.designs.campaign import ARMS, SECOND, Planned, of_joints
from algid.designs.limits import Row
from algid.log import Log, Origin
from algid.model import UNITS
from algid.notices import Notice, Remedy, Verdict, graded
from algid.report.document import Document, Section, Table
from algid.report.figures import shares_of_time
from algid.report.plot import ArmDrawing, Panels
from algid.report.render import page, write_texts

# a second, of the joint trajectory: its controller joins them by polynomials of fifth degree
POINTS = 50.0
SCHEMA_VERSION = 2


def write_design(design: Planned, folder: Path) -> None:
    """Write everything into `folder`. Raises `OutputError`."""
    from algid.writers import write_log

    frame = design.to_frame()
    with whole_file(folder / "trajectory.csv") as temporary:
        frame.write_csv(temporary)
    with whole_file(folder / "trajectory.parquet") as temporary:
        frame.write_parquet(temporary)
    stamps, tau = np.round(design.t * 1e9).astype(np.int64), design.torque[min(design.torque)]
    log = Log(
        stamps,
        design.motion.theta,
        tau,
        Origin("trajectory.mcap", "design", {}),
        design.motion.omega,
    )
    write_log(folder / "trajectory.mcap", log)
    texts = {
        "design.json": design_json(design),
        "report.html": page(design_document(design)),
        "joint_trajectory.yaml": joint_trajectory(design),
    }
    write_texts(folder, texts)


def joint_trajectory(design: Planned) -> str:
    """The motion as trajectory_msgs/JointTrajectory in YAML, for a joint_trajectory_controller."""
    every = max(1, round(design.campaign.experiment.rate / POINTS))
    places = np.append(np.arange(0, design.t.size - 1, every), design.t.size - 1)
    lines = [
        "# trajectory_msgs/msg/JointTrajectory, planned by algid design.",
        (
            "# Angles in rad: the first joint's from the horizontal (gravity pulls along -y), the "
            "second's from link 1."
        ),
        (
            "# Hanging straight down is (-1.5708, 0). Move the arm slowly to the first point "
            "before it is played."
        ),
        "header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}",
        f"joint_names: {json.dumps(list(design.campaign.joints), ensure_ascii=False)}",
        "points:",
    ]
    motion = design.motion
    signals = {
        "- positions": motion.theta,
        "  velocities": motion.omega,
        "  accelerations": motion.alpha,
    }
    for place in places:
        for name, signal in signals.items():
            lines.append(f"{name}: {(signal[:, place].round(9) + 0.0).tolist()}")
        seconds, nanoseconds = divmod(round(float(design.t[place]) * 1e9), 10**9)
        lines.append(f"  time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}")
    return "\n".join(lines) + "\n"


def design_json(design: Planned) -> str:
    """The text of ``design.json``: everything that decides the design, what it predicts."""
    campaign = design.campaign
    experiment, limits = campaign.experiment, campaign.limits
    noise = of_joints("theta", experiment.noise.theta) | of_joints("tau", experiment.noise.tau)
    used = []
    for row, share in design.binding:
        joint = None if row.joint is None else row.joint + 1
        about = {"limit": row.limit, "joint": joint, "loaded": row.loaded}
        used.append(about | {"allowed": row.allowed, "most": row.reached(share), "share": share})
    content = {
        "schema_version": SCHEMA_VERSION,
        "version": __version__,
        "prior": campaign.source,
        "command": campaign.command,
        "verdict": asdict(verdict(design)),
        "drive": "position",
        "duration": campaign.duration,
        "rate": experiment.rate,
        "runs": {"unloaded": experiment.runs[0], "loaded": experiment.runs[1]},
        "seed": campaign.seed,
        "noise": {name: float(level) for name, level in noise.items()},
        "gravity": experiment.shared.model.gravity,
        "parameters": _parameters(design),
        "largest_relative_bound": design.largest,
        "limits": {
            **{name: _finite(limit) for name, limit in limits.allowed.items()},
            "range": [_finite(np.round(end, 12)) for end in limits.ends],
            "tip_height": limits.height if np.isfinite(limits.height) else None,
            "margin": campaign.margin,
        },
        "used": used,
        "start": design.motion.theta[:, 0].tolist(),
        "joints": list(campaign.joints),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _parameters(design: Planned) -> dict[str, dict[str, Any]]:
    """By name what is believed of a parameter, and the error bars that the campaign will give."""
    asked, belief = design.campaign.asked, design.campaign.belief
    facts = {}
    for place, name in enumerate(design.names):
        facts[name] = {
            "believed": float(belief.mean[place]),
            "believed_std": float(belief.std[place]),
            "std": float(design.std[place]),
            "relative": float(design.relative[place]) if asked.known[place] else None,
            "worst_std": float(design.worst[place]),
            "unit": UNITS[name],
            "asked": bool(asked.wanted[place]),
            "information_by_second": [round(float(share), 4) for share in design.shares[place]],
        }
    return facts


def _finite(values: FloatArray) -> list[float | None]:
    """As JSON has them: null where there is no limit."""
    return [one if np.isfinite(one) else None for one in values.tolist()]


# of what the margin leaves: a limit that is used as far is what keeps the error bars from being
# less
BINDS = 0.98
DRAWN = 2_000  # points of the motion
_YES = {True: "yes", False: ""}
SIGNS = {
    "range": "rad",
    "speed": "rad/s",
    "acceleration": "rad/s²",
    "torque": "N m",
    "tip-height": "m",
}


def design_document(design: Planned) -> Document:
    """The report of a design."""
    campaign, name = design.campaign, file_name(design.campaign.source)
    information = shares_of_time(design.names, design.shares, SECOND)
    return Document(
        verdict=verdict(design),
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


def _arm(design: Planned) -> ArmDrawing | None:
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


def bound_table(design: Planned) -> Table:
    """Every parameter with the error bar that the campaign will give it."""
    rows = []
    for (name, one), size in zip(
        _parameters(design).items(), design.campaign.asked.size, strict=True
    ):
        shares = [ABSENT, ABSENT]
        if one["relative"] is not None:
            shares = [percent(one[std], size) for std in ("std", "worst_std")]
        numbers = (resolved(one["believed"], one["std"]), significant(one["std"], 2))
        rows.append(
            (name, *numbers, unit_text(one["unit"]), shares[0], _YES[one["asked"]], shares[1])
        )
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


def limit_table(design: Planned) -> Table:
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


def verdict(design: Planned) -> Verdict:
    """The design in one clause, with reasons: doubts about its prior, undetermined parameters."""
    reasons = []
    if design.open_parameters:
        numbers = {"names": list(design.open_parameters)}
        reasons.append(
            Notice("NOT_REACHED", numbers={"case": "parameters"} | numbers, remedies=_WIDER)
        )
    reasons += design.campaign.doubts
    relative = np.where(design.campaign.asked.wanted, design.relative, -np.inf)
    row, used = design.binding[0]
    return graded(
        f"every parameter asked for to within {percent(design.largest, 1.0)} % (one σ; "
        f"{design.names[int(np.argmax(relative))]} is the least certain); active limit: {row} "
        f"({percent(used, 1.0, 3)} %)",
        reasons,
    )


def motion(design: Planned) -> Panels:
    """Angles, velocities and torques of both joints over time, with their limits."""
    limits, planned = design.campaign.limits, design.motion
    allowed = limits.allowed
    series = {
        "Angles, rad": (planned.theta, *limits.ends),
        "Velocities, rad/s": (planned.omega, -allowed["speed"], allowed["speed"]),
    }
    for loaded, torque in design.torque.items():
        kind = {True: "loaded", False: "unloaded"}[loaded]
        series[f"Torques, {kind}, N m"] = (torque, -allowed["torque"], allowed["torque"])
    panels = Panels("motion", list(series))
    every = max(1, design.t.size // DRAWN)
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
