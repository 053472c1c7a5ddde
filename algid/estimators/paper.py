"""The paper's method: Páez-García et al.

2023, stage 1 (eq. 3), k7 (eq. 4), stage 2 (eq. 5) and the payload.

======  ========================================  ============  ==========
symbol  name                                      shape         unit
======  ========================================  ============  ==========
t       time since the window's start             (n,)          s
theta   joint angles θ1, θ2                       (2, ..., n)   rad
omega   joint velocities θ̇1, θ̇2                   (2, ..., n)   rad/s
tau     joint torques τ1, τ2                      (2, ..., n)   N m
P_r, q  system of stage 1 and its right side      (6, 6, ..., n), (6, ..., n)
P_m, q  system of stage 2 and its right side      (5, 5, ..., n), (5, ..., n)
======  ========================================  ============  ==========

Each equation is t² times a row of eq. (1), integrated twice from the window's start; t² removes
the initial conditions. The angles enter linear terms as differences to their first value, which
changes nothing (those terms vanish for a constant) and keeps digits.

Every series is (..., n) like the windows it is computed from, in the units of `algid.arm`, and NaN
where the system is singular or less than ε has passed since the window's start. A series' estimate
is the median over its settled samples, the last 0.2 s of each window; with several windows, the
median of the windows' medians. An estimate that wanders by more than its own size is not to be
trusted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.model import K1, K2, K3, K4, K5, K6
from algid.signals.differences import integral
from algid.signals.segments import Segment, pieces


class IntegralColumns(NamedTuple):
    """What multiplies each unknown after t² and two integrations, each (..., n).

    And the torque's own integral.

    `inertia1` and `inertia2` multiply θ̈1 and θ̈2, `viscous1` and `viscous2` θ̇1 and θ̇2. The first
    six are the coefficients of x_r = [k5+k3, k1, k3, k6, k4, k2] in eq. (3), the next its torque.
    """

    inertia1: FloatArray
    coupling1: FloatArray
    inertia2: FloatArray
    viscous1: FloatArray
    gravity1: FloatArray
    gravity12: FloatArray
    torque1: FloatArray
    coupling2: FloatArray
    viscous2: FloatArray
    torque2: FloatArray


def columns(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> IntegralColumns:
    """The integrals of eq. (3) and (4) over windows that start at their first sample.

    Parameters
    ----------
    theta, omega, tau : (2, ..., n), rad, rad/s and N m
    dt : float, s

    Returns
    -------
    IntegralColumns
        In the unit of what is integrated, times s⁴.
    """
    t = dt * np.arange(theta.shape[-1], dtype=np.float64)
    omega1, omega2 = omega
    c2, s2 = np.cos(theta[1]), np.sin(theta[1])
    moved = theta - theta[..., :1]
    inertia1, inertia2 = _of_acceleration(moved, t, dt)
    viscous1, viscous2 = _of_derivative(moved, t, dt)
    gravity1, gravity12 = _twice(t**2 * np.cos(np.cumsum(theta, axis=0)), dt)
    torque1, torque2 = _twice(t**2 * tau, dt)
    coupling1 = _of_derivative(c2 * (2 * omega1 + omega2), t, dt)
    centrifugal = _twice(t**2 * s2 * omega1 * (omega1 + omega2), dt)
    coupling2 = _of_derivative(c2 * omega1, t, dt) + centrifugal
    of_joint1 = (inertia1, coupling1, inertia2, viscous1, gravity1, gravity12, torque1)
    return IntegralColumns(*of_joint1, coupling2, viscous2, torque2)


def _twice(signal: FloatArray, dt: float) -> FloatArray:
    """∫^(2) of a signal, eq. (3) to (5)."""
    return integral(integral(signal, dt), dt)


def _of_acceleration(angle: FloatArray, t: FloatArray, dt: float) -> FloatArray:
    """∫^(2) t² θ̈ = t² θ − 4 ∫ t θ + 2 ∫^(2) θ."""
    return t**2 * angle + integral(2 * integral(angle, dt) - 4 * t * angle, dt)


def _of_derivative(signal: FloatArray, t: FloatArray, dt: float) -> FloatArray:
    """∫^(2) t² ḟ = ∫ t² f − 2 ∫^(2) t f."""
    return integral(t**2 * signal - 2 * integral(t * signal, dt), dt)


def stack_rows(first: FloatArray, dt: float, rows: int) -> FloatArray:
    """The rows of P_r and P_m, right sides with them: each is the integral of the one before.

    Parameters
    ----------
    first : (..., n)
    dt : float, s
    rows : int

    Returns
    -------
    (rows, ..., n)
        `first`, then its integrals from the first sample.
    """
    stacked = np.empty((rows, *first.shape))
    stacked[0] = first
    for row in range(1, rows):
        stacked[row] = integral(stacked[row - 1], dt)
    return stacked


# A relative change of 1e-12, the rounding of nested sums, then moves the estimate by less than one
# percent.
LARGEST_CONDITION = 1e10


def solve_scaled(matrix: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve P x = q at every sample.

    Parameters
    ----------
    matrix : (u, u, ...) float64
        P, rows first. The rows and then the columns are scaled to a largest entry of one.
    rhs : (u, ...) float64
        q.

    Returns
    -------
    Solutions (u, ...) of u unknowns, and condition numbers (...)
        The condition number is that of the scaled matrix in the 1-norm; past `LARGEST_CONDITION`
        the system counts as singular and its solution is NaN.
    """

    def scale(sizes: FloatArray) -> FloatArray:
        return 1 / np.where(sizes > 0, sizes, 1.0)

    p = np.moveaxis(matrix, (0, 1), (-2, -1))
    row = scale(np.abs(p).max(axis=-1, keepdims=True))
    p = p * row
    column = scale(np.abs(p).max(axis=-2, keepdims=True))
    p = p * column
    q = np.moveaxis(rhs, 0, -1)[..., None] * row
    condition = np.linalg.cond(p, 1)
    regular = (condition <= LARGEST_CONDITION)[..., None, None]
    # windows start with rows of zeros; LAPACK refuses a whole batch for one zero pivot
    inverse = np.linalg.inv(np.where(regular, p, np.eye(p.shape[-1])))
    scaled = inverse @ q
    scaled += inverse @ (q - p @ scaled)
    x = np.where(regular, scaled * column.mT, np.nan)
    return np.moveaxis(x[..., 0], -1, 0), condition


EPSILON = 0.2  # s: the estimates are arbitrary before (the paper's ε)

STAGE1_NAMES = (f"{K5}+{K3}", K1, K3, K6, K4, K2)
STAGE2_NAMES = ("k5+k3+z1+z2", "k1+z3", "k3+z2", "k4+z4", "k2+z5")


def stage1(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> FloatArray:
    """Constants without payload: P_r x_r = q_r of eq. (3) and five more integrals; k7 by eq. (4).

    Parameters
    ----------
    theta, omega, tau : (2, ..., n), rad, rad/s and N m
        Windows, each from its own start.
    dt : float, s

    Returns
    -------
    `STAGE1_SERIES` (10, ..., n)
        NaN in the first ε of each window, and where a system is singular.
    """
    terms = columns(theta, omega, tau, dt)
    x, condition = _solved_late(np.stack(terms[:7]), dt)
    k5_k3, k1, k3, k6, k4, k2 = x
    known = k3 * (terms.inertia1 + terms.inertia2) + k1 * terms.coupling2 + k2 * terms.gravity12
    k7, k7_condition = _single_unknown(terms.viscous2, terms.torque2 - known)
    k = [k1, k2, k3, k4, k5_k3 - k3, k6, k7]
    return np.stack([*k, k5_k3, condition, k7_condition])


def _solved_late(first: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Solution (u, ..., n) of the system with first row and right side `first`: NaN before ε.

    With its condition numbers.
    """
    rows = stack_rows(first, dt, len(first) - 1)
    x, condition = solve_scaled(rows[:, :-1], rows[:, -1])
    x[..., : int(np.ceil(EPSILON / dt - 1e-6))] = np.nan
    return x, condition


def _single_unknown(coefficient: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve a x = b.

    a is a difference of integrals, and vanishes beside the largest it has been when singular.
    """
    size = np.abs(coefficient)
    largest = np.maximum.accumulate(size, axis=-1)
    condition = np.divide(largest, size, out=np.full_like(size, np.inf), where=size > 0)
    regular = condition <= LARGEST_CONDITION
    return np.divide(rhs, coefficient, out=np.full_like(rhs, np.nan), where=regular), condition


def stage2(
    theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float, k: FloatArray, gravity: float
) -> FloatArray:
    """Constants with payload, and the payload: P_m x_m = q_m of eq. (5) and four more integrals.

    Parameters
    ----------
    theta, omega, tau : (2, ..., n), rad, rad/s and N m
        Windows of the loaded arm, each from its own start.
    dt : float, s
    k : (7,), in `algid.model.UNITS`
        Of the arm without payload.
    gravity : float, m/s²

    Returns
    -------
    `STAGE2_SERIES` (8, ..., n)
        NaN in the first ε of each window, and where a system is singular.
    """
    terms = columns(theta, omega, tau, dt)
    rest = terms.torque1 - k[5] * terms.viscous1
    unknown = [terms.inertia1, terms.coupling1, terms.inertia2, terms.gravity1, terms.gravity12]
    x, condition = _solved_late(np.stack([*unknown, rest]), dt)
    return np.stack([*x, *payload(x, k, gravity), condition])


def payload(x: FloatArray, k: FloatArray, gravity: float) -> tuple[FloatArray, FloatArray]:
    """l1 = z1 g / z4 and m_p = z1 / l1², the paper's route.

    Parameters
    ----------
    x : (5, ...), in the order of `STAGE2_NAMES`
    k : (7,), in `algid.model.UNITS`
    gravity : float, m/s²

    Returns
    -------
    l1 (...) in m and m_p (...) in kg; NaN where there is no payload.
    """
    z2 = x[2] - k[2]
    z4 = x[3] - k[3]
    z1 = x[0] - k[4] - k[2] - z2
    with np.errstate(divide="ignore", invalid="ignore"):  # no payload: 0/0 is NaN, which says it
        l1 = z1 * gravity / z4
        m_p = z1 / l1**2
    return l1, m_p


SETTLED = 0.2  # s at the end of each window
SHORTEST = EPSILON + SETTLED  # s

STAGE1_SERIES = (*CONSTANT_NAMES, "k5+k3", "condition", "k7_condition")
STAGE2_SERIES = (*STAGE2_NAMES, "l1", "m_p", "condition")

Stage = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]


class PaperSeries(NamedTuple):
    """Estimates (s, n) of one window at its times `t` (n,) in s, and their `settled` quartiles.

    The quartiles (3, s) are those of the samples at its end.
    """

    t: FloatArray
    values: FloatArray
    settled: FloatArray


def series_of(source: Iterable[Segment], window: float, stage: Stage) -> Iterator[PaperSeries]:
    """Series of a stage over the windows of a log.

    Parameters
    ----------
    source : iterable of `Segment`, with velocities
    window : float, s
        What is left over at the end of a segment is a window too, down to eight samples.
    stage : `stage1`, or `stage2` with what it knows
    """
    for piece in pieces(source, lambda dt: max(8, round(window / dt))):
        if len(piece) >= 8 and piece.omega is not None:  # what is shorter cannot be integrated
            values = stage(piece.theta, piece.omega, piece.tau, piece.dt)
            settled = values[:, -round(SETTLED / piece.dt) :]
            yield PaperSeries(piece.t, values, quartiles(settled))


def quartiles(values: FloatArray) -> FloatArray:
    """Quartiles (3, s) of those of the values (s, n) that are no NaN (singular, before ε)."""
    found = np.full((3, len(values)), np.nan)
    some = np.isfinite(values).any(axis=1)
    if some.any():
        found[:, some] = np.nanquantile(values[some], [0.25, 0.5, 0.75], axis=1)
    return found


def estimates(settled: Sequence[FloatArray], size: int) -> tuple[FloatArray, FloatArray]:
    """Estimates (s,) by windows' `settled` quartiles, and how far they wander (s,), NaN where none.

    They wander by half the distance of the quartiles, within windows or between them.
    """
    low, middle, high = np.stack([np.full((3, size), np.nan), *settled], axis=-1)
    _, within, _ = quartiles(high - low)
    first, estimate, third = quartiles(middle)
    return estimate, 0.5 * np.maximum(within, third - first)


def wanders(estimate: FloatArray, wander: FloatArray) -> NDArray[np.bool_]:
    """Where estimates (s,) are unreliable: missing, or wandering by more than their own size."""
    return ~(wander <= np.abs(estimate))
