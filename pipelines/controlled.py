"""Arms under a controller, many draws side by side.

It shares no equation with algid: inertia, centripetal torques and weight are written out from the
masses, one Runge-Kutta step of fourth order a sample.

======  =======================================================  =========
symbol  name                                                     shape
======  =======================================================  =========
θ, ω    angles and velocities of all draws                       (2, B)
m       payloads at the tip                                      (B,)
f       Coulomb friction of each joint                           (2, B)
y       angles as the controller sees them                       (2, B)
======  =======================================================  =========

    τ = τ_ff + P (θ_d − y) + D (θ̇_d − ẏ)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import Arm, FloatArray

WIDTH = 0.02  # rad/s, of the Coulomb friction's step


@dataclass(frozen=True, eq=False)
class Plan:
    """What a controller follows: θ_d, θ̇_d and τ_ff, each (2, 2 N - 1) at times half a sample
    apart.
    """

    theta: FloatArray
    omega: FloatArray
    torque: FloatArray


@dataclass(frozen=True, eq=False)
class Controller:
    """Gains P and D, (2, 2) each.

    A digital one holds its torque from one sample to the next. It sees angles with white noise of
    `seen` rad, and their backward difference behind a low-pass of `bandwidth` Hz; any other sees
    the true state at every instant.
    """

    P: FloatArray
    D: FloatArray
    digital: bool = False
    seen: FloatArray | float = 0.0
    bandwidth: float = 100.0


@dataclass(frozen=True, eq=False)
class Motions:
    """Times (N,) in s; true angles and torques (2, N, B).

    Angles as a digital controller saw them (2, N, B).
    """

    t: FloatArray
    theta: FloatArray
    tau: FloatArray
    seen: FloatArray


def acceleration(
    arm: Arm, theta: FloatArray, omega: FloatArray, tau: FloatArray, m: FloatArray
) -> FloatArray:
    """Accelerations (2, B) of arms with straight links that carry `m` (B,) kg at the tip."""
    c2, s2 = np.cos(theta[1]), np.sin(theta[1])
    first = arm.m2 * arm.lc2 + m * arm.l2  # moments of link 2 and payload about joint 2
    second = arm.I2 + arm.m2 * arm.lc2**2 + m * arm.l2**2
    beyond = arm.m2 + m
    m12 = second + arm.l1 * first * c2
    m11 = arm.I1 + arm.m1 * arm.lc1**2 + beyond * arm.l1**2 + arm.l1 * first * c2 + m12
    w1, w2 = omega
    swirl = arm.l1 * first * s2
    weight2 = arm.g * first * np.cos(theta[0] + theta[1])
    weight1 = arm.g * (arm.m1 * arm.lc1 + beyond * arm.l1) * np.cos(theta[0]) + weight2
    r1 = tau[0] + swirl * (2 * w1 + w2) * w2 - arm.b1 * w1 - weight1
    r2 = tau[1] - swirl * w1**2 - arm.b2 * w2 - weight2
    return np.stack([second * r1 - m12 * r2, m11 * r2 - m12 * r1]) / (m11 * second - m12**2)


def controlled(
    arm: Arm,
    plan: Plan,
    controller: Controller,
    payload: FloatArray,
    friction: FloatArray,
    rate: float,
    rng: np.random.Generator,
) -> Motions:
    """Motions of all draws from rest at the plan's start.

    Parameters
    ----------
    payload : (N, B), kg, from each sample on
    friction : (N, 2, B) or broadcast to it, N m, from each sample on
    """
    count, batch = payload.shape
    h, P, D = 1 / rate, controller.P, controller.D
    friction = np.broadcast_to(friction, (count, 2, batch))
    theta = plan.theta[:, :1] * np.ones(batch)
    omega = plan.omega[:, :1] * np.ones(batch)
    angles, torques, seen = (np.empty((2, count, batch)) for _ in range(3))
    keep = np.exp(-2 * np.pi * controller.bandwidth * h)
    noise = np.broadcast_to(np.asarray(controller.seen, dtype=np.float64), (2,))[:, None]
    slope, before = omega, theta - h * omega

    for sample in range(count):
        m, f = payload[sample], friction[sample]
        y = theta + noise * rng.standard_normal((2, batch)) if controller.digital else theta
        slope = keep * slope + (1 - keep) * (y - before) / h if controller.digital else omega
        before = y

        def push(half: int, x: FloatArray, v: FloatArray) -> FloatArray:
            at = min(2 * sample + half, plan.theta.shape[1] - 1)  # noqa: B023
            e, e_dot = plan.theta[:, at, None] - x, plan.omega[:, at, None] - v
            return plan.torque[:, at, None] + P @ e + D @ e_dot

        held = push(0, y, slope)
        angles[:, sample], torques[:, sample], seen[:, sample] = theta, held, y

        def moved(half: int, x: FloatArray, v: FloatArray) -> FloatArray:
            tau = held if controller.digital else push(half, x, v)  # noqa: B023
            return acceleration(arm, x, v, tau - f * np.tanh(v / WIDTH), m)  # noqa: B023

        a1 = moved(0, theta, omega)
        v2 = omega + h / 2 * a1
        a2 = moved(1, theta + h / 2 * omega, v2)
        v3 = omega + h / 2 * a2
        a3 = moved(1, theta + h / 2 * v2, v3)
        v4 = omega + h * a3
        a4 = moved(2, theta + h * v3, v4)
        theta = theta + h / 6 * (omega + 2 * v2 + 2 * v3 + v4)
        omega = omega + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return Motions(np.arange(count) / rate, angles, torques, seen)
