"""Noise levels from the data: restricted maximum likelihood of variance components.

The covariance of the whitened torque residual is V = Σ V_i, one component for the angle noise and
one for the torque noise of each joint. With λ = V⁻¹e the derivative of the restricted likelihood
by log σ_i² is

    ½ (λᵀ V_i λ − tr(V⁻¹ V_i) + tr(S⁻¹ Yᵀ V⁻¹ V_i V⁻¹ Y))

whose traces, the degrees of freedom of a component, are taken with random signs (Hutchinson 1989).
The average information ½ λᵀ V_i V⁻¹ V_j λ (Gilmour, Thompson & Cullis 1995) makes a Newton step of
it.

=========  ==========================================  ==============
symbol     name                                        shape
=========  ==========================================  ==============
component  order: angle 1, angle 2, torque 1, torque 2  (4,)
=========  ==========================================  ==============
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.quantiles import medians
from algid.estimators.combine import scaled_pinv
from algid.estimators.whitening import Linearised, NoiseLevels, adjoint, forward

_DIFFERENCE = 6  # order of the difference that leaves only noise of a smooth signal
_FED_BACK = 0.9
"""Of the torque's white level: a controller makes more than that of its encoders' noise."""
_LAGS = 32  # samples that a controller's torque rests on
_MOST_SAMPLES = 8192
_FEWEST_SAMPLES = 10 * 2 * _LAGS
_RIDGE = 1e-9  # of the angles' sums of squares
_PROBES = 8
_GROWING = 1.0  # standard deviations of the score
_LARGEST_STEP = 2.0  # in log σ²
_SMALLEST = 1e-12  # relative to the signal: below it floating point is the noise
# of the other joint's torque: what bearings and cables exert on a joint without a motor, at least
_MOTORLESS = 1e-3


@dataclass(frozen=True, eq=False)
class VarianceScore:
    """Sums: λᵀV_iλ (4,), traces (4,), average information (4, 4), YᵀV⁻¹V_iV⁻¹Y (4, q, q)."""

    power: FloatArray
    trace: FloatArray
    average: FloatArray
    absorbed: FloatArray

    def __add__(self, other: VarianceScore) -> VarianceScore:
        return VarianceScore(
            self.power + other.power,
            self.trace + other.trace,
            self.average + other.average,
            self.absorbed + other.absorbed,
        )


@dataclass(frozen=True, eq=False)
class Components:
    """What each component has in the residual of a linearised piece, in its units.

    Parameters
    ----------
    back : (2, N)
        Hᵀλ, of the angles.
    smeared : (2, n)
        Fᵀλ, of the torques.
    whitened : (4, 2 n)
        L⁻¹V_iλ.
    """

    back: FloatArray
    smeared: FloatArray
    whitened: FloatArray

    @classmethod
    def of(cls, linear: Linearised, multiplier: FloatArray, length: int) -> Components:
        """Those of a piece with λ = L⁻ᵀL⁻¹e (2 n,), its angles `length` samples long."""
        H, first = linear.H, linear.first
        residual = _by_joint(multiplier)
        back, smeared = adjoint(H, residual, first, length), linear.smeared_back(residual)
        directions = np.stack(
            [
                forward(H, _only(back, 0), first),
                forward(H, _only(back, 1), first),
                linear.smeared(_only(smeared, 0)),
                linear.smeared(_only(smeared, 1)),
            ]
        )
        return cls(back, smeared, linear.solve_in_place(_by_row(directions)))

    def response(self, linear: Linearised, noise: NoiseLevels) -> FloatArray:
        """Derivative (4, 2, N) of the most likely angles by each log σ_i², in rad.

        Of Σ_θ Gᵀ V⁻¹e it is −Σ_θ Gᵀ V⁻¹ V_i V⁻¹e, and Gᵀ V⁻¹e for an angle's own variance.
        """
        length = self.back.shape[1]
        rows = linear.solve_transposed(self.whitened)
        backs = [adjoint(linear.H, _by_joint(row), linear.first, length) for row in rows]
        change = -np.stack(backs)
        for joint in range(2):
            change[joint, joint] += self.back[joint]
        return change * noise.theta[:, None]


def first_guess(theta: FloatArray, tau: FloatArray) -> NoiseLevels:
    """White noise of angles and torques, from their sixth differences.

    Smooth motion leaves nothing in those.

    Parameters
    ----------
    theta, tau : (2, N), rad and N m, N at least 7

    Returns
    -------
    NoiseLevels
        The differences' median size over 0.6745 √C(12, 6); their root mean square where most of
        them are zero. Of the torques' differences, what a controller makes of the angles' noise is
        left out.

    Notes
    -----
    The torque of a joint without a motor is logged as zero, and is none exactly: its bearings rub,
    its cables pull.
    """
    rms = np.sqrt(np.mean(tau**2, axis=1))
    least = np.where(rms > 0, 0.0, _MOTORLESS * rms.max())
    levels, own = _white_noise(tau), _white_noise(tau, _not_fed_back(theta, tau))
    levels = np.where(own < _FED_BACK * levels, own, levels)
    return NoiseLevels(_white_noise(theta), np.maximum(levels, least))


def roughness(tau: FloatArray) -> FloatArray:
    """White noise (2,) with the same sixth differences as the torques (2, N), in N m.

    It is a root mean square: unlike `first_guess` it counts the jumps of the torque between two
    samples that dry friction makes. A motion leaves nothing in it, however slow its error.
    """
    squares = np.mean(np.diff(tau, _DIFFERENCE, axis=1) ** 2, axis=1)
    return np.asarray(np.sqrt(squares / comb(2 * _DIFFERENCE, _DIFFERENCE)))


def _not_fed_back(theta: FloatArray, tau: FloatArray) -> FloatArray:
    """Sixth differences of the torques (2, n), less what the angles up to then explain of them.

    Those of the first `_MOST_SAMPLES`; of all, and with nothing left out, where the angles are too
    few, or not all noise. A controller turns the noise of its encoders into torque, which moves the
    arm and is no noise of the torque.
    """
    angles = np.diff(theta[:, :_MOST_SAMPLES], _DIFFERENCE, axis=1)
    torques = np.diff(tau[:, :_MOST_SAMPLES], _DIFFERENCE, axis=1)
    n = angles.shape[1] - _LAGS
    if n < _FEWEST_SAMPLES or not _is_noise(theta[:, :_MOST_SAMPLES]):
        return np.diff(tau, _DIFFERENCE, axis=1)
    X = np.concatenate([angles[:, _LAGS - lag : _LAGS - lag + n] for lag in range(_LAGS)])
    size = np.sqrt(np.sum(X**2, axis=1)) + 1e-300
    X = X / size[:, None]
    own = torques[:, _LAGS:]
    law = np.linalg.solve(X @ X.T + _RIDGE * np.eye(len(X)), X @ own.T)
    return np.asarray(own - law.T @ X)


def _is_noise(signal: FloatArray) -> bool:
    """Whether each row's next difference grows as white noise's does: no motion is left in it."""
    difference = np.diff(signal, _DIFFERENCE, axis=1)
    first = medians(np.abs(difference))
    second = medians(np.abs(np.diff(difference, axis=1)))
    order = _DIFFERENCE
    growth = np.sqrt(comb(2 * order + 2, order + 1) / comb(2 * order, order))
    return bool(np.all(np.abs(second - growth * first) < 0.1 * growth * first))


def _white_noise(signal: FloatArray, difference: FloatArray | None = None) -> FloatArray:
    """White noise (2,) behind a signal (2, N), by its sixth differences or those given."""
    if difference is None:
        difference = np.diff(signal, _DIFFERENCE, axis=1)
    # The median of squares, so that steps in the signal do not count as noise.
    median = medians(np.abs(difference)) / 0.6745
    mean = np.sqrt(np.mean(difference**2, axis=1))
    spread = np.where(median > 0, median, mean)
    size = np.abs(signal).max(axis=1) + 1e-300
    return np.maximum(spread / np.sqrt(comb(2 * _DIFFERENCE, _DIFFERENCE)), _SMALLEST * size)


def quantum(signal: FloatArray) -> FloatArray:
    """Step of the encoder behind each row of a signal.

    Parameters
    ----------
    signal : (m, N), unit u

    Returns
    -------
    (m,), unit u; 0 where the values lie on no grid, or change fewer than eight times.
    """
    return np.array([_step(row) for row in signal])


def _step(values: FloatArray) -> float:
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9 * (np.abs(values).max() + 1e-300)]
    smallest = float(steps.min(initial=np.inf))
    near = steps[steps < 50 * smallest]
    if near.size < 8:
        return 0.0
    step = float(np.sum(near) / np.sum(np.round(near / smallest)))
    off_grid = np.abs(near / step - np.round(near / step))
    if off_grid.max() >= 0.02:
        return 0.0
    return step


def variance_score(
    linear: Linearised, multipliers: FloatArray, components: Components, seed: int
) -> VarianceScore:
    """Contribution of one linearised piece.

    Parameters
    ----------
    linear : Linearised
    multipliers : (q + 1, 2 n)
        L⁻ᵀ of its columns.
    components : Components
        Of the last of them.
    seed : int
        Of the random signs of the traces.
    """
    H, first, length = linear.H, linear.first, components.back.shape[1]
    rows = linear.columns.shape[1]
    parts = components.back, components.smeared
    power = np.concatenate([np.sum(part**2, axis=1) for part in parts])
    joints = np.stack([_by_joint(row) for row in multipliers[:-1]])
    backs = np.stack([adjoint(H, joint, first, length) for joint in joints])
    smears = linear.smeared_back(joints)
    absorbed = [backs[:, 0] @ backs[:, 0].T, backs[:, 1] @ backs[:, 1].T]
    absorbed += [smears[:, 0] @ smears[:, 0].T, smears[:, 1] @ smears[:, 1].T]
    return VarianceScore(
        power,
        _traces(linear, length, rows, seed),
        0.5 * components.whitened @ components.whitened.T,
        np.stack(absorbed),
    )


def _traces(linear: Linearised, length: int, rows: int, seed: int) -> FloatArray:
    H, first, n = linear.H, linear.first, rows // 2
    on_torques, on_angles = _signs(seed, linear.torques, length)
    probes = np.zeros((_PROBES, 4, n, 2))  # in the rows' order from the beginning
    felt, products = np.empty((2, n)), np.empty((2, n))
    for probe, angles in zip(probes, on_angles.astype(np.float64), strict=True):
        for joint in range(2):
            felt[:] = 0.0
            for point in range(H.shape[2]):  # as `forward` of the one joint's signs
                touched = angles[joint, first + point : first + point + n]
                np.multiply(H[:, joint, point], touched, out=products)
                felt += products
            probe[joint] = felt.T
    signs = linear.smeared(on_torques.astype(np.float64))
    for joint in range(2):
        probes[:, 2 + joint, :, joint] = signs[:, joint]
    whitened = linear.solve_in_place(probes.reshape(-1, rows))
    powers = np.sum(np.square(whitened, out=whitened), axis=1)
    return np.asarray(powers.reshape(_PROBES, 4).mean(axis=0))


@lru_cache(maxsize=32)
def _signs(seed: int, torques: int, angles: int) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """Random signs of torques (`_PROBES`, 2, n) and angles (`_PROBES`, 2, N); fixed for a piece."""
    signs = np.random.default_rng(seed)
    on_torques = np.empty((_PROBES, 2, torques), dtype=np.int8)
    on_angles = np.empty((_PROBES, 2, angles), dtype=np.int8)
    for probe in range(_PROBES):
        on_torques[probe] = signs.choice([-1.0, 1.0], (2, torques))
        on_angles[probe] = signs.choice([-1.0, 1.0], (2, angles))
    return on_torques, on_angles


def _by_joint(row: FloatArray) -> FloatArray:
    return np.ascontiguousarray(row.reshape(-1, 2).T)


def _by_row(joints: FloatArray) -> FloatArray:
    """(m, 2, n) as rows (m, 2 n) of sample and joint."""
    return np.ascontiguousarray(joints.swapaxes(1, 2)).reshape(joints.shape[0], -1)


def _only(signal: FloatArray, joint: int) -> FloatArray:
    """A signal (..., 2, n) of one joint, that of the other nothing."""
    kept = np.zeros_like(signal)
    kept[..., joint, :] = signal[..., joint, :]
    return kept


def newton_step(noise: NoiseLevels, score: VarianceScore, S: FloatArray) -> NoiseLevels:
    """Better noise levels by one average-information step (Gilmour, Thompson & Cullis 1995).

    The step changes σ² by a factor of at most e², but for a component that is not seen yet.

    Parameters
    ----------
    noise : NoiseLevels
    score : VarianceScore
        At these levels.
    S : (q, q)
        Information on the coefficients, whose freedom is not the noise's.
    """
    inverse = scaled_pinv(S)
    freedom = score.trace - np.einsum("xy,ixy->i", inverse, score.absorbed)
    gradient = 0.5 * (score.power - freedom)
    size = np.diag(score.average)
    curvature = score.average + np.diag(0.05 * np.maximum(size, 1.0))
    step = np.clip(np.linalg.solve(curvature, gradient), -_LARGEST_STEP, _LARGEST_STEP)
    # In log σ² the slope vanishes with σ²: a component that the residual does not see yet, and
    # whose score grows, goes to where it is seen, at an information of 1 (which goes as σ⁴).
    unseen = (size < 1.0) & (gradient > _GROWING * np.sqrt(size))
    step = np.where(unseen, np.maximum(step, -0.5 * np.log(np.maximum(size, 1e-300))), step)
    factor = np.exp(0.5 * step)
    return NoiseLevels(noise.theta * factor[:2], noise.tau * factor[2:])


def log_ratio(before: NoiseLevels, after: NoiseLevels) -> FloatArray:
    """Change (4,) of each component's log variance."""
    ratio = np.concatenate([after.theta / before.theta, after.tau / before.tau])
    return np.asarray(2 * np.log(ratio))


def floored(noise: NoiseLevels, floor: NoiseLevels) -> NoiseLevels:
    """Levels no smaller than `floor`."""
    return NoiseLevels(np.maximum(noise.theta, floor.theta), np.maximum(noise.tau, floor.tau))
