"""The momentum form of the equations of motion on sliding windows (method of modulating functions).

Multiplied by a window φ that vanishes with three derivatives at both ends, and integrated by parts, eq. (1)
needs no acceleration, and a velocity only beside k1:

    ∫φ τ1 = (k5+k3)∫φ'' θ1 + k1[−2∫φ' c2 θ̇1 + ∫φ'' s2] + k3∫φ'' θ2 − k6∫φ' θ1 + k4∫φ cos θ1 + k2∫φ cos(θ1+θ2)
    ∫φ τ2 = k3∫φ''(θ1+θ2) + k1[−∫φ' c2 θ̇1 + ∫φ (θ̇1² + θ̇1 θ̇2) s2] − k7∫φ' θ2 + k2∫φ cos(θ1+θ2)

======  =========================================================  ================  ======
symbol  name                                                       shape             unit
======  =========================================================  ================  ======
φ       window s^4 (1 - s)^4, integral 1, and two derivatives      (3, L)            s^-1…
h       samples from a window to the next, L / `OVERLAP`           scalar            1
X       columns of the two equations, the torque's moment last     (2, q + 1, R)     mixed
======  =========================================================  ================  ======

The windows overlap `OVERLAP`-fold. Each signal meets each block of h samples once, in a matrix product; a
window's moment is the sum over its blocks. The cost is O(N), whatever the length of the window.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial

from algid.arm import FloatArray
from algid.model import Model, sine_cosine
from algid.signals.filters import correlate, differentiator, half_length
from algid.signals.segments import Segment

OVERLAP = 8
_WINDOW = Polynomial([0, 1]) ** 4 * Polynomial([1, -1]) ** 4
_WINDOW_INTEGRAL = 1 / 630  # Beta(5, 5)


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of `length` s every `length / OVERLAP` s on samples `dt` s apart.

    `shift` is the time in s after which a logged torque acts; `bandwidth` in Hz is the differentiator's, None
    where the log's own velocities are used.
    """

    dt: float
    length: float
    shift: float = 0.0
    bandwidth: float | None = 40.0

    @cached_property
    def step(self) -> int:
        """h: samples from a window to the next."""
        return max(1, round(self.length / self.dt / OVERLAP))

    @cached_property
    def whole(self) -> int:
        """Whole samples in the shift."""
        return round(self.shift / self.dt)

    @cached_property
    def margin(self) -> int:
        """Samples before the first and after the last window, a multiple of h."""
        reach = 0 if self.bandwidth is None else half_length(self.dt, self.bandwidth)
        return self.step * -(-max(reach, abs(self.whole)) // self.step)

    @property
    def overlap(self) -> int:
        """Samples that consecutive pieces must share, so that no window is lost between them."""
        return 2 * self.margin + (OVERLAP - 1) * self.step

    def kernels(self, offset: float = 0.0) -> FloatArray:
        """φ, φ' and φ'' (3, L) at the samples plus `offset` samples, times dt: weights of a quadrature."""
        length = OVERLAP * self.step
        s = np.clip((np.arange(length) + offset) / length, 0, 1)
        span = length * self.dt
        window = _WINDOW / _WINDOW_INTEGRAL
        return (
            np.stack(
                [window.deriv(order)(s) / span ** (order + 1) if order else window(s) / span for order in range(3)]
            )
            * self.dt
        )

    @cached_property
    def _plain(self) -> FloatArray:
        return self.kernels()

    @cached_property
    def _shifted(self) -> FloatArray:
        return self.kernels(self.shift / self.dt - self.whole)

    def moments(self, signals: FloatArray, kernel: FloatArray) -> FloatArray:
        """Integrals (m, R) of kernel (L,) times each signal (m, R + OVERLAP - 1 blocks of h)."""
        rows = signals.shape[1] // self.step
        blocks = signals[:, : rows * self.step].reshape(signals.shape[0], rows, self.step)
        parts = blocks @ np.ascontiguousarray(kernel.reshape(OVERLAP, self.step).T)
        wanted = rows - OVERLAP + 1
        result = np.zeros((signals.shape[0], wanted))
        for part in range(OVERLAP):
            result += parts[:, part : part + wanted, part]
        return result

    def equations(self, model: Model, piece: Segment, delay: bool) -> FloatArray:
        """X (2, q + 1, R), or (2, q + 2, R) with a column for a change of `shift`; R = 0 for a short piece."""
        size = len(model.names) + delay + 1
        margin = self.margin
        if (len(piece) - 2 * margin) // self.step < OVERLAP:
            return np.zeros((2, size, 0))
        inner = slice(margin, len(piece) - margin)
        theta = piece.theta[:, inner]
        tau = piece.tau[:, margin - self.whole : len(piece) - margin - self.whole]
        weight, slope, bend = self._plain
        omega = self._velocity(piece)
        (s1, s2), (c1, c2) = sine_cosine(theta)
        momentum = c2 * omega[0]
        centripetal = omega[0] * (omega[0] + omega[1]) * s2
        theta_slope1, theta_slope2, momentum_slope = self.moments(np.stack([*theta, momentum]), slope)
        theta_bend1, theta_bend2, s2_bend = self.moments(np.stack([*theta, s2]), bend)
        weighed = [centripetal, c1, c1 * c2 - s1 * s2]
        if model.coulomb:
            weighed += list(np.tanh(omega / model.coulomb_speed))
        centripetal_, c1_, c12_, *friction = self.moments(np.stack(weighed), weight)
        X = np.zeros((2, size, c1_.size))
        column = {name: X[:, place] for place, name in enumerate(model.names)}
        column["k1"][0] = s2_bend - 2 * momentum_slope
        column["k1"][1] = centripetal_ - momentum_slope
        column["k3"][:] = theta_bend1 + theta_bend2
        column["k5"][0] = theta_bend1
        column["k6"][0] = -theta_slope1
        column["k7"][1] = -theta_slope2
        if model.gravity != 0:
            column["k2"][:] = c12_
            column["k4"][0] = c1_
        if model.coulomb:
            column["f1"][0], column["f2"][1] = friction
        if model.offset:
            column["o1"][0] = column["o2"][1] = 1.0
        if model.rotor:
            column["j2"][1] = theta_bend2
        if delay:
            X[:, -2] = -self.moments(tau, self._shifted[1])
        X[:, -1] = self.moments(tau, self._shifted[0])
        return X

    def _velocity(self, piece: Segment) -> FloatArray:
        inner = slice(self.margin, len(piece) - self.margin)
        if self.bandwidth is None:
            if piece.omega is None:
                raise ValueError("the log has no velocities: give the differentiator's bandwidth")
            return piece.omega[:, inner]
        reach = half_length(self.dt, self.bandwidth)
        kernel = differentiator(self.dt, self.bandwidth)
        return correlate(piece.theta[:, self.margin - reach : len(piece) - self.margin + reach], kernel)
