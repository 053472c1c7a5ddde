"""Angles that jump by a turn, made continuous across the blocks of a log."""

from __future__ import annotations

import math

import numpy as np

from algid.arm import FloatArray

_TURN = 2 * math.pi


class Unwrapper:
    """Adds whole turns where an angle jumps, for the joints that a profile says so of."""

    def __init__(self, joints: tuple[bool, bool]) -> None:
        self._joints = joints
        self._last = [math.nan, math.nan]  # each joint's last angle as recorded
        self._turns = [0.0, 0.0]

    def run(self, theta: FloatArray) -> None:
        """Unwrap the next angles (2, N), rad, in place."""
        for joint in (0, 1):
            if self._joints[joint] and theta.shape[1]:
                start = theta[joint, 0] if math.isnan(self._last[joint]) else self._last[joint]
                raw = np.concatenate([[start], theta[joint]])
                turns = self._turns[joint] - np.cumsum(np.rint(np.diff(raw) / _TURN))
                self._last[joint], self._turns[joint] = raw[-1], turns[-1]
                theta[joint] += _TURN * turns
