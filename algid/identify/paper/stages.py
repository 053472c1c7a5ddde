"""The paper's two stages on windows: stage 1 (eq. 3), k7 (eq. 4), stage 2 (eq. 5) and the payload.

Every series is (..., n) like the windows it is computed from, in the units of `algid.arm`, and NaN where the
system is singular or less than ε has passed since the window's start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.identify.paper.columns import Columns, columns, stack_rows
from algid.identify.paper.linear import LARGEST_CONDITION, Solutions, solve_scaled

EPSILON = 0.2  # s: the estimates are arbitrary before (the paper's ε)

STAGE1_NAMES = ("k5+k3", "k1", "k3", "k6", "k4", "k2")
STAGE2_NAMES = ("k5+k3+z1+z2", "k1+z3", "k3+z2", "k4+z4", "k2+z5")


@dataclass(frozen=True, eq=False)
class Stage1:
    """Series of k1 … k7 (7, ..., n), and the condition numbers of the 6×6 system and of k7's equation."""

    k: FloatArray
    condition: FloatArray
    k7_condition: FloatArray


@dataclass(frozen=True, eq=False)
class Stage2:
    """Series of the five loaded constants x_m (5, ..., n), l1 (m) and m_p (kg), and the condition number."""

    x: FloatArray
    l1: FloatArray
    m_p: FloatArray
    condition: FloatArray


def stage1(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> Stage1:
    """Constants of the arm without payload from windows of angles, velocities and torques (2, ..., n)."""
    terms = columns(theta, omega, tau, dt)
    solution = _late(_solve_first_joint(terms, dt), dt)
    k5_k3, k1, k3, k6, k4, k2 = solution.x
    known = k3 * (terms.inertia1 + terms.inertia2) + k1 * terms.coupling2 + k2 * terms.gravity12
    k7, k7_condition = _single_unknown(terms.viscous2, terms.torque2 - known)
    return Stage1(
        k=np.stack([k1, k2, k3, k4, k5_k3 - k3, k6, k7]),
        condition=solution.condition,
        k7_condition=k7_condition,
    )


def _solve_first_joint(terms: Columns, dt: float) -> Solutions:
    """x_r of P_r x_r = q_r: eq. (3) and five more integrals of it."""
    rows = stack_rows(np.concatenate([terms.first_joint(), terms.torque1[None]]), dt, 6)
    return solve_scaled(rows[:, :-1], rows[:, -1])


def _late(solution: Solutions, dt: float) -> Solutions:
    """The solution with NaN in the first ε of each window."""
    x = solution.x.copy()
    x[..., : _arbitrary(dt)] = np.nan
    return Solutions(x=x, condition=solution.condition)


def _arbitrary(dt: float) -> int:
    """Samples before ε."""
    return int(np.ceil(EPSILON / dt - 1e-6))


def _single_unknown(coefficient: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve a x = b; a is a difference of integrals, and vanishes beside the largest it has been when singular."""
    largest = np.maximum.accumulate(np.abs(coefficient), axis=-1)
    size = np.abs(coefficient)
    condition = np.divide(largest, size, out=np.full_like(size, np.inf), where=size > 0)
    regular = condition <= LARGEST_CONDITION
    return np.divide(rhs, coefficient, out=np.full_like(rhs, np.nan), where=regular), condition


def stage2(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float, k: FloatArray, gravity: float) -> Stage2:
    """Constants of the loaded arm and the payload, given k1 … k7 (7,) of the arm and g in m/s²."""
    terms = columns(theta, omega, tau, dt)
    unknown = np.stack([terms.inertia1, terms.coupling1, terms.inertia2, terms.gravity1, terms.gravity12])
    rest = terms.torque1 - k[5] * terms.viscous1
    rows = stack_rows(np.concatenate([unknown, rest[None]]), dt, 5)
    solution = _late(solve_scaled(rows[:, :-1], rows[:, -1]), dt)
    l1, m_p = payload(solution.x, k, gravity)
    return Stage2(x=solution.x, l1=l1, m_p=m_p, condition=solution.condition)


def payload(x: FloatArray, k: FloatArray, gravity: float) -> tuple[FloatArray, FloatArray]:
    """l1 = z1 g / z4 in m and m_p = z1 / l1² in kg from x_m (5, ...) and k (7,): the paper's route."""
    z2 = x[2] - k[2]
    z4 = x[3] - k[3]
    z1 = x[0] - k[4] - k[2] - z2
    with np.errstate(divide="ignore", invalid="ignore"):  # no payload: 0/0 is NaN, which says it
        l1 = z1 * gravity / z4
        m_p = z1 / l1**2
    return l1, m_p
