"""Planar arms side by side, simulated by a road of its own: it shares no equation with algid.

======  ====================================================  =======================
symbol  name                                                  shape
======  ====================================================  =======================
S       arms that are integrated side by side                 scalar
m, q    angles of the motors and of the links                 (2, S)
b       travel of the base along the horizontal               (S,)
x       the state: m, ṁ, q, q̇, b, ḃ                           (10, S)
======  ====================================================  =======================

Motors turn the links by springs (Spong 1987),

    B m̈ + friction(m, ṁ) + p = τ,   p = K (m − q) + D (ṁ − q̇),   M(q) q̈ + n(q, q̇) = p

with the twist m − q beyond the play; of stiff joints m = q. With centres of mass at δ off their
links, K1 = m2 l1 lc2 exp(i δ2), K2 = g m2 lc2 exp(i δ2) and K4 = m1 g lc1 exp(i δ1) + m2 g l1;
k1, k2, k4 are their real parts, what lies along the links. A base on springs moves with the
reaction of the links.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray

G = 9.81
WIDTH = 0.02  # rad/s, of Coulomb friction's step where an arm is `controlled`
Acting = Callable[[int, FloatArray], FloatArray]
"""By the number of half steps gone and the state: its rate (10, S), or a torque (2, S)."""
Size = FloatArray | float


@dataclass(frozen=True, eq=False)
class Arms:
    """Constants (7, S) of the arms, and what they have beside eq. (1); each broadcasts to (2, S).

    Parameters
    ----------
    sines : (3, S)
        Imaginary parts of K1, K2 and K4.
    coulomb, stribeck, asymmetry, ripple : N m
        Coulomb friction, its excess at rest, half its asymmetry; a torque twelve times a turn.
    width, speed : rad/s, of Coulomb friction's step and of what fades
    load : friction over the joint's load
    rotor : kg m^2
    stiffness, damping, play : N m/rad, N m s/rad, rad either way; a joint of no stiffness is stiff
    mass, spring, damper : kg, N/m, N s/m, of a base that gives
    """

    k: FloatArray
    sines: Size = 0.0
    coulomb: Size = 0.0
    stribeck: Size = 0.0
    asymmetry: Size = 0.0
    ripple: Size = 0.0
    width: Size = 0.05
    speed: Size = 0.3
    load: Size = 0.0
    rotor: Size = 0.0
    stiffness: Size = 0.0
    damping: Size = 0.0
    play: Size = 0.0
    mass: Size = np.inf
    spring: Size = 0.0
    damper: Size = 0.0

    def hanging(self) -> FloatArray:
        """The state at rest."""
        x = np.zeros((10, self.k.shape[1]))
        x[[0, 4]] = -np.pi / 2
        return x

    def rate(self, x: FloatArray, tau: FloatArray) -> FloatArray:
        """The state's derivative under the motors' torque `tau` (2, S)."""
        m, m_dot, q, q_dot = x[:2], x[2:4], x[4:6], x[6:8]
        sign = np.tanh(m_dot / self.width)
        fading = self.stribeck * np.exp(-((m_dot / self.speed) ** 2))
        dry = (self.coulomb + fading) * sign + self.asymmetry * sign**2
        net = tau - self.k[5:7] * m_dot - dry - self.ripple * np.sin(12 * m)
        stiff, twist = np.equal(self.stiffness, 0), m - q
        passed = self.stiffness * (twist - np.clip(twist, -self.play, self.play))
        passed = np.where(stiff, net, passed + self.damping * (m_dot - q_dot))
        alpha, travel = self._links(q, q_dot, passed, np.where(stiff, self.rotor, 0.0), x[8:])
        motor = np.where(stiff, alpha, (net - passed) / np.where(stiff, 1.0, self.rotor))
        return np.concatenate([m_dot, motor, q_dot, alpha, x[9:], travel[None]])

    def _links(
        self,
        q: FloatArray,
        q_dot: FloatArray,
        acting: FloatArray,
        own: FloatArray,
        base: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Accelerations of the links (2, S), with rotors `own` on their axes, and of the base."""
        K = self.k[[0, 1, 3]] + 1j * self.sines
        turned = K[0] * np.exp(1j * q[1])
        both, first = K[1] * np.exp(1j * (q[0] + q[1])), K[2] * np.exp(1j * q[0])
        m22 = self.k[2]
        m12 = m22 + turned.real
        m11 = self.k[4] + m12 + turned.real
        w1, w2 = q_dot
        # d Re(K1 e^{iθ2}) / dθ2 = −Im(K1 e^{iθ2}): what is centripetal
        h1 = first.real + both.real - turned.imag * (2 * w1 + w2) * w2
        h = np.stack([h1, both.real + turned.imag * w1**2])
        # The base's acceleration enters both joints as a tilt of gravity would.
        pull = -np.stack([(first + both).imag, both.imag]) / G
        thrown = (first.real * w1**2 + both.real * (w1 + w2) ** 2) / G
        force = thrown - self.spring * base[0] - self.damper * base[1]
        b = acting - pull * force / self.mass
        dissipation = self.load * np.tanh(q_dot / self.width)
        sign = np.sign(acting)
        for _ in range(2 if np.any(dissipation) else 1):
            share = 1 + dissipation * sign
            # Schur's complement of the base
            a11, a22 = share * np.stack([m11, m22]) + own - pull**2 / self.mass
            a12, a21 = share * m12 - pull[0] * pull[1] / self.mass
            r1, r2 = b - share * h
            alpha = np.stack([a22 * r1 - a12 * r2, a11 * r2 - a21 * r1]) / (a11 * a22 - a12 * a21)
            sign = np.sign(
                np.stack([m11 * alpha[0] + m12 * alpha[1], m12 * alpha[0] + m22 * alpha[1]]) + h
            )
        return alpha, (force - np.sum(pull * alpha, axis=0)) / self.mass


def inertias(k: FloatArray) -> FloatArray:
    """Of constants (7, …) the stretched arm's inertia about joint 1, link 2's about joint 2."""
    return np.stack([k[4] + k[2] + 2 * k[0], k[2]])


def swung(
    rate: Acting,
    torque: Acting,
    x: FloatArray,
    samples: int,
    h: float,
    substeps: int = 1,
    sampled: Callable[[int, FloatArray], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """States (n, d, S) and torques (n, 2, S) at each sample, by Runge and Kutta's fourth order.

    Parameters
    ----------
    rate, torque : what moves the state from `x` (d, S), and what is logged beside it
    h : s, from one sample to the next, in which there are so many `substeps`
    sampled : called at each sample, for what holds until the next
    """
    states, torques = [], []
    step = h / substeps
    for first in range(0, 2 * substeps * samples, 2 * substeps):
        if sampled is not None:
            sampled(first, x)
        states.append(x)
        torques.append(torque(first, x))
        for half in range(first, first + 2 * substeps, 2):
            a = rate(half, x)
            b = rate(half + 1, x + step / 2 * a)
            c = rate(half + 1, x + step / 2 * b)
            x = x + step / 6 * (a + 2 * b + 2 * c + rate(half + 2, x + step * c))
    return np.stack(states), np.stack(torques)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a controller follows at times half a sample apart: θ_d, θ̇_d, τ_ff, (2, 2 N - 1) each."""

    theta: FloatArray
    omega: FloatArray
    torque: FloatArray


@dataclass(frozen=True, eq=False)
class Controller:
    """Gains P and D, (2,) each: τ = τ_ff + P (θ_d − y) + D (θ̇_d − ẏ).

    A digital one holds its torque from one sample to the next. It sees angles with white noise of
    `seen` rad, and their backward difference behind a low-pass of `bandwidth` Hz; any other sees
    the true state at every instant.
    """

    P: FloatArray
    D: FloatArray
    digital: bool = False
    seen: float = 0.0
    bandwidth: float = 100.0


def controlled(
    k: FloatArray,
    plan: Plan,
    controller: Controller,
    coulomb: FloatArray,
    rate: float,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """True angles and torques, and angles as the controller saw them (2, N), from the plan's start.

    The arm has the constants `k` (7,) and Coulomb friction (2,) in N m over `WIDTH`.
    """
    arms, h, seen = Arms(k[:, None], coulomb=coulomb[:, None], width=WIDTH), 1 / rate, []
    keep = np.exp(-2 * np.pi * controller.bandwidth * h)
    x = arms.hanging()
    x[:2] = x[4:6] = plan.theta[:, :1]
    slope: FloatArray = plan.omega[:, :1]
    x[2:4] = x[6:8] = slope
    before: FloatArray = x[:2] - h * slope
    held: FloatArray = np.zeros((2, 1))

    def push(half: int, y: FloatArray, v: FloatArray) -> FloatArray:
        wanted = (one[:, [min(half, one.shape[1] - 1)]] for one in (plan.theta, plan.omega))
        error, slower = (one - own for one, own in zip(wanted, (y, v), strict=True))
        force = controller.P[:, None] * error + controller.D[:, None] * slower
        return np.asarray(plan.torque[:, [min(half, plan.torque.shape[1] - 1)]] + force)

    def sampled(half: int, x: FloatArray) -> None:
        nonlocal slope, before, held
        y = x[:2]
        if controller.digital:
            y = y + controller.seen * rng.standard_normal((2, 1))
            slope = keep * slope + (1 - keep) * (y - before) / h
            before, held = y, push(half, y, slope)
        seen.append(y[:, 0])

    def torque(half: int, x: FloatArray) -> FloatArray:
        return held if controller.digital else push(half, x[:2], x[2:4])

    states, torques = swung(
        lambda half, x: arms.rate(x, torque(half, x)),
        torque,
        x,
        plan.theta.shape[1] // 2 + 1,
        h,
        sampled=sampled,
    )
    return states[:, :2, 0].T, torques[..., 0].T, np.array(seen).T
