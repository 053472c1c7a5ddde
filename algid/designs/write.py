"""A design's folder: the trajectory for controllers, players and people, and what it will tell.

``trajectory.csv``, ``.parquet`` and ``.mcap``, ``joint_trajectory.yaml``, ``design.json``,
``report.html``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from algid import __version__
from algid.arm import FloatArray
from algid.designs.campaign import Design
from algid.designs.page import page_html
from algid.designs.tables import amounts, verdict
from algid.files import whole_file
from algid.log import Log, Origin
from algid.model import UNITS, Motion
from algid.notices import Notice

# a second, of the joint trajectory: its controller joins them by polynomials of fifth degree
POINTS = 50.0
SCHEMA_VERSION = 2


@dataclass(frozen=True)
class Provenance:
    """Origin of a design: its prior's file and doubts, command line, and names of the joints."""

    source: str
    command: str
    joints: tuple[str, str] = ("joint1", "joint2")
    doubts: Sequence[Notice] = ()


def write_design(design: Design, folder: Path, origin: Provenance) -> None:
    """Write everything into `folder`. Raises `OutputError`."""
    import polars as pl

    from algid.writers import write_log

    frame = pl.DataFrame(trajectory(design))
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
    write_log(folder / "trajectory.mcap", log, kind="mcap")
    texts = {
        "design.json": design_json(design, origin),
        "report.html": page_html(design, origin.source, origin.doubts),
    }
    if design.campaign.drive == "position":
        texts["joint_trajectory.yaml"] = joint_trajectory(design, origin.joints)
    for name, text in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def trajectory(design: Design) -> dict[str, FloatArray]:
    """The trajectory's columns: time, angles, velocities, accelerations, feed-forward torques."""
    columns = {"t": design.t, **_signals(design.motion, ("theta", "omega", "alpha"))}
    first = min(design.torque)
    columns |= {f"tau{joint + 1}": design.torque[first][joint] for joint in range(2)}
    if True in design.torque and not first:
        if design.motions[True] is not design.motion:
            columns |= {
                f"loaded_{name}": values
                for name, values in _signals(design.motions[True], ("theta",)).items()
            }
        columns |= {f"loaded_tau{joint + 1}": design.torque[True][joint] for joint in range(2)}
    return columns


def _signals(motion: Motion, names: Sequence[str]) -> dict[str, FloatArray]:
    return {
        f"{name}{joint + 1}": getattr(motion, name)[joint] for name in names for joint in range(2)
    }


def joint_trajectory(design: Design, joints: tuple[str, str]) -> str:
    """The motion as trajectory_msgs/JointTrajectory in YAML, for a joint_trajectory_controller."""
    every = max(1, round(design.campaign.experiment.rate / POINTS))
    places = [*range(0, design.t.size - 1, every), design.t.size - 1]
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
        f"joint_names: {json.dumps(list(joints), ensure_ascii=False)}",
        "points:",
    ]
    motion = design.motion
    for place in places:
        nanoseconds = round(float(design.t[place]) * 1e9)
        lines += [
            f"- positions: {_numbers(motion.theta[:, place])}",
            f"  velocities: {_numbers(motion.omega[:, place])}",
            f"  accelerations: {_numbers(motion.alpha[:, place])}",
            f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}",
        ]
    return "\n".join(lines) + "\n"


def _numbers(values: FloatArray) -> str:
    return f"[{', '.join(repr(round(float(value), 9) + 0.0) for value in values)}]"


def design_json(design: Design, origin: Provenance) -> str:
    """The text of ``design.json``: everything that decides the design, and what it predicts."""
    return json.dumps(content(design, origin), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def content(design: Design, origin: Provenance) -> dict[str, Any]:
    """What ``design.json`` holds."""
    campaign = design.campaign
    experiment, limits = campaign.experiment, campaign.limits
    return {
        "schema_version": SCHEMA_VERSION,
        "version": __version__,
        "prior": origin.source,
        "command": origin.command,
        "verdict": asdict(verdict(design, origin.doubts)),
        "drive": campaign.drive,
        "duration": campaign.duration,
        "rate": experiment.rate,
        "runs": {"unloaded": experiment.runs[0], "loaded": experiment.runs[1]},
        "seed": campaign.seed,
        "interrupted": design.interrupted,
        "noise": {
            f"{name}{joint + 1}": float(values[joint])
            for name, values in (("theta", experiment.noise.theta), ("tau", experiment.noise.tau))
            for joint in range(2)
        },
        "gravity": experiment.shared.model.gravity,
        "parameters": {name: _parameter(design, place) for place, name in enumerate(design.names)},
        "largest_relative_bound": design.largest,
        "limits": {
            "range": [_finite(limits.low), _finite(limits.high)],
            "speed": _finite(limits.speed),
            "acceleration": _finite(limits.acceleration),
            "torque": _finite(limits.torque),
            "tip_height": limits.height if np.isfinite(limits.height) else None,
            "margin": campaign.margin,
        },
        "used": [
            {
                "limit": row.limit,
                "joint": None if row.joint is None else row.joint + 1,
                "loaded": row.loaded,
                "allowed": limit,
                "most": value,
                "share": used,
            }
            for row, used in design.binding
            for limit, value in [amounts(design, row, used)]
        ],
        "start": design.motion.theta[:, 0].tolist(),
        "joints": list(origin.joints),
    }


def _parameter(design: Design, place: int) -> dict[str, Any]:
    asked = design.campaign.asked
    known = bool(asked.known[place])
    return {
        "believed": float(design.campaign.belief.mean[place]),
        "believed_std": float(design.campaign.belief.std[place]),
        "std": float(design.std[place]),
        "relative": float(design.relative[place]) if known else None,
        "worst_std": float(design.worst[place]),
        "unit": UNITS[design.names[place]],
        "asked": bool(asked.wanted[place]),
        "information_by_second": [round(float(share), 4) for share in design.shares[place]],
    }


def _finite(values: FloatArray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
