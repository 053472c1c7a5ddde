"""A recorded log in SI units, and where it came from.

=========  ==============================  ========  =======
name       meaning                         shape     unit
=========  ==============================  ========  =======
stamp_ns   time stamps                     (N,)      ns, int64
theta      joint angles θ1, θ2             (2, N)    rad
tau        joint torques τ1, τ2            (2, N)    N m
omega      joint velocities, if recorded   (2, N)    rad/s
=========  ==============================  ========  =======

Time runs along the last axis, here and everywhere in algid.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from algid.arm import Arm, FloatArray

IntArray = NDArray[np.int64]

CANONICAL_COLUMNS = ("t", "theta1", "theta2", "tau1", "tau2")
VELOCITY_COLUMNS = ("omega1", "omega2")


@dataclass(frozen=True)
class Truth:
    """The arm and the payload (kg) behind a synthetic log, and the case they are taken from.

    `schedule` holds pairs of time in s and payload from then on, where the payload changes during the log.
    """

    arm: Arm
    payload: float
    case: str | None = None
    schedule: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Notice:
    """Something a reader saw that its user should know.

    `code` is a fixed word such as ``DUPLICATE_STAMPS``; `lossy` tells that samples are missing from the log.
    """

    code: str
    text: str
    lossy: bool = False


@dataclass(frozen=True)
class Origin:
    """Where a log came from: its file, format, each channel's source, and a synthetic log's truth."""

    path: str
    format: str
    mapping: dict[str, str]
    truth: Truth | None = None


@dataclass(frozen=True, eq=False)
class Log:
    """Samples of one log, or of a stretch of it: see the table above. Stamps strictly increase."""

    stamp_ns: IntArray
    theta: FloatArray
    tau: FloatArray
    origin: Origin
    omega: FloatArray | None = None
    notices: tuple[Notice, ...] = ()

    def __post_init__(self) -> None:
        rows = self.stamp_ns.size
        for name, channel in (("theta", self.theta), ("tau", self.tau), ("omega", self.omega)):
            if channel is not None and channel.shape != (2, rows):
                raise ValueError(f"{name} must have shape (2, {rows}), got {channel.shape}")

    def __len__(self) -> int:
        return self.stamp_ns.size

    @property
    def t(self) -> FloatArray:
        """Time (N,) in s since the first sample."""
        return (self.stamp_ns - self.stamp_ns[0]) * 1e-9

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9

    @property
    def period(self) -> float:
        """Median time between samples in s."""
        return float(np.median(np.diff(self.stamp_ns))) * 1e-9

    def part(self, first: int, last: int) -> Log:
        """Samples `first` to `last` - 1 of this log, as views."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[first:last],
            theta=self.theta[:, first:last],
            tau=self.tau[:, first:last],
            omega=None if self.omega is None else self.omega[:, first:last],
        )


def join(blocks: Iterable[Log]) -> Log:
    """One log out of the blocks of a reader, in their order; the notices add up.

    Raises
    ------
    ValueError
        If there is no block.
    """
    parts = list(blocks)
    if not parts:
        raise ValueError("a log needs at least one block, got none")
    if len(parts) == 1:
        return parts[0]
    omegas = [part.omega for part in parts if part.omega is not None]
    return replace(
        parts[0],
        stamp_ns=np.concatenate([part.stamp_ns for part in parts]),
        theta=np.concatenate([part.theta for part in parts], axis=1),
        tau=np.concatenate([part.tau for part in parts], axis=1),
        omega=np.concatenate(omegas, axis=1) if omegas else None,
        notices=tuple(notice for part in parts for notice in part.notices),
    )
