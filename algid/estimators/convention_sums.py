"""Sums over a log's windows that compare many conventions at once by moments of mapped angles.

See `algid.estimators.conventions` for what a convention is, and for why zeros, signs and order of
torques need no pass over the log of their own.

======  ==================================================================  ================
symbol  name                                                                shape
======  ==================================================================  ================
X       moments of the columns `COLUMNS`, by joint and window               (2, 15, R)
b       moments of the two torques as recorded                              (2, R)
c       coefficients under one convention's zeros, `ZEROED`                 (q,), q ≤ 12
T       c's place among the columns, for the zeros δ1 and δ2                (15, q)
======  ==================================================================  ================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import AT_REST
from algid.base.names import outside
from algid.estimators.conventions import Convention
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.weak import reweighted
from algid.model import SINE_OF, SINES, Model
from algid.physics.motion import Motion
from algid.physics.terms.coulomb import COULOMB
from algid.physics.terms.offset import OFFSET
from algid.physics.terms.phases import PHASES
from algid.physics.terms.rotor import ROTOR
from algid.signals.filters import correlate, differentiator, half_length

MODEL = Model((COULOMB.name, OFFSET.name, ROTOR.name, PHASES.name), coulomb_speed=0.1)
ZEROED = outside(MODEL.names, SINES)
COLUMNS: list[str] = []
"""The columns of `MODEL`, each sine part behind the one whose it is."""
for _name in ZEROED:
    COLUMNS.append(_name)
    if _name in SINE_OF:
        COLUMNS.append(SINE_OF[_name])
_PLACES = list(map(MODEL.names.index, COLUMNS))
WINDOW = 0.4  # s
_BANDWIDTH = 40.0  # Hz, of the velocity beside k1
_LEAST_POWER = 1e-280  # (N m)²: the square of a torque of denormal numbers is zero
_FLOOR = 1e-9  # of a torque's power: a residual below it is rounding


@dataclass(frozen=True, eq=False)
class ConventionSums:
    """Sums over the windows of a log whose angles were mapped.

    Gram matrices of the columns (2, 15, 15), their products with both recorded torques (2, 15, 2),
    the power of these (2,), and the joints' RMS speeds (2,) in rad/s.
    """

    gram: FloatArray
    cross: FloatArray
    power: FloatArray
    speed: FloatArray
    independent: float


@dataclass(frozen=True, eq=False)
class ThinnedLog:
    """Angles, velocities (2, N) and torques' moments (2, R) of a log as it was read.

    `squares` (2, R) are the joints' squared velocities, averaged over each window; the windows
    `kept` (R,) count, which move for `seconds`.
    """

    theta: FloatArray
    omega: FloatArray
    torques: FloatArray
    squares: FloatArray
    windows: Windows
    kept: NDArray[np.bool_]

    @property
    def seconds(self) -> float:
        """How long the log moves, in s."""
        return self.theta.shape[1] * self.windows.dt * float(self.kept.mean())


def _windows(dt: float, rate: float) -> tuple[int, Windows]:
    """How many samples are averaged to leave `rate` Hz, and the windows on what that leaves."""
    width = max(1, round(1 / (rate * dt)))
    dt *= width
    return width, Windows(dt, WINDOW, 0.0, max(min(_BANDWIDTH, 0.2 / dt), 6.0 / WINDOW))


def holds_window(samples: int, dt: float, rate: float) -> bool:
    """True if a stretch of so many `samples`, thinned to `rate` Hz, holds a window."""
    width, windows = _windows(dt, rate)
    assert windows.bandwidth is not None
    reach = half_length(windows.dt, windows.bandwidth)
    return samples // width - 2 * reach >= OVERLAP * windows.step


def thinned(
    theta: FloatArray, tau: FloatArray, dt: float, rate: float, longest: float
) -> ThinnedLog:
    """Means over as many samples as leave `rate` Hz, of the first `longest` s."""
    width, windows = _windows(dt, rate)
    assert windows.bandwidth is not None
    count = min(theta.shape[1], round(longest / dt)) // width
    theta, tau = (
        signal[:, : count * width].reshape(2, count, width).mean(axis=2) for signal in (theta, tau)
    )
    inner = slice(reach := half_length(windows.dt, windows.bandwidth), count - reach)
    omega = correlate(theta, differentiator(windows.dt, windows.bandwidth))
    plain = windows.kernels()[0]
    squares, torques = windows.moments(omega**2, plain), windows.moments(tau[:, inner], plain)
    every = np.ones(squares.shape[1], dtype=bool)
    return ThinnedLog(theta[:, inner], omega, torques, squares, windows, every)


def moving(logs: Sequence[ThinnedLog]) -> list[ThinnedLog]:
    """The logs with windows in which a joint exceeds `AT_REST` of its RMS speed in all of them.

    Where both joints stand, dry friction may hold them, and no equation of motion holds.
    """
    every = np.concatenate([log.squares for log in logs], axis=1)
    least = AT_REST**2 * np.mean(every, axis=1, keepdims=True)
    return [replace(log, kept=np.any(log.squares >= least, axis=0)) for log in logs]


def summed(
    angles: Convention, logs: Sequence[ThinnedLog], drives: Sequence[int]
) -> list[ConventionSums]:
    """Sums over the windows of logs of one arm for angles so mapped.

    One for each of the second motor's `drives`: see `Convention.base`.
    """
    size = len(COLUMNS)
    grams = np.zeros((len(drives), 2, size, size))
    crosses = np.zeros((len(drives), 2, size, 2))
    power, squares, independent = np.zeros(2), np.zeros(2), 0.0
    for log in logs:
        omega = angles.angles(log.omega)  # linear without zeros
        motion = Motion(angles.angles(log.theta), omega, omega)
        X = log.windows.columns(MODEL, motion)[:, _PLACES][:, :, log.kept]
        torques, weight = log.torques[:, log.kept], X.shape[2] / OVERLAP
        for gram, cross, base in zip(grams, crosses, drives, strict=True):
            Y = np.stack([X[0] - base * X[1], X[1]])
            gram += Y @ Y.swapaxes(1, 2)
            cross += Y @ torques.T
        power += np.sum(torques**2, axis=1)
        squares += weight * np.mean(omega**2, axis=1)
        independent += weight
    speed = np.sqrt(squares / max(independent, 1e-300))
    return [
        ConventionSums(gram, cross, power, speed, independent)
        for gram, cross in zip(grams, crosses, strict=True)
    ]


def solved(
    sums: ConventionSums,
    families: Sequence[Convention],
    T: FloatArray,
    passive: int | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted least squares for each of F families with each T of (Z, 15, q), F Z fits.

    Gives c (F Z, q), shares left (F Z, 2) and covariances (F Z, q, q). The torque of a `passive`
    joint (1 or 2) is none: what is left there is a share of what acts on it, summed over the
    columns, as constants near nothing leave nothing of it.
    """
    order = np.array([(0, 1)] * len(families))
    order[[family.torques_swapped for family in families]] = (1, 0)
    signs = np.array([family.torque_signs for family in families])
    cross = signs[:, :, None] * sums.cross[[0, 1], :, order]
    power = np.repeat(np.maximum(sums.power, _LEAST_POWER)[order], T.shape[0], axis=0)
    gram = np.tile(T.swapaxes(1, 2)[:, None] @ sums.gram @ T[:, None], (len(families), 1, 1, 1))
    aimed = np.einsum("zxi,fax->fzai", T, cross).reshape(len(power), 2, -1)
    if passive is not None:
        motorless = passive - 1
        power[:, motorless] = power[:, 1 - motorless]
    ridge = 1e-12 * np.eye(T.shape[2])

    def solve(
        weight: FloatArray, _: tuple[FloatArray, ...]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        normal = np.einsum("za,zaij->zij", weight, gram)
        size = np.sqrt(np.maximum(np.einsum("zii->zi", normal), 1e-140))
        scale = size[:, :, None] * size[:, None, :]
        inverse = np.linalg.inv(normal / scale + ridge) / scale
        c = np.einsum("zij,za,zaj->zi", inverse, weight, aimed)
        model = np.einsum("zi,zaij,zj->za", c, gram, c)
        squares = power - 2 * np.einsum("zai,zi->za", aimed, c) + model
        if passive is not None:
            acting = np.einsum("zaii,zi->za", gram, c**2)[:, motorless]
            power[:, motorless] = np.maximum(acting, _LEAST_POWER)
            squares[:, motorless] = model[:, motorless]
        return c, np.maximum(squares, _FLOOR * power), inverse

    def weigh(state: tuple[FloatArray, ...]) -> FloatArray:
        return sums.independent / state[1] if len(state) > 1 else 1 / power

    start: tuple[FloatArray, ...] = ()
    (c, squares, inverse), _ = reweighted(weigh, solve, start)
    return c, squares / power, inverse
