"""Simulate the arm under a torque: eq. (1) integrated by an eighth-order Runge-Kutta method.

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

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import DOP853, solve_ivp

from algid.arm import FloatArray, forward_dynamics
from algid.synth.excitation import SampledTorque, Torque

RELATIVE_TOLERANCE = 1e-12
ABSOLUTE_TOLERANCE = 1e-13
STEERED_TOLERANCE = 1e-8
LONGEST_STEP = 0.01  # s: no torque of interest changes unseen within it
HANGING = np.array([-np.pi / 2, 0.0])


@dataclass(frozen=True, eq=False)
class Motion:
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
) -> Motion:
    """Move the arm `k` by `torque` from rest, or from `theta0` (2,) rad and `omega0` (2,) rad/s at `t[0]`.

    Parameters
    ----------
    k : (7,) float64, constants k1 … k7, with the payload's share where there is one
    torque : callable (M,) s -> (2, M) N m
    t : (N,) float64, s, increasing, at least two
    reached : callable
        Called with each time in s that the integration has come to.

    Returns
    -------
    Motion
        Angles within 1e-9 rad of the exact solution over tens of seconds.

    Raises
    ------
    ValueError
        If there are fewer than two times or they do not increase.
    """
    if t.size < 2 or np.any(np.diff(t) <= 0):
        raise ValueError(f"t must hold at least two increasing times, got {t.size}")
    start = np.concatenate([theta0, np.zeros(2) if omega0 is None else omega0])
    states = _states(k, torque, t, start, reached or (lambda _now: None))
    return Motion(t=t, theta=states[:2], omega=states[2:], tau=torque(t))


def steered(
    k: FloatArray,
    controller: Callable[[float, FloatArray], FloatArray],
    t: FloatArray,
    theta0: FloatArray,
    reached: Callable[[float], None] | None = None,
) -> Motion:
    """Move the arm `k` from rest at `theta0` (2,) rad by a torque (2,) N m that depends on time and state (4,).

    Parameters and results as for `simulate`; a controller pulls errors together, so its tolerance is wider:
    angles within 1e-8 rad of the exact solution.
    """
    start = np.concatenate([theta0, np.zeros(2)])
    tolerances = (STEERED_TOLERANCE, STEERED_TOLERANCE)
    states = _integrated(k, controller, t, start, tolerances, reached or (lambda _now: None))
    tau = np.stack([controller(now, state) for now, state in zip(t.tolist(), states.T, strict=True)], axis=1)
    return Motion(t=t, theta=states[:2], omega=states[2:], tau=tau)


def _states(
    k: FloatArray, torque: Torque, t: FloatArray, start: FloatArray, reached: Callable[[float], None]
) -> FloatArray:
    if isinstance(torque, SampledTorque):
        return _piecewise(k, torque, t, start, reached)
    return _smooth(k, torque, t, start, reached)


def _rate(k: FloatArray, state: FloatArray, tau: FloatArray) -> FloatArray:
    return np.concatenate([state[2:], forward_dynamics(k, state[:2], state[2:], tau)])


def _smooth(
    k: FloatArray, torque: Torque, t: FloatArray, start: FloatArray, reached: Callable[[float], None]
) -> FloatArray:
    """States (4, N) under a smooth torque."""
    tolerances = (RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE)
    return _integrated(k, lambda now, _state: torque(np.array([now]))[:, 0], t, start, tolerances, reached)


def _integrated(
    k: FloatArray,
    drive: Callable[[float, FloatArray], FloatArray],
    t: FloatArray,
    start: FloatArray,
    tolerances: tuple[float, float],
    reached: Callable[[float], None],
) -> FloatArray:
    """States (4, N) at `t` under a torque (2,) of time and state, to relative and absolute `tolerances`."""

    def step(now: float, _state: FloatArray) -> float:
        reached(now)
        return 1.0  # an event that never comes: scipy asks for it once a step

    solution = solve_ivp(
        lambda now, state: _rate(k, state, drive(now, state)),
        (t[0], t[-1]),
        start,
        method="DOP853",
        t_eval=t,
        rtol=tolerances[0],
        atol=tolerances[1],
        max_step=LONGEST_STEP,
        events=step,
    )
    states: FloatArray = solution.y
    return states


def _piecewise(
    k: FloatArray, torque: SampledTorque, t: FloatArray, start: FloatArray, reached: Callable[[float], None]
) -> FloatArray:
    """States (4, N) under a sampled torque: each step ends where the torque has a corner."""
    corners = torque.t[(torque.t > t[0]) & (torque.t < t[-1])]
    ends = np.unique(np.concatenate([t, corners]))
    states = np.empty((4, ends.size))
    states[:, 0] = start
    for index, (begin, end) in enumerate(pairwise(ends)):
        states[:, index + 1] = _step(k, _piece(torque, begin, end), begin, end, states[:, index])
        reached(end)
    return states[:, np.searchsorted(ends, t)]


def _piece(torque: SampledTorque, begin: float, end: float) -> tuple[FloatArray, FloatArray]:
    """Value at `begin` and slope of a sampled torque that is smooth in between: (2,) N m and (2,) N m/s."""
    middle = 0.5 * (begin + end)
    if torque.hold == "zoh":
        return torque(np.array([middle]))[:, 0], np.zeros(2)
    first, last = torque(np.array([begin, end])).T
    return first, (last - first) / (end - begin)


def _step(
    k: FloatArray, piece: tuple[FloatArray, FloatArray], begin: float, end: float, state: FloatArray
) -> FloatArray:
    value, slope = piece
    solver = DOP853(
        lambda now, y: _rate(k, y, value + slope * (now - begin)),
        begin,
        state,
        end,
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
        first_step=end - begin,
    )
    while solver.status == "running":
        solver.step()
    final: FloatArray = solver.y
    return final
