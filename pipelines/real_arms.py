"""Arms with the errors of real joints and sensors, simulated by a road of its own: no code of the
estimators.

All arms of all rows are integrated side by side by the classical Runge-Kutta method, at steps of
`STEP` s.

======  ====================================================  =======================
symbol  name                                                  shape
======  ====================================================  =======================
S       motions integrated side by side                       scalar
m, q    angles of the motors and of the links                 (2, S)
x       travel of the base along the horizontal               (S,)
======  ====================================================  =======================

A joint of motor inertia B, stiffness K and play ±p passes K times the twist m − q beyond the play.
Stiff joints have m = q. A base on springs moves with the reaction of the links.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from algid.arm import Arm, FloatArray, with_payload
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from pipelines.accuracy_scenes import random_arm

RATE = 1000.0
DURATION = 10.0
STEP = 2e-4
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2


@dataclass(frozen=True)
class Errors:
    """What the arm or its sensors have beside eq. (1); shares are of the RMS torque of each joint.

    Parameters
    ----------
    coulomb, stribeck, asymmetry : share of Coulomb friction, of its excess at rest, of half its
        asymmetry
    stribeck_speed : rad/s
    load : friction over the joint's load
    rotor : inertia of joint 2's rotor over k3
    ripple : share of a torque that repeats twelve times a turn
    elastic : Hz of a link against its locked motor, 0 for stiff joints
    play : rad, either way, behind an elastic joint
    base : Hz of a base that gives, 0 for none
    gains : of the two torque sensors
    offset, drift : shares of a torque offset and of its random walk over the log
    lag, delay : s, of the logged torque behind the true one, and ahead of it
    zero : rad, of both angles
    push : share of a torque that no sensor sees, an Ornstein-Uhlenbeck process of `PERSISTENCE` s
    hold : s, from one change of the motors' torque to the next; it is logged as it is set
    """

    coulomb: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.3
    asymmetry: float = 0.0
    load: float = 0.0
    rotor: float = 0.0
    ripple: float = 0.0
    elastic: float = 0.0
    play: float = 0.0
    base: float = 0.0
    gains: tuple[float, float] = (1.0, 1.0)
    offset: float = 0.0
    drift: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    zero: tuple[float, float] = (0.0, 0.0)
    push: float = 0.0
    hold: float = 0.0

    @property
    def mechanical(self) -> Errors:
        """Those that change the motion, without those of the sensors."""
        return replace(
            self, gains=(1.0, 1.0), offset=0.0, drift=0.0, lag=0.0, delay=0.0, zero=(0.0, 0.0)
        )


DEGREE = np.pi / 180
PERSISTENCE = 0.05  # s
ROWS = {
    "none": Errors(),
    "Coulomb friction 3 %": Errors(coulomb=0.03),
    "Coulomb friction 10 %": Errors(coulomb=0.1),
    "Coulomb 10 %, Stribeck + 5 %": Errors(coulomb=0.1, stribeck=0.05),
    "asymmetric Coulomb 12 / 8 %": Errors(coulomb=0.1, asymmetry=0.02),
    "load-dependent friction 5 %": Errors(load=0.05),
    "torque offset 3 %": Errors(offset=0.03),
    "torque offset that drifts": Errors(offset=0.03, drift=0.02),
    "rotor inertia of joint 2": Errors(rotor=0.2),
    "torque gains + 3 / - 3 %": Errors(gains=(1.03, 0.97)),
    "zeros of the angles 1°, - 1°": Errors(zero=(DEGREE, -DEGREE)),
    "torque low-passed at 30 Hz": Errors(lag=1 / (2 * np.pi * 30)),
    "torque 4 ms early": Errors(delay=4e-3),
    "torque ripple 3 %": Errors(ripple=0.03),
    "backlash 0.15° behind a stiff joint": Errors(elastic=60.0, play=0.075 * DEGREE),
    "elastic joints, 15 Hz": Errors(elastic=15.0),
    "a base that gives, 8 Hz": Errors(base=8.0),
    "all of it, mildly": Errors(
        coulomb=0.04,
        stribeck=0.02,
        asymmetry=0.005,
        load=0.02,
        rotor=0.05,
        ripple=0.005,
        offset=0.01,
        delay=1e-3,
    ),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """An arm of one row, its motion and logged torque (2, N), without noise; `truth` by name."""

    arm: Arm
    payload: float
    theta: FloatArray
    tau: FloatArray
    truth: dict[str, float] = field(default_factory=dict)

    def log(self, rng: np.random.Generator) -> Segment:
        """One draw of the sensors' noise."""
        theta, tau = (rng.standard_normal(self.theta.shape) for _ in range(2))
        return Segment(0.0, 1 / RATE, self.theta + SIGMA_THETA * theta, self.tau + SIGMA_TAU * tau)


def scenes(rows: list[str], arms: list[int]) -> dict[tuple[str, int, bool], Scene]:
    """Scenes by row, arm and load.

    The friction's width is each arm's own, from 0.03 to 0.2 rad/s.
    """
    keys = [(row, seed, loaded) for row in rows for seed in arms for loaded in (False, True)]
    moving = list(dict.fromkeys((ROWS[row].mechanical, seed, loaded) for row, seed, loaded in keys))
    cases = [_Case.of(*key) for key in moving]
    moved = dict(zip(moving, zip(cases, _integrate(cases), strict=True), strict=True))
    return {key: _sensed(ROWS[key[0]], *moved[ROWS[key[0]].mechanical, *key[1:]]) for key in keys}


def campaigns(
    errors: Errors, arms: list[int], unloaded: int, loaded: int = 0
) -> dict[int, list[Scene]]:
    """By arm so many unloaded and loaded motions, all different, of one row of errors."""
    keys = [
        (arm, kind, run)
        for arm in arms
        for kind in (False, True)
        for run in range(loaded if kind else unloaded)
    ]
    cases = [_Case.of(errors.mechanical, arm, kind, run) for arm, kind, run in keys]
    found: dict[int, list[Scene]] = {arm: [] for arm in arms}
    for case, theta in zip(cases, _integrate(cases), strict=True):
        found[case.seed].append(_sensed(errors, case, theta))
    return found


@dataclass(frozen=True, eq=False)
class _Case:
    errors: Errors
    seed: int
    arm: Arm
    payload: float
    loaded: bool
    k: FloatArray
    times: FloatArray
    torque: FloatArray
    size: FloatArray
    width: float
    push: FloatArray

    @classmethod
    def of(cls, errors: Errors, seed: int, loaded: bool, run: int = 0) -> _Case:
        arm, payload = random_arm(seed)
        k = arm.constants()
        wide = wide_multi_sine(arm, 1000 * seed + loaded + 10 * run)
        times = np.arange(2 * round(DURATION / STEP) + 1) * (STEP / 2)
        torque = wide(times)
        if errors.hold:
            every = round(2 * errors.hold / STEP)
            torque = torque[:, np.arange(times.size) // every * every]
        width = float(np.exp(np.random.default_rng(seed).uniform(np.log(0.03), np.log(0.2))))
        # The unloaded arm's, so that the loaded one has the same joints.
        size = np.sqrt(np.mean(wide_multi_sine(arm, 1000 * seed)(times) ** 2, axis=1))
        if loaded:
            k = with_payload(k, arm.payload_constants(payload))
        push = (
            size[:, None]
            * errors.push
            * _wandering(times.size, np.random.default_rng([seed, loaded, run]))
        )
        return cls(errors, seed, arm, payload, loaded, k, times, torque, size, width, push)


def _wandering(count: int, rng: np.random.Generator) -> FloatArray:
    """An Ornstein-Uhlenbeck process (2, count) of unit variance, at half the steps of the
    integration.
    """
    from scipy.signal import lfilter

    keep = np.exp(-0.5 * STEP / PERSISTENCE)
    white = np.sqrt(1 - keep**2) * rng.standard_normal((2, count))
    white[:, 0] /= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=1))


def _integrate(cases: list[_Case]) -> list[FloatArray]:
    """Motor angles (2, N) at `RATE` of each case."""
    drive = np.stack([case.torque + case.push for case in cases], axis=-1)
    arms = _Arms(cases)
    state = np.zeros((10, len(cases)))
    state[0] = state[4] = -np.pi / 2
    every = round(1 / RATE / STEP)
    steps = round(DURATION / STEP)
    kept = np.empty((steps // every + 1, 2, len(cases)))
    for step in range(steps + 1):
        if step % every == 0:
            kept[step // every] = state[:2]
        if step == steps:
            break
        first, middle, last = (drive[:, 2 * step + part] for part in range(3))
        a = arms.rate(state, first)
        b = arms.rate(state + 0.5 * STEP * a, middle)
        c = arms.rate(state + 0.5 * STEP * b, middle)
        d = arms.rate(state + STEP * c, last)
        state = state + STEP / 6 * (a + 2 * b + 2 * c + d)
        if np.any(arms.stiff):
            state[4:8, arms.stiff] = state[:4, arms.stiff]
    return [kept[:, :, place].T.copy() for place in range(len(cases))]


class _Arms:
    """The right side of all cases' equations of motion.

    a state holds m, ṁ, q, q̇, x, ẋ in its rows.
    """

    def __init__(self, cases: list[_Case]) -> None:
        def each(name: str) -> FloatArray:
            return np.array([getattr(case.errors, name) for case in cases])

        self.k = np.stack([case.k for case in cases], axis=-1)
        size = np.stack([case.size for case in cases], axis=-1)
        self.width = np.array([case.width for case in cases])
        self.f, self.s, self.a, self.r = (
            each(n) * size for n in ("coulomb", "stribeck", "asymmetry", "ripple")
        )
        self.speed, self.e, self.play = each("stribeck_speed"), each("load"), each("play")
        own = np.stack([case.arm.constants() for case in cases], axis=-1)  # without payload
        self.j2 = each("rotor") * own[2]
        elastic, base = each("elastic"), each("base")
        self.stiff = elastic == 0
        inertia = np.stack([own[4] + own[2], own[2]])
        self.motor = np.where(self.stiff, 1.0, MOTOR_SHARE * inertia)
        self.stiffness = np.where(self.stiff, 0.0, (2 * np.pi * elastic) ** 2 * inertia)
        self.damping = np.where(self.stiff, 0.0, 0.04 * np.sqrt(self.stiffness * inertia))
        self.first, self.second = self.k[3] / 9.81, self.k[1] / 9.81  # Σ m lc along each link, kg m
        self.base = base > 0
        self.mass = np.array([4 * (case.arm.m1 + case.arm.m2) for case in cases])  # of base and arm
        self.spring, self.damper = (
            self.mass * (2 * np.pi * base) ** 2,
            0.1 * self.mass * 2 * np.pi * base,
        )

    def rate(self, state: FloatArray, tau: FloatArray) -> FloatArray:
        """The state's derivative under the motors' torque `tau` (2, S)."""
        m, m_dot, q, q_dot, (x, x_dot) = state[:2], state[2:4], state[4:6], state[6:8], state[8:]
        net = tau - self._friction(m, m_dot)
        twist = m - q
        passed = self.stiffness * (twist - np.clip(twist, -self.play, self.play)) + self.damping * (
            m_dot - q_dot
        )
        acting = np.where(self.stiff, net, passed)
        alpha, x_ddot = self._accelerations(q, q_dot, acting, x, x_dot)
        motor = np.where(self.stiff, alpha, (net - passed) / self.motor)
        return np.concatenate([m_dot, motor, q_dot, alpha, x_dot[None], x_ddot[None]])

    def _friction(self, m: FloatArray, m_dot: FloatArray) -> FloatArray:
        sign = np.tanh(m_dot / self.width)
        fading = np.exp(-((m_dot / self.speed) ** 2))
        dry = (self.f + self.s * fading) * sign + self.a * sign**2
        return np.asarray(self.k[5:7] * m_dot + dry + self.r * np.sin(12 * m))

    def _accelerations(
        self, q: FloatArray, q_dot: FloatArray, acting: FloatArray, x: FloatArray, x_dot: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Accelerations of the links (2, S) and of the base (S,)."""
        k1, k2, k3, k4, k5 = self.k[:5]
        s1, s2, s12 = np.sin(q[0]), np.sin(q[1]), np.sin(q[0] + q[1])
        c1, c2, c12 = np.cos(q[0]), np.cos(q[1]), np.cos(q[0] + q[1])
        m11, m12, m22 = k5 + k3 + 2 * k1 * c2, k3 + k1 * c2, k3
        w1, w2 = q_dot
        h = np.stack(
            [-k1 * s2 * (2 * w1 + w2) * w2 + k4 * c1 + k2 * c12, k1 * s2 * w1**2 + k2 * c12]
        )
        # The base's acceleration enters both joints as a tilt of gravity would.
        pull = np.where(
            self.base, np.stack([-self.first * s1 - self.second * s12, -self.second * s12]), 0.0
        )
        thrown = self.first * c1 * w1**2 + self.second * c12 * (w1 + w2) ** 2
        force = -self.spring * x - self.damper * x_dot + np.where(self.base, thrown, 0.0)
        total = self.mass
        dissipation = self.e * np.tanh(q_dot / self.width)
        alpha = np.zeros_like(q)
        sign = np.sign(acting)
        for _ in range(2 if np.any(self.e > 0) else 1):
            share = 1 + dissipation * sign
            a11, a12 = share[0] * m11, share[0] * m12
            a21, a22 = share[1] * m12, share[1] * m22 + self.j2
            b = acting - share * h
            if np.any(self.base):  # Schur complement of the base
                b = b - pull * (force / total)
                a11, a12 = a11 - pull[0] ** 2 / total, a12 - pull[0] * pull[1] / total
                a21, a22 = a21 - pull[0] * pull[1] / total, a22 - pull[1] ** 2 / total
            determinant = a11 * a22 - a12 * a21
            alpha = np.stack([a22 * b[0] - a12 * b[1], a11 * b[1] - a21 * b[0]]) / determinant
            sign = np.sign(
                np.stack([m11 * alpha[0] + m12 * alpha[1], m12 * alpha[0] + m22 * alpha[1]]) + h
            )
        x_ddot = np.where(self.base, (force - pull[0] * alpha[0] - pull[1] * alpha[1]) / total, 0.0)
        return alpha, x_ddot


MOTOR_SHARE = 0.05  # of an elastic joint's motor inertia in that of its link


def _sensed(errors: Errors, case: _Case, theta: FloatArray) -> Scene:
    """What the sensors log of a case."""
    dense = case.torque * np.array([[errors.gains[0]], [errors.gains[1]]])
    if errors.lag:
        from scipy.signal import lfilter

        decay = np.exp(-0.5 * STEP / errors.lag)
        mean = (1 - decay) * errors.lag / (0.5 * STEP)
        dense, _ = lfilter(
            [1 - mean, mean - decay], [1, -decay], dense, axis=1, zi=mean * dense[:, :1]
        )
    stride = 2 * round(1 / RATE / STEP)
    ahead = round(errors.delay / (0.5 * STEP))
    tau = np.concatenate([dense[:, ahead:], np.repeat(dense[:, -1:], ahead, axis=1)], axis=1)[
        :, ::stride
    ]
    rng = np.random.default_rng([case.seed, case.loaded])
    size = case.size[:, None]
    walk = np.cumsum(rng.standard_normal(tau.shape), axis=1) / np.sqrt(tau.shape[1])
    tau = tau + size * (errors.offset * np.array([[1.0], [-1.0]]) + errors.drift * walk)
    return Scene(
        case.arm, case.payload, theta - np.array(errors.zero)[:, None], tau, _truth(case, errors)
    )


def _truth(case: _Case, errors: Errors) -> dict[str, float]:
    """k1 … k7, m_p, l1, l2 in the units of the first joint's torque sensor.

    Where the angles' zeros are off, of k1, k2 and k4 the cosine's part over the logged angles,
    which is what a model with phases has by these names.
    """
    k = case.arm.constants()
    first, second = errors.zero
    k[[0, 1, 3]] *= np.cos([second, first + second, first])
    if errors.elastic:
        k[4] += MOTOR_SHARE * (k[4] + k[2])
    gain = errors.gains[0]
    values = {f"k{number}": gain * float(value) for number, value in enumerate(k, 1)}
    return {**values, "m_p": gain * case.payload, "l1": case.arm.l1, "l2": case.arm.l2}
