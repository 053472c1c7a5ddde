"""Information of a motion about an arm, by the likelihood of `refined`, and its derivatives.

The information of a log is S = Yᵀ V⁻¹ Y with V = Σ_τ + G Σ_θ Gᵀ (`algid.estimators.whitening`).
White noise of σ at R samples a second is, below half of r samples a second, white noise of σ √(r /
R) at r: a motion of a few hertz is weighed at 50 to 100 samples a second.

======  ==========================================================  ==================
symbol  name                                                        shape
======  ==========================================================  ==================
S       information on the shared parameters, all runs together     (Q, Q)
Y       regressor along the motion                                  (2, q, N)
P       derivatives of the torque by θ, ω, α                        (3, 2, 2, N)
W       V⁻¹ Y, rows by joint                                        (q, 2, N)
A       derivative of a function of S                               (Q, Q)
dY, dP  derivatives of Y and P by θ1, θ2, ω1, ω2, α1, α2            (6, ...)
======  ==========================================================  ==================

For a fixed A, d tr(A S) = 2 tr(A Wᵀ dY) − 2 tr(A Wᵀ dG Σ_θ Gᵀ W): Y and P are functions of the
motion at one instant, so six differences at all instants at once give the derivative by the whole
motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from algid.arm import FloatArray
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import NoiseLevels, adjoint, along_stencil, multipliers, whitened
from algid.model import Model, Motion, partials, regressor
from algid.signals.differences import POINTS, Stencil

_STEP = 1e-5  # of the central differences, rad, rad/s, rad/s²: their error is its square
COMPONENTS = 6


@dataclass(frozen=True, eq=False)
class Experiment:
    """What a campaign measures, and with what noise.

    Parameters
    ----------
    shared : Shared
        Which parameters are estimated.
    runs : (int, int)
        Runs of the motion without and with the payload.
    noise : NoiseLevels
        Of the samples as they are recorded.
    rate : float, Hz
        At which the logs are recorded.
    """

    shared: Shared
    runs: tuple[int, int]
    noise: NoiseLevels
    rate: float

    @property
    def kinds(self) -> tuple[bool, ...]:
        """Whether there are runs of each kind, as `loaded`."""
        return tuple(loaded for loaded, runs in zip((False, True), self.runs, strict=True) if runs)


class Sensitivities:
    """Regressor and torque derivatives along a motion at `rate` Hz, and theirs by the motion."""

    def __init__(self, model: Model, motion: Motion, rate: float) -> None:
        self.model, self.motion, self.rate = model, motion, rate

    @cached_property
    def Y(self) -> FloatArray:
        """Regressor (2, q, N)."""
        return regressor(self.model, self.motion)

    @cached_property
    def dY(self) -> FloatArray:
        """Its derivatives (6, 2, q, N)."""
        return self._differences(lambda motion: regressor(self.model, motion))

    def dP(self, c: FloatArray) -> FloatArray:
        """Derivatives (6, 3, 2, 2, N) of the torque's derivatives at the coefficients `c` (q,)."""
        return self._differences(lambda motion: partials(self.model, c, motion))

    def _differences(self, function: Callable[[Motion], FloatArray]) -> FloatArray:
        """Central differences (6, ...) of a function of the motion by each of its components."""
        signals, slopes = np.stack([self.motion.theta, self.motion.omega, self.motion.alpha]), []
        for move in _STEP * np.eye(COMPONENTS).reshape(COMPONENTS, 3, 2, 1):
            ahead, behind = Motion(*(signals + move)), Motion(*(signals - move))
            slopes.append((function(ahead) - function(behind)) / (2 * _STEP))
        return np.stack(slopes)


class Information:
    """Information on the shared parameters at `beta` of a campaign that repeats one motion.

    Parameters
    ----------
    experiment : Experiment
    beta : (Q,), the arm's parameters
    slopes : Sensitivities
        Of the motion at equal steps in time. What lies beyond its ends counts as rest.
    """

    def __init__(self, experiment: Experiment, beta: FloatArray, slopes: Sensitivities) -> None:
        shared, noise = experiment.shared, experiment.noise
        self._slopes, self._noise = slopes, noise
        self._weights = Stencil(1 / slopes.rate).weights
        # of each kind of run c, T, what its information counts for, and H, L and Z
        self._logs = []
        for loaded in experiment.kinds:
            c, T, Y = shared.coefficients(beta, loaded), shared.jacobian(beta, loaded), slopes.Y
            if shared.delay:  # a torque that is late by dt differs by its slope times dt
                torque = np.einsum("aqn,q->an", Y, c[: Y.shape[1]])
                slope = np.gradient(torque, 1 / slopes.rate, axis=1)
                Y = np.concatenate([Y, slope[:, None]], axis=1)
            G = along_stencil(partials(slopes.model, c, slopes.motion), self._weights)
            # samples at another rate than is recorded weigh as many times more
            count = experiment.runs[loaded] * (experiment.rate / slopes.rate)
            self._logs.append((c, T, count, *whitened(Y.swapaxes(0, 1), G, noise)))

    @cached_property
    def S(self) -> FloatArray:
        """Information (Q, Q) of all runs."""
        return self.parts(self._slopes.Y.shape[2])[0]

    def parts(self, samples: int) -> FloatArray:
        """Information (B, Q, Q) of each `samples` samples of the motion.

        The last part holds what is left too, or by itself where that is half as many.
        """
        total = []
        starts = 2 * samples * np.arange(max(1, round(self._slopes.Y.shape[2] / samples)))
        for _, T, count, _, _, Z in self._logs:
            pieces = np.split(Z, starts[1:], axis=1)
            total.append(count * T.T @ np.stack([part @ part.T for part in pieces]) @ T)
        return np.sum(total, axis=0)

    def gradient(self, A: FloatArray) -> FloatArray:
        """Derivative (6, N) of tr(A S) by the motion, for a symmetric A (Q, Q).

        The column of a delay counts as one that stays.
        """
        slopes, noise = self._slopes, self._noise
        ratio = noise.theta[None, :] / noise.tau[:, None]
        q, n = slopes.Y.shape[1:]
        to_Y, total = np.zeros_like(slopes.Y), np.zeros((COMPONENTS, n))
        for c, T, count, H, factor, Z in self._logs:
            W = multipliers(factor, Z)
            AW = np.tensordot(count * T @ A @ T.T, W, axes=1)
            to_Y += 2 * AW[:q].transpose(1, 0, 2) / noise.tau[:, None, None]
            back = adjoint(H, W, 0, n + POINTS - 1)  # Gᵀ W
            windows = np.lib.stride_tricks.sliding_window_view(back, n, axis=2)
            along = np.tensordot(self._weights, windows, axes=(1, 2))
            to_P = -2 * np.einsum("qan,oqbn->oabn", AW, along) * ratio[None, :, :, None]
            total += np.einsum("oabn,coabn->cn", to_P, slopes.dP(c))
        return total + np.einsum("aqn,caqn->cn", to_Y, slopes.dY)
