"""Simulate the arm under a torque: eq. (1) integrated by Gauss collocation.

======  ============================  ======  ======
symbol  name                          shape   unit
======  ============================  ======  ======
k       constants k1 … k7             (7,)    Table 1
t       sample times                  (N,)    s
theta   joint angles                  (2, N)  rad
omega   joint velocities              (2, N)  rad/s
tau     joint torques                 (2, N)  N m
======  ============================  ======  ======
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray, forward_dynamics
from algid.base.errors import SettingError
from algid.synth.collocation import Acceleration, integrate
from algid.synth.excitation import SampledTorque, Torque

Driven = Callable[[FloatArray, FloatArray], FloatArray]
"""Torque (2, M) in N m for angles and velocities (2, M) in rad and rad/s, at known times."""

HANGING = np.array([-np.pi / 2, 0.0])


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """What the arm did at the times `t`: see the table above."""

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    tau: FloatArray


def simulate(
    k: FloatArray,
    torque: Torque,
    t: FloatArray,
    theta0: FloatArray = HANGING,
    omega0: FloatArray | None = None,
    reached: Callable[[float], None] | None = None,
    since: Sequence[float] = (),
) -> SimulatedMotion:
    """Move an arm by torques.

    Parameters
    ----------
    k : (7,) float64, constants k1 … k7, with the payload's share where there is one; or (7, P), of
        P payloads one after the other
    torque : callable (M,) s -> (2, M) N m
    t : (N,) float64, s, increasing, at least two
    theta0 : (2,) float64, rad, at `t[0]`; hanging by default
    omega0 : (2,) float64, rad/s, at `t[0]`; at rest by default
    reached : callable
        Called with each time in s that the integration has come to.
    since : (P - 1,) float, s, increasing
        When each payload takes the place of the one before.

    Returns
    -------
    SimulatedMotion
        Angles within 1e-9 rad of the exact solution over tens of seconds.

    Raises
    ------
    ValueError
        If there are fewer than two times or they do not increase.
    SettingError
        If the motion grows without bound.

    Examples
    --------
    An arm that nothing drives, let go where it hangs:

    >>> import numpy as np
    >>> import algid
    >>> arm = algid.Arm(1.2, 0.8, 0.15, 0.12, 0.3, 0.25, 0.01, 0.006, 0.5, 0.4, 9.81)
    >>> still = lambda t: np.zeros((2, t.size))
    >>> motion = algid.simulate(arm.constants(), still, np.linspace(0.0, 1.0, 101))
    >>> bool(np.ptp(motion.theta, axis=1).max() < 1e-6)
    True
    """
    if t.size < 2 or np.any(np.diff(t) <= 0):
        raise ValueError(f"t must hold at least two increasing times, got {t.size}")

    def driven(times: FloatArray) -> Driven:
        tau = torque(times)
        return lambda _theta, _omega: tau

    corners = torque.t if isinstance(torque, SampledTorque) else np.zeros(0)
    if len(since):
        corners = np.unique(np.append(corners, since))
    return steered(k, driven, t, theta0, corners, reached, omega0, since)


def steered(
    k: FloatArray,
    controller: Callable[[FloatArray], Driven],
    t: FloatArray,
    theta0: FloatArray,
    corners: FloatArray | None = None,
    reached: Callable[[float], None] | None = None,
    omega0: FloatArray | None = None,
    since: Sequence[float] = (),
) -> SimulatedMotion:
    """Move the arm `k` by a torque that depends on time and state.

    Parameters and errors as for `simulate`, save

    Parameters
    ----------
    controller : callable
        Takes times (M,) s, and gives what maps angles (2, M) rad and velocities (2, M) rad/s to
        torques (2, M) N m.
    corners : (C,) float64, s, increasing
        Times at which the torque or a derivative of it jumps.

    Raises
    ------
    SettingError
        If the motion grows without bound.
    """
    start = np.concatenate([theta0, np.zeros(2) if omega0 is None else omega0])
    if not np.any(k[7:]):
        k = k[:7]  # a straight arm takes fewer operations

    def accelerate_at(times: FloatArray) -> Acceleration:
        torque, own = controller(times), k
        if len(since):
            own = k[:, np.searchsorted(since, times, side="right")]
        return lambda theta, omega: forward_dynamics(own, theta, omega, torque(theta, omega))

    try:
        states = integrate(accelerate_at, start, t, corners, reached)
    except ArithmeticError as error:
        raise SettingError(
            f"{error}; expected an arm that moves: give a weaker torque or another initial state"
        ) from error
    return SimulatedMotion(t, states[:2], states[2:], controller(t)(states[:2], states[2:]))
