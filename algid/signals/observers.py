"""Joint velocities from measured angles: the derivative observer of Páez-García et al. 2023, eq. (6).

======  =============================================  ===============  ==========
symbol  name                                           shape            unit
======  =============================================  ===============  ==========
A, C    model of two chains of three integrators       (6, 6), (2, 6)
L       gain                                           (6, 2)
x       state [θ1, θ̇1, θ̈1, θ2, θ̇2, θ̈2]              (6, N)           rad, s
y       measured angles θ1, θ2                         (2, N)           rad
=====   =============================================  ===============  ==========

The paper states its model as "θ̈ = 0"; its A has θ⃛ = 0, which is what is built here. It does not state L,
which pole placement leaves open for two outputs: here the first three poles belong to joint 1 and the last three
to joint 2, so that L is unique and no joint's angle disturbs the other's velocity. (The least sensitive gain, as
`scipy.signal.place_poles` seeks it, is not reached for the paper's poles: its iteration does not settle.)
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray

PAPER_POLES = (-80.0, -390.0, -391.0, -392.0, -393.0, -394.0)

_CHAIN = np.diag([1.0, 1.0], 1)
A = np.kron(np.eye(2), _CHAIN)
C = np.eye(6)[[0, 3]]
C_OBS = np.eye(6)[[1, 4]]


def observer_gain(poles: tuple[complex, ...]) -> FloatArray:
    """Gain L (6, 2) that places the eigenvalues of A − L C at `poles` (rad/s), three a joint.

    Raises
    ------
    ValueError
        If there are not six poles, one does not decay, or the three of a joint are not real or conjugate.
    """
    if len(poles) != 6 or any(np.real(pole) >= 0 for pole in poles):
        raise ValueError(f"poles must be six with negative real part, got {poles}")
    gain = np.zeros((6, 2))
    for joint in range(2):
        characteristic = np.poly(np.array(poles[3 * joint : 3 * joint + 3]))
        if np.iscomplexobj(characteristic):
            raise ValueError(f"the poles of a joint must be real or conjugate, got {poles}")
        gain[3 * joint : 3 * joint + 3, joint] = characteristic[1:]
    return gain


class LuenbergerObserver:
    """The observer x̂' = (A − L C) x̂ + L y, discretised exactly for angles that are linear between samples.

    It carries its state from call to call, so that a long log may pass through in pieces. The recursion runs
    in Schur coordinates, as a cascade of first-order filters: orthogonal, so that close poles cost no digits,
    and without a loop over samples.

    Parameters
    ----------
    dt : float, s
    poles : six complex, rad/s
    """

    def __init__(self, dt: float, poles: tuple[complex, ...] = PAPER_POLES) -> None:
        gain = observer_gain(poles)
        transition, self._now, self._next = _first_order_hold(A - gain @ C, gain, dt)
        kind = "complex" if np.iscomplexobj(np.array(poles)) else "real"
        import scipy.linalg

        self._triangle, self._basis = scipy.linalg.schur(transition, output=kind)
        self._state: FloatArray | None = None
        self._last_angles: FloatArray = np.empty(2)

    def reset(self) -> None:
        """Forget the state: the next call starts at rest."""
        self._state = None

    def velocities(self, theta: FloatArray) -> FloatArray:
        """Observed joint velocities (2, N) in rad/s of the angles `theta` (2, N) in rad.

        The first call, and the first one after `reset`, starts at rest at the first angles; any other takes
        `theta` as following the last sample of the call before.
        """
        if self._state is None:
            self._state = self._basis.conj().T @ np.array([theta[0, 0], 0, 0, theta[1, 0], 0, 0])
            self._last_angles = theta[:, 0]
        before = np.concatenate([self._last_angles[:, None], theta[:, :-1]], axis=1)
        drive = self._basis.conj().T @ (self._now @ before + self._next @ theta)
        states = self._cascade(drive)
        self._state, self._last_angles = states[:, -1].copy(), theta[:, -1].copy()
        velocities: FloatArray = np.real(C_OBS @ self._basis @ states)
        return velocities

    def _cascade(self, drive: FloatArray) -> FloatArray:
        """States (6, N) of z[n] = T z[n-1] + drive[n], T upper triangular: from the last state to the first."""
        assert self._state is not None
        triangle = self._triangle
        states = np.empty_like(drive)
        for row in reversed(range(6)):
            later = triangle[row, row + 1 :]
            total = drive[row].copy()
            total[0] += later @ self._state[row + 1 :]
            total[1:] += later @ states[row + 1 :, :-1]
            pole = triangle[row, row]
            total[0] += pole * self._state[row]
            states[row] = _recursion(pole, total)
        return states


def _recursion(pole: complex, drive: FloatArray) -> FloatArray:
    """z (N,) of z[n] = pole z[n-1] + drive[n] from rest: a triangular system of two bands."""
    from scipy.linalg import get_lapack_funcs

    band = np.empty((2, drive.size), drive.dtype)
    band[0], band[1] = 1.0, -pole
    (substitute,) = get_lapack_funcs(("tbtrs",), (band, drive))
    found, _ = substitute(band, drive[:, None], uplo="L")
    return found[:, 0]


def _first_order_hold(a: FloatArray, b: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Φ, Γ0, Γ1 with x[n+1] = Φ x[n] + Γ0 y[n] + Γ1 y[n+1] for y linear in between, by one matrix exponential."""
    import scipy.linalg

    states, inputs = b.shape
    block = np.zeros((states + 2 * inputs, states + 2 * inputs))
    block[:states, :states] = a * dt
    block[:states, states : states + inputs] = b * dt
    block[states : states + inputs, states + inputs :] = np.eye(inputs)
    power = scipy.linalg.expm(block)
    constant, ramp = power[:states, states : states + inputs], power[:states, states + inputs :]
    return power[:states, :states], constant - ramp, ramp
