"""Gauss collocation of equations of motion, for all nodes of a window at once.

        ω(t) = ω₀ + ∫ α(s, θ, ω) ds,   θ(t) = θ₀ + ∫ ω ds,   α interpolated at Gauss-Legendre nodes

A window is P pieces, each with s nodes. The unknowns are the accelerations a at the nodes: a
piece's velocities and angles are ω = ω₀ + Q a and θ = θ₀ + Q ω, Q the integrals from its start,
and where it ends the next one starts, x = (θ₀, ω₀). The simplified Newton method of implicit
Runge-Kutta methods (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8) changes
a by δ, with A = ∂α/∂θ and B = ∂α/∂ω in the window's middle, r = α(θ, ω) − a and q = Q 1:

    (I − A ⊗ Q² − B ⊗ Q) δ = r + (A ⊗ 1) δθ₀ + (A ⊗ q + B ⊗ 1) δω₀ = r + C δx

so that a piece's δ is N (r + C δx), and the starts follow each other as δx' = E δx + L N r: no
system is larger than a piece. The sums over the pieces before, Σ E^j L N r, double their reach at
each step (Hillis and Steele 1986). The method has order 2s, and between the nodes its polynomial,
so that a sample costs no step.

======  =======================================================  ==========
symbol  name                                                     shape
======  =======================================================  ==========
θ, ω    angles and velocities, x both                            (n, ...)
α       accelerations                                            (n, P, s)
P, s    pieces of a window, nodes of a piece                     -
Q       integrals from a piece's start to each of its nodes      (s, s)
t       times at which states are asked for                      (N,)
======  =======================================================  ==========
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from algid.arm import FloatArray
from algid.base.limits import PHYSICAL

Acceleration = Callable[[FloatArray, FloatArray], FloatArray]
"""Accelerations (n, M) from angles (n, M) and velocities (n, M), at times set before."""

NODES = 12
TOLERANCE = 1e-12
LONGEST = 0.05  # s, of a piece: nothing of interest changes unseen within it
SHORTEST = 1e-9  # s
TURNS = 10
"""What the iteration of a window may take: more, and it is too long."""
PIECES, MOST_PIECES = 6, 50
"""Pieces in a window, and between breaks: more cost more turns, or more to carry on, than they
save in calls."""
_SLOPE = 1e-6  # rad and rad/s, for the derivatives of α: they only steer the iteration

_X, _WEIGHTS = leggauss(NODES)
_ORDERS = np.arange(NODES)
_COEFFICIENTS = (_ORDERS + 0.5)[:, None] * legvander(_X, NODES - 1).T * _WEIGHTS
"""From node values to coefficients of Legendre's polynomials: exact up to degree 2s − 1."""


def _integrals(x: FloatArray) -> FloatArray:
    """∫ P_j from −1 to x, j = 0 … s − 1: (..., s), by (P_{j+1} − P_{j−1}) / (2j + 1)."""
    P = legvander(x, NODES)
    before = np.concatenate([-np.ones_like(P[..., :1]), P[..., : NODES - 1]], axis=-1)
    return (P[..., 1:] - before) / (2 * _ORDERS + 1)


_TO_NODES = _integrals(_X) @ _COEFFICIENTS


def _edges(start: FloatArray, rates: FloatArray, half: FloatArray) -> FloatArray:
    """The integral (n, P + 1) of rates (n, P, s) where pieces begin and end, from `start` (n,)."""
    steps = half * (rates @ _WEIGHTS)
    return np.cumsum(np.concatenate([start[:, None], steps], axis=1), axis=1)


def integrate(
    accelerate_at: Callable[[FloatArray], Acceleration],
    start: FloatArray,
    t: FloatArray,
    corners: FloatArray | None = None,
    reached: Callable[[float], None] | None = None,
) -> FloatArray:
    """States (2n, N) of θ̈ = α(t, θ, ω) at the times `t` (N,) from `start` (2n,) at ``t[0]``.

    A state holds angles, then velocities.

    Parameters
    ----------
    accelerate_at : callable
        Takes times (M,) in s, and gives what maps angles (n, M) in rad and velocities (n, M) in
        rad/s at these times to accelerations (n, M) in rad/s².
    start : (2n,) float64
    t : (N,) float64, s, increasing
    corners : (C,) float64, s, increasing
        Times at which α or a derivative of it jumps.
    reached : callable
        Called with each time that the integration has come to.

    Returns
    -------
    (2n, N) float64
        Every window's polynomials are resolved to `TOLERANCE`, relative to the state or to 1.

    Raises
    ------
    ArithmeticError
        If the motion grows without bound, or is faster than any arm moves.
    """
    breaks = t[-1:]
    if corners is not None:
        breaks = np.append(corners[(corners > t[0]) & (corners < t[-1])], breaks)
    states = np.empty((start.size, t.size))
    states[:, 0] = state = start
    longest, done, now = LONGEST, 1, float(t[0])
    while done < t.size:
        # from break to break as far as a piece may reach, or whole pieces before the first one
        ahead = breaks[np.searchsorted(breaks, now, side="right") :][:MOST_PIECES]
        ends = ahead[ahead <= now + longest]
        if not ends.size:
            count = min(PIECES, int((ahead[0] - now) / longest))
            ends = now + longest * np.arange(1, count + 1)
        edges = np.append(now, ends)
        half = 0.5 * np.diff(edges)
        # a window that is too long may leave all bounds
        with np.errstate(over="ignore", invalid="ignore"):
            rates, turns = _rates(accelerate_at, state, edges)
            starts = _edges(state, rates, half)
            # the last two coefficients of each polynomial must be below the tolerance
            last = half[:, None] * np.abs(rates @ _COEFFICIENTS[-2:].T)
            scale = np.maximum(1.0, np.abs(starts).max(axis=1))
            resolved = turns < TURNS and np.all(last <= TOLERANCE * scale[:, None, None])
        if not resolved:
            longest *= 0.5
            if longest < SHORTEST:
                raise ArithmeticError(f"the motion grows without bound beyond {now:.6g} s")
            continue
        now, state = float(edges[-1]), starts[:, -1]
        if np.abs(state[state.size // 2 :]).max() > PHYSICAL.speed[1]:  # steps would become tiny
            raise ArithmeticError(
                f"the motion is faster than {PHYSICAL.speed[1]:g} rad/s beyond {now:.6g} s"
            )
        until = int(np.searchsorted(t, now, side="right"))
        piece = np.searchsorted(edges, t[done:until], side="left") - 1
        x = (t[done:until] - edges[piece]) / half[piece] - 1.0
        within = np.einsum("jns,ns->jn", (rates @ _COEFFICIENTS.T)[:, piece], _integrals(x))
        states[:, done:until] = starts[:, piece] + half[piece] * within
        done = until
        longest = min(LONGEST, longest * (1.25 if turns < TURNS // 2 else 1.0))
        if reached is not None:
            reached(now)
    return states


def _rates(
    accelerate_at: Callable[[FloatArray], Acceleration], state: FloatArray, edges: FloatArray
) -> tuple[FloatArray, int]:
    """Rates (2n, P, s) of the state at the nodes between `edges` (P + 1,), and turns it took.

    `TURNS` where the iteration does not end.
    """
    n, pieces = state.size // 2, edges.size - 1
    half = 0.5 * np.diff(edges)
    accelerate = accelerate_at((edges[:-1, None] + half[:, None] * (1 + _X)).ravel())
    inverse, by_start, ends, powers = _newton(accelerate_at, edges, state)

    def integral(start: FloatArray, rates: FloatArray) -> FloatArray:
        """`start` (n,) and ∫ `rates` (n, P, s) from the window's start."""
        begins = _edges(start, rates, half)[:, :-1, None]
        integrals: FloatArray = (half[:, None] * rates) @ _TO_NODES.T + begins
        return integrals

    alpha = np.zeros((n, pieces, NODES))
    before = inf
    for turn in range(TURNS):
        omega = integral(state[n:], alpha)
        theta = integral(state[:n], omega)
        now = accelerate(theta.reshape(n, -1), omega.reshape(n, -1)).reshape(alpha.shape)
        rest = (now - alpha).transpose(1, 0, 2).reshape(pieces, -1)
        starts = np.concatenate([np.zeros((1, 2 * n)), rest[:-1] @ ends.T])
        for order, power in enumerate(powers):
            reach = 2**order
            starts[reach:] += starts[:-reach] @ power.T
        change = rest @ inverse.T + starts @ by_start.T
        alpha = alpha + change.reshape(pieces, n, -1).transpose(1, 0, 2)
        size = float(np.abs(change).max()) * float(edges[-1] - edges[0])
        if not size < before:  # also where it is no number
            break
        # what is left where each turn shrinks the change as this one did
        left = size * size / (before - size) if before < inf else size
        if left <= TOLERANCE * max(1.0, float(np.abs(omega).max())):
            return np.concatenate([integral(state[n:], alpha), alpha]), turn
        before = size
    return np.concatenate([omega, alpha]), TURNS


def _newton(
    accelerate_at: Callable[[FloatArray], Acceleration], edges: FloatArray, state: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray]]:
    """What a piece makes of its defects r (ns,) and of a change of its start δx (2n,).

    N (ns, ns): δ from r; N C (ns, 2n): δ from δx; L N (2n, ns): the change of the next start from
    r; and E, E², E⁴ … (2n, 2n), which carry changes of starts on. They steer the iteration alone,
    so that all pieces may pass for equally long.
    """
    n, pieces = state.size // 2, edges.size - 1
    half = 0.5 * (edges[-1] - edges[0]) / pieces
    # in the middle of the window, as far as its start tells where that is
    middle = np.append(state[:n] + pieces * half * state[n:], state[n:])[:, None]
    moved = np.hstack([middle, middle + _SLOPE * np.eye(2 * n)])
    alpha = accelerate_at(np.full(2 * n + 1, edges[0] + pieces * half))(moved[:n], moved[n:])
    slopes = (alpha[:, 1:] - alpha[:, :1]) / _SLOPE
    Q, weights, one = half * _TO_NODES, half * _WEIGHTS, np.ones(NODES)

    def blocks(by_theta: FloatArray, by_omega: FloatArray) -> FloatArray:
        """A ⊗ `by_theta` + B ⊗ `by_omega`."""
        A, B = slopes[:, None, :n, None], slopes[:, None, n:, None]
        return (A * by_theta[:, None] + B * by_omega[:, None]).reshape(n * NODES, -1)

    inverse = np.linalg.inv(np.eye(n * NODES) - blocks(Q @ Q, Q))
    none = np.zeros((NODES, 1))
    by_theta, by_omega = blocks(one[:, None], none), blocks((Q @ one)[:, None], one[:, None])
    by_start = inverse @ np.hstack([by_theta, by_omega])
    sums = np.stack([weights @ Q, weights])[:, None, None]
    ends = (np.eye(n)[:, :, None] * sums).reshape(2 * n, -1)
    step = np.eye(2 * n) + np.diag(np.full(n, 2 * half), n) + ends @ by_start
    powers = [step]
    while 2 ** len(powers) < pieces:
        powers.append(powers[-1] @ powers[-1])
    return inverse, by_start, ends @ inverse, powers
