"""Joint velocities from measured angles: the derivative observer of Páez-García et al.

2023, eq. (6).

======  =============================================  ===============  ==========
symbol  name                                           shape            unit
======  =============================================  ===============  ==========
A, C    model of two chains of three integrators       (6, 6), (2, 6)
L       gain                                           (6, 2)
x       state [θ1, θ̇1, θ̈1, θ2, θ̇2, θ̈2]              (6, N)           rad, s
y       measured angles θ1, θ2                         (2, N)           rad
=====   =============================================  ===============  ==========

The paper states its model as "θ̈ = 0"; its A has θ⃛ = 0, which is what is built here. It does not
state L, which pole placement leaves open for two outputs: here the first three poles belong to
joint 1 and the last three to joint 2, so that L is unique and no joint's angle disturbs the
other's velocity. (The least sensitive gain, as `scipy.signal.place_poles` seeks it, is not reached
for the paper's poles: its iteration does not settle.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.signals.filters import recursion
from algid.signals.segments import Segment

PAPER_POLES = (-80.0, -390.0, -391.0, -392.0, -393.0, -394.0)

_CHAIN = np.diag([1.0, 1.0], 1)
A = np.kron(np.eye(2), _CHAIN)
C = np.eye(6)[[0, 3]]


def observer_gain(poles: tuple[complex, ...]) -> FloatArray:
    """Gain L (6, 2) that places the eigenvalues of A − L C at `poles` (rad/s), three a joint.

    Raises
    ------
    ValueError
        If there are not six poles, one does not decay, or the three of a joint are not real or
        conjugate.
    """
    if len(poles) != 6 or np.any(np.real(poles) >= 0):
        raise ValueError(f"poles must be six with negative real part, got {poles}")
    gain = np.zeros((6, 2))
    for joint in range(2):
        characteristic = np.poly(np.array(poles[3 * joint : 3 * joint + 3]))
        if np.iscomplexobj(characteristic):
            raise ValueError(f"the poles of a joint must be real or conjugate, got {poles}")
        gain[3 * joint : 3 * joint + 3, joint] = characteristic[1:]
    return gain


def observed(
    segments: Iterable[Segment], poles: tuple[complex, ...] = PAPER_POLES
) -> Iterator[Segment]:
    """Segments of a log with the joint velocities in rad/s that the observer sees.

    It is x̂' = (A − L C) x̂ + L y, discretised exactly for piecewise linear angles, and starts each
    stretch at rest at its first angles. From the angle to the velocity each joint's three poles p
    make the transfer function

        (l2 s + l3) s / (s³ + l1 s² + l2 s + l3),    s³ + l1 s² + l2 s + l3 = Π (s − p)

    which runs as a recursion of third order.
    """
    rest: FloatArray = np.zeros((2, 1))
    states = np.zeros((2, 3))
    for segment in segments:
        if not segment.continues:
            rest, states = segment.theta[:, :1], np.zeros((2, 3))
        omega = np.empty_like(segment.theta)
        for joint in range(2):
            own = slice(joint, joint + 1)
            numerator, denominator = _differentiator(poles[3 * joint : 3 * joint + 3], segment.dt)
            omega[own], states[own] = recursion(
                numerator, denominator, segment.theta[own] - rest[own], states[own]
            )
        yield replace(segment, omega=omega)


def _differentiator(poles: tuple[complex, ...], dt: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator (4,) in z⁻¹ of a joint's velocity, for piecewise linear angles.

    The numerator is what makes the response to one sample, a triangle of ± dt around it (a
    first-order hold).
    """
    held, gain = np.zeros((5, 5)), np.poly(np.array(poles)).real[1:]
    held[:3, :3] = (_CHAIN - np.outer(gain, np.eye(3)[0])) * dt
    held[:3, 3] = gain * dt
    held[3, 4] = 1.0
    size = dt ** np.array([0.0, 1.0, 2.0, 0.0, 0.0])  # so that no row outweighs the others
    step = _exponential(held * np.divide.outer(size, size)) / np.divide.outer(size, size)
    advance, ramp = step[:3, :3], step[:3, 4]
    state = step[:3, 3] - ramp + advance @ ramp
    response = [ramp[1]]
    for _ in range(3):
        response.append(state[1])
        state = advance @ state
    denominator = np.poly(np.exp(np.array(poles) * dt)).real
    return np.convolve(response, denominator)[:4], denominator


_TERMS = 18  # of Taylor's series: of a matrix of norm 1/2 the next is below 1e-22


def _exponential(A: FloatArray) -> FloatArray:
    """e^A of a small matrix: Taylor's series of A / 2^s, squared s times.

    Method 3 of Moler & Van Loan 2003. (SciPy's does the same; a short log would wait longer for
    its import than for all figures of its page.)
    """
    norm = float(np.abs(A).sum(axis=0).max())
    halvings = max(0, int(np.ceil(np.log2(max(norm, 0.5)))) + 1)
    term = total = np.eye(len(A))
    for n in range(1, _TERMS + 1):
        term = term @ A / (n * 2.0**halvings)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
