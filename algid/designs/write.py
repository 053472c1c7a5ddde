"""A design's folder: the trajectory for controllers, players and people, and what it predicts.

``trajectory.csv``, ``.parquet`` and ``.mcap``, ``joint_trajectory.yaml``, ``design.json``,
``report.html``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid import __version__
from algid.arm import FloatArray
from algid.base.files import whole_file
from algid.designs.campaign import Design
from algid.designs.page import design_document, verdict
from algid.log import Log, Origin
from algid.model import UNITS
from algid.notices import Notice
from algid.report.render import page, write_texts

if TYPE_CHECKING:
    import polars as pl

    from algid.report.document import Document

# a second, of the joint trajectory: its controller joins them by polynomials of fifth degree
POINTS = 50.0
SCHEMA_VERSION = 2


@dataclass(frozen=True)
class Planned:
    """A planned motion, and where it comes from.

    Parameters
    ----------
    design : Design
    source : str, the prior's file
    command : str, the command line behind it
    joints : names of the joints
    doubts : of the prior
    """

    design: Design
    source: str
    command: str = ""
    joints: tuple[str, str] = ("joint1", "joint2")
    doubts: Sequence[Notice] = ()

    def __repr__(self) -> str:
        return f"Planned({', '.join(f'{name} ± {std:.2g}' for name, std in self.bounds.items())})"

    @property
    def open_parameters(self) -> list[str]:
        """Names of those asked for whose error bar is as large as they are."""
        return self.design.open_parameters

    @property
    def bounds(self) -> dict[str, float]:
        """By parameter the standard deviation that is to be expected."""
        return dict(zip(self.design.names, self.design.std.tolist(), strict=True))

    def to_frame(self) -> pl.DataFrame:
        """The trajectory of ``trajectory.csv``: time, angle, velocity, acceleration, torque."""
        import polars as pl

        columns = {"t": self.design.t}
        for name in ("theta", "omega", "alpha"):
            columns |= _of_joints(name, getattr(self.design.motion, name))
        for name, torque in zip(("tau", "loaded_tau"), self.design.torque.values(), strict=False):
            columns |= _of_joints(name, torque)
        return pl.DataFrame(columns)

    def document(self) -> Document:
        """Its report."""
        return design_document(self.design, self.source, self.doubts)

    def as_json(self) -> str:
        """The text of ``design.json``: everything that decides the design, what it predicts."""
        return json.dumps(_content(self), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_design(planned: Planned, folder: Path) -> None:
    """Write everything into `folder`. Raises `OutputError`."""
    from algid.writers import write_log

    design, frame = planned.design, planned.to_frame()
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
        "design.json": planned.as_json(),
        "report.html": page(planned.document()),
        "joint_trajectory.yaml": joint_trajectory(design, planned.joints),
    }
    write_texts(folder, texts)


def _of_joints(name: str, rows: FloatArray) -> dict[str, FloatArray]:
    """The rows of a signal (2, N), or its values (2,), by the joints' names."""
    return {f"{name}1": rows[0], f"{name}2": rows[1]}


def joint_trajectory(design: Design, joints: tuple[str, str]) -> str:
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
    return str([round(float(value), 9) + 0.0 for value in values])


def _content(planned: Planned) -> dict[str, Any]:
    """What ``design.json`` holds."""
    design = planned.design
    campaign = design.campaign
    experiment, limits = campaign.experiment, campaign.limits
    noise = _of_joints("theta", experiment.noise.theta) | _of_joints("tau", experiment.noise.tau)
    used = []
    for row, share in design.binding:
        joint = None if row.joint is None else row.joint + 1
        about = {"limit": row.limit, "joint": joint, "loaded": row.loaded}
        used.append(about | {"allowed": row.allowed, "most": row.reached(share), "share": share})
    return {
        "schema_version": SCHEMA_VERSION,
        "version": __version__,
        "prior": planned.source,
        "command": planned.command,
        "verdict": asdict(verdict(design, planned.doubts)),
        "drive": "position",
        "duration": campaign.duration,
        "rate": experiment.rate,
        "runs": {"unloaded": experiment.runs[0], "loaded": experiment.runs[1]},
        "seed": campaign.seed,
        "interrupted": design.interrupted,
        "noise": {name: float(level) for name, level in noise.items()},
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
        "used": used,
        "start": design.motion.theta[:, 0].tolist(),
        "joints": list(planned.joints),
    }


def _parameter(design: Design, place: int) -> dict[str, Any]:
    """What is believed of a parameter, and the error bars that the campaign will give it."""
    asked = design.campaign.asked
    return {
        "believed": float(design.campaign.belief.mean[place]),
        "believed_std": float(design.campaign.belief.std[place]),
        "std": float(design.std[place]),
        "relative": float(design.relative[place]) if asked.known[place] else None,
        "worst_std": float(design.worst[place]),
        "unit": UNITS[design.names[place]],
        "asked": bool(asked.wanted[place]),
        "information_by_second": [round(float(share), 4) for share in design.shares[place]],
    }


def _finite(values: FloatArray) -> list[float | None]:
    """As JSON has them: null where there is no limit."""
    return [one if np.isfinite(one) else None for one in values.tolist()]
