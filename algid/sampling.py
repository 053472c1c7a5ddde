"""Uniform stretches of a log: what every estimator works on.

A log is cut where samples are missing and, where its stamps jitter, put on a uniform time base by a cubic
spline through the recorded samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray


@dataclass(frozen=True, eq=False)
class Segment:
    """Uniformly sampled stretch of one log.

    Parameters
    ----------
    start : float, s
        Time of the first sample since the log's first sample.
    dt : float, s
        Time between samples.
    theta, tau : (2, N) float64, rad and N m
    omega : (2, N) float64, rad/s, or None where the log has no velocities
    continues : bool
        Whether the first sample follows the last one of the segment before by `dt`.
    """

    start: float
    dt: float
    theta: FloatArray
    tau: FloatArray
    omega: FloatArray | None = None
    continues: bool = False

    def __len__(self) -> int:
        return int(self.theta.shape[1])

    @property
    def t(self) -> FloatArray:
        """Time (N,) in s since the log's first sample."""
        return self.start + self.dt * np.arange(len(self), dtype=np.float64)
