"""Torques that drive a simulated arm.

A torque maps times (M,) in s to (2, M) N m. Smooth torques are plain callables; a sampled one also
says where it is not smooth, so that the integrator can step onto those instants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from algid.arm import Arm, FloatArray

Torque = Callable[[FloatArray], FloatArray]
Hold = Literal["zoh", "foh"]


@dataclass(frozen=True)
class MultiSine:
    """Torque of joint i, Σ_j a_ij sin(2π f_ij t + φ_ij); in N m, Hz and rad."""

    amplitude: tuple[tuple[float, ...], ...]
    frequency: tuple[tuple[float, ...], ...]
    phase: tuple[tuple[float, ...], ...]

    def __call__(self, t: FloatArray) -> FloatArray:
        """Torque (2, M) in N m at the times `t` (M,) in s."""
        torques = []
        for a, f, p in zip(self.amplitude, self.frequency, self.phase, strict=True):
            angle = 2 * np.pi * np.multiply.outer(t, f) + np.array(p)
            torques.append(np.sin(angle) @ np.array(a))
        return np.stack(torques)


def wide_multi_sine(arm: Arm, seed: int = 0) -> MultiSine:
    """Six harmonics from 0.3 to 8 Hz with random phases, strong enough to swing any arm well about.

    Each joint's amplitudes scale with what its gravity, its friction at 4 rad/s and its inertia at
    40 rad/s² ask for.
    """
    k1, k2, k3, k4, k5, k6, k7 = arm.constants()
    need = (k4 + k2 + 4 * k6 + 40 * (k5 + k3 + 2 * k1), k2 + 4 * k7 + 40 * k3)
    frequency = tuple(np.geomspace(0.3, 8.0, 6).tolist())
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 6))
    return MultiSine(
        amplitude=tuple((0.6 * float(force),) * 6 for force in need),
        frequency=(frequency, frequency),
        phase=tuple(map(tuple, phases.tolist())),
    )


def no_torque(t: FloatArray) -> FloatArray:
    """No torque at all: (2, M) zeros for the times `t` (M,)."""
    return np.zeros((2, t.size))


@dataclass(frozen=True, eq=False)
class SampledTorque:
    """Torque known at samples: held until the next one (`zoh`) or joined by straight lines (`foh`).

    Parameters
    ----------
    t : (N,) float64, s, increasing
    tau : (2, N) float64, N m
    hold : 'zoh' or 'foh'

    Outside the samples the first and the last value hold.
    """

    t: FloatArray
    tau: FloatArray
    hold: Hold = "zoh"

    def __call__(self, t: FloatArray) -> FloatArray:
        """Torque (2, M) in N m at the times `t` (M,) in s."""
        if self.hold == "foh":
            return np.stack([np.interp(t, self.t, row) for row in self.tau])
        index = np.searchsorted(self.t, t, side="right") - 1
        held: FloatArray = self.tau[:, np.clip(index, 0, None)]
        return held
