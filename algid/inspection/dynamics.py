"""Rough check of a log's dynamics: enough motion, and a torque that carries the arm's weight.

The model of eq. (1) is fitted by least squares to smoothed signals, once with gravity as it is and
once with gravity turned by a right angle. That is no identification; it separates a wrong sign or
zero from a right one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray, regressor
from algid.estimators.conventions import Convention
from algid.log import Log
from algid.notices import Notice
from algid.signals.segments import stretches

_RATE = 100.0
_MOST_ROWS = 20_000
_EDGE, _SHORTEST = 10, 20  # samples at 100 Hz: at either end of a stretch, and what is left
_K2, _K3, _K4, _K5 = 1, 2, 3, 4
_OF_LEFT = 0.1
"""Share of the rough fit's residual that gravity's columns fit by differentiation errors."""
_SAME_TURN = 30.0
"""° between the turn of a rough fit and one that it stands for: of runs of real arms up to 25."""
_LEAST_PULL = 1.3
"""Weight in N m to inertia in kg m^2: a fifth of g/l for links of 1.5 m."""


@dataclass(frozen=True)
class DynamicFigures:
    """Figures of the rough fit.

    Parameters
    ----------
    condition : float
        Condition number of the scaled regressor of k1 … k7; infinite where the arm stands still.
    explained : float
        Share of the torques' variance that the model explains.
    weight1, weight2 : float, N m
        Gravity constants k4 and k2 of the fit.
    turn : float, deg
        Direction that gravity has in the fit against the one that algid expects: 0 for a right
        zero, ±90 for angles from the vertical, 180 for a flipped sign.
    gravity_share : float
        Share of the torques' variance that is lost without gravity.
    seen : float
        How far gravity's columns stand out of all others, 0 to 1: below 0.1 its direction is not
        known.
    inertia : float, kg m^2
        k3 + k5 of the fit.
    """

    condition: float
    explained: float
    weight1: float
    weight2: float
    turn: float
    gravity_share: float
    seen: float
    inertia: float


def dynamic_figures(log: Log) -> DynamicFigures | None:
    """Figures of a log, or None where it is too short to smooth (40 samples at 100 Hz)."""
    parts = list(_smoothed(log))
    if not parts or sum(part.shape[-1] for part in parts) < _SHORTEST:
        return None
    theta, omega, alpha, tau = np.concatenate(parts, axis=-1)[..., :_MOST_ROWS]
    rows = _rows(regressor(theta, omega, alpha))
    turned = _rows(regressor(theta - np.array([[np.pi / 2], [0.0]]), omega, alpha))[:, [_K2, _K4]]
    zeros, one = np.zeros_like(omega[0]), np.ones_like(omega[0])
    coulomb = np.tanh(omega / 0.05)
    # Coulomb friction and torque offset of either joint
    friction = _rows(np.stack([[coulomb[0], zeros, one, zeros], [zeros, coulomb[1], zeros, one]]))
    target = tau.ravel()
    wide = np.hstack([rows, turned, friction])
    c = _fit(wide, target)
    total = float(np.sum((target - target.mean()) ** 2)) or 1.0
    without = np.hstack([np.delete(rows, [_K2, _K4], axis=1), friction])
    left = _left(wide, c, target)
    lost = _left(without, _fit(without, target), target) - left
    turn = np.degrees(np.arctan2(c[7] + c[8], c[_K2] + c[_K4]))
    scale = np.linalg.norm(rows, axis=0)
    return DynamicFigures(
        condition=float(np.linalg.cond(rows / scale)) if np.all(scale > 0) else math.inf,
        explained=1 - left / total,
        weight1=float(c[_K4]),
        weight2=float(c[_K2]),
        turn=float(turn),
        gravity_share=lost / total,
        seen=_standing_out(np.hstack([rows[:, [_K2, _K4]], turned]), without),
        inertia=float(c[_K3] + c[_K5]),
    )


@dataclass(frozen=True)
class Suspicion:
    """What a rough fit says of gravity, and what may mend it, which is yet to be tried.

    Parameters
    ----------
    notice : without remedies
    guesses : conventions, the likeliest first
    weightless : whether torques without weight would explain it
    free_zero : whether any other zero of θ1 may mend it too
    """

    notice: Notice
    guesses: tuple[Convention, ...] = ()
    weightless: bool = False
    free_zero: bool = False

    def agrees(self, zero: float) -> bool:
        """True if a zero of θ1, in rad, turns gravity back by what it is turned."""
        if not self.free_zero:
            return True
        left = self.notice.numbers["turn"] + math.degrees(zero)
        return abs(math.remainder(left, 360)) <= _SAME_TURN


def gravity_findings(figures: DynamicFigures) -> Suspicion | None:
    """What a rough fit that explains the torques says of gravity: none, upwards, or sideways.

    None where it pulls down, or the motion leaves it open.
    """
    if figures.condition > 1e6 or figures.explained < 0.3:
        return None
    left = 1 - figures.explained
    weightless = math.hypot(figures.weight1, figures.weight2) < _LEAST_PULL * abs(figures.inertia)
    if figures.seen > 0.15 and figures.gravity_share < 0.01 and weightless:
        return Suspicion(Notice("GRAVITY_COMPENSATED", numbers={"case": "arm"}), weightless=True)
    if figures.seen < 0.015 or figures.gravity_share < max(0.02, _OF_LEFT * left):
        return None
    return _of_turn(figures)


def _of_turn(figures: DynamicFigures) -> Suspicion | None:
    """What is wrong where gravity does not pull down: inertia tells signs of torque and arm apart.

    Torques the other way round turn inertia and friction round too; an arm that is seen from
    behind keeps both, and its gravity pulls upwards.
    """
    torques = (-1, -1) if figures.inertia < 0 else (1, 1)
    turn = math.remainder(figures.turn - 180 * (figures.inertia < 0), 360)
    upwards = Notice("FLIPPED_SIGN", numbers={"weight": figures.weight1})
    if abs(figures.turn) <= 45:
        return None
    if abs(turn) <= 45:
        return Suspicion(upwards, (Convention(torque_signs=(-1, -1)),))
    if abs(turn) > 135:
        return Suspicion(upwards, (Convention(signs=(-1, -1), torque_signs=(-1, -1)),))
    quarter = math.copysign(math.pi / 2, -turn)
    zero = Convention(torque_signs=torques, zero=(quarter, 0.0))
    return Suspicion(Notice("WRONG_ZERO", numbers={"turn": turn}), (zero,), free_zero=True)


def _smoothed(log: Log) -> Iterator[FloatArray]:
    """Angles, velocities, accelerations and torques (4, 2, N) of each stretch without a gap.

    They are averaged to 100 Hz at most, on the even time base that estimators use.
    """
    kernel = np.hanning(9)[1:-1] / np.hanning(9).sum()
    for stretch in stretches([log]):
        width = max(1, round(1 / (_RATE * stretch.dt)))
        count = len(stretch) // width
        if count <= 2 * _EDGE:
            continue
        signals = np.concatenate([stretch.theta, stretch.tau])[:, : count * width]
        thin = signals.reshape(4, count, width).mean(axis=2)
        smooth = np.stack([np.convolve(row, kernel, "same") for row in thin])
        theta, tau = smooth[:2], smooth[2:]
        omega = np.gradient(theta, stretch.dt * width, axis=1)
        alpha = np.gradient(omega, stretch.dt * width, axis=1)
        yield np.stack([theta, omega, alpha, tau])[..., _EDGE:-_EDGE]


def _rows(columns: FloatArray) -> FloatArray:
    """Columns (2, p, N) as a matrix (2 N, p)."""
    return columns.transpose(0, 2, 1).reshape(-1, columns.shape[1])


def _fit(matrix: FloatArray, target: FloatArray) -> FloatArray:
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1
    c = np.linalg.lstsq(matrix / scale, target, rcond=1e-8)[0]
    return np.asarray(c / scale)


def _left(matrix: FloatArray, solution: FloatArray, target: FloatArray) -> float:
    return float(np.sum((target - matrix @ solution) ** 2))


def _standing_out(columns: FloatArray, others: FloatArray) -> float:
    """Smallest singular value of scaled `columns` after least squares on `others`."""
    scale = np.linalg.norm(columns, axis=0)
    if not np.all(scale > 0):
        return 0.0
    left = columns / scale - others @ np.linalg.lstsq(others, columns / scale, rcond=1e-8)[0]
    return float(np.linalg.svd(left, compute_uv=False)[-1])
