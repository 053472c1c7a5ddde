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

from collections.abc import Sequence
from functools import lru_cache
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.quantiles import medians
from algid.estimators.combine import scaled_pinv
from algid.estimators.whitening import (
    Linearised,
    NoiseLevels,
    forward,
    multipliers,
    smeared,
    whiten,
)

_DIFFERENCE = 6  # order of the difference that leaves only noise of a smooth signal
_GAIN, _NEXT = np.sqrt([comb(12, 6), comb(14, 7)])
"""What that difference and the next one make of white noise's deviation."""
_FED_BACK = 0.9
"""Of the torque's white level: a controller makes more than that of its encoders' noise."""
_LAGS = 32  # samples that a controller's torque rests on
_MOST_SAMPLES = 8192
_FEWEST_SAMPLES = 10 * 2 * _LAGS
_RIDGE = 1e-9  # of the angles' sums of squares
_PROBES = 8
_SIGNS = np.array([-1, 1], dtype=np.int8)
_GROWING = 1.0  # standard deviations of the score
_LARGEST_STEP = 2.0  # in log σ²
_SMALLEST = 1e-12  # relative to the signal: below it floating point is the noise
# of the other joint's torque: what bearings and cables exert on a joint without a motor, at least
_MOTORLESS = 1e-3


class VarianceScore(NamedTuple):
    """Sums: λᵀV_iλ (4,), traces (4,), average information (4, 4), YᵀV⁻¹V_iV⁻¹Y (4, q, q)."""

    power: FloatArray
    trace: FloatArray
    average: FloatArray
    absorbed: FloatArray


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
    levels, own = _white_noise(tau, _rough(tau)), _white_noise(tau, _not_fed_back(theta, tau))
    levels = np.where(own < _FED_BACK * levels, own, levels)
    return NoiseLevels(_white_noise(theta, _rough(theta)), np.maximum(levels, least))


def _rough(signal: FloatArray) -> FloatArray:
    """Differences (..., n) that leave only noise of a smooth signal (..., N)."""
    return np.diff(signal, _DIFFERENCE)


def roughness(tau: FloatArray) -> FloatArray:
    """White noise (2,) with the same sixth differences as the torques (2, N), in N m.

    It is a root mean square: unlike `first_guess` it counts the jumps of the torque between two
    samples that dry friction makes. A motion leaves nothing in it, however slow its error.
    """
    return np.asarray(np.sqrt(np.mean(_rough(tau) ** 2, axis=1)) / _GAIN)


def _not_fed_back(theta: FloatArray, tau: FloatArray) -> FloatArray:
    """Sixth differences of the torques (2, n), less what the angles up to then explain of them.

    Those of the first `_MOST_SAMPLES`; of all, and with nothing left out, where the angles are too
    few, or not all noise. A controller turns the noise of its encoders into torque, which moves the
    arm and is no noise of the torque.
    """
    angles, torques = _rough(theta[:, :_MOST_SAMPLES]), _rough(tau[:, :_MOST_SAMPLES])
    n = angles.shape[1] - _LAGS
    if n < _FEWEST_SAMPLES or not _is_noise(angles):
        return _rough(tau)
    X = np.concatenate([angles[:, _LAGS - lag : _LAGS - lag + n] for lag in range(_LAGS)])
    size = np.sqrt(np.sum(X**2, axis=1)) + 1e-300
    X, own = X / size[:, None], torques[:, _LAGS:]
    law = np.linalg.solve(X @ X.T + _RIDGE * np.eye(len(X)), X @ own.T)
    return np.asarray(own - law.T @ X)


def _is_noise(difference: FloatArray) -> bool:
    """Whether each row's next difference grows as white noise's does: no motion is left in it."""
    first = medians(np.abs(difference)) * _NEXT / _GAIN
    second = medians(np.abs(np.diff(difference)))
    return bool(np.all(np.abs(second - first) < 0.1 * first))


def _white_noise(signal: FloatArray, difference: FloatArray) -> FloatArray:
    """White noise (2,) behind a signal (2, N), by its differences (2, n)."""
    # The median of squares, so that steps in the signal do not count as noise.
    median = medians(np.abs(difference)) / 0.6745
    mean = np.sqrt(np.mean(difference**2, axis=1))
    spread = np.where(median > 0, median, mean)
    size = np.abs(signal).max(axis=1) + 1e-300
    return np.maximum(spread / _GAIN, _SMALLEST * size)


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
    linear: Linearised, seed: int = 0
) -> tuple[VarianceScore, FloatArray, FloatArray]:
    """What one linearised piece contributes, and what follows from each log σ_i².

    Parameters
    ----------
    linear : Linearised
    seed : int
        Of the random signs of the traces.

    Returns
    -------
    The contribution, L⁻¹V_iλ (4, 2 n), by which the innovations fall with each log σ_i², and the
    derivative (4, 2, N) of the most likely angles over their noise: of Gᵀ V⁻¹e it is
    −Gᵀ V⁻¹ V_i V⁻¹e, and Gᵀ V⁻¹e for an angle's own variance.
    """
    lambdas = multipliers(linear.factor, linear.columns)
    back, spread = linear.to_angles(lambdas), smeared(lambdas, linear.taps[::-1])
    products = np.stack([x @ x.T for part in (back, spread) for x in part.swapaxes(0, 1)])
    whitened = whiten(linear.factor, _made(linear, back[-1], spread[-1]))
    change = -linear.to_angles(multipliers(linear.factor, whitened))
    change[[0, 1], [0, 1]] += back[-1]
    trace = np.zeros(4)
    for on_angles, on_torques in _signs(seed, back.shape[-1], spread.shape[-1]):
        probe = whiten(linear.factor, _made(linear, on_angles, on_torques))
        trace += np.sum(probe**2, axis=1) / _PROBES
    score = VarianceScore(
        products[:, -1, -1], trace, 0.5 * whitened @ whitened.T, products[:, :-1, :-1]
    )
    return score, whitened, change


def _made(linear: Linearised, angles: FloatArray, torques: FloatArray) -> FloatArray:
    """Torques (4, 2, n) that noise of each joint's angle (2, N) and torque (2, n) alone makes."""
    made = np.zeros((4, *torques.shape))
    for joint in range(2):
        own = [joint]
        made[joint] = forward(linear.H[:, own], angles[own], linear.first)
        made[2 + joint, joint] = smeared(torques[joint], linear.taps)
    return made


@lru_cache(maxsize=32)
def _signs(seed: int, angles: int, torques: int) -> Sequence[tuple[NDArray[Any], NDArray[Any]]]:
    """Random signs of angles (2, N) and torques (2, n), `_PROBES` times; fixed for a piece."""
    draw = np.random.default_rng(seed).choice
    probes = []
    for _ in range(_PROBES):
        on_torques, on_angles = draw(_SIGNS, (2, torques)), draw(_SIGNS, (2, angles))
        probes.append((on_angles, on_torques))
    return probes


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
    return NoiseLevels(*np.exp(0.5 * step).reshape(2, 2) * noise)
