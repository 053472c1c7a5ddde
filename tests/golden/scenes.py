"""Logs of simulated arms that reach what few logs do: disturbances, controllers, limits, joints
without a motor, what drivers call effort, held torques, repeats, slow logs, other integrators.

Two to four seconds at 250 Hz each, of the paper's first arm. No scene shares an equation with an
estimator: the motion is `algid.synth`'s, or a semi-implicit Euler step written out here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from algid.arm import Arm, FloatArray, forward_dynamics
from algid.log import Log, Origin, Reading
from algid.synth.cases import load_case
from algid.synth.excitation import SampledTorque, Torque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, SimulatedMotion, simulate, steered

RATE, DURATION = 250.0, 4.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
PERSISTENCE = 0.1  # s: how long a disturbance keeps its torque
WIDTH = 0.05  # rad/s, of the step of friction
ARM = load_case("case1").arm
PAYLOAD = load_case("case1").payload
Logs = tuple[list[Log], list[Log]]


def times(rate: float = RATE, duration: float = DURATION) -> FloatArray:
    """Sample times (N,) in s."""
    return np.arange(round(duration * rate) + 1) / rate


def log_of(
    motion: SimulatedMotion,
    tau: FloatArray,
    seed: int,
    *,
    passive: int | None = None,
    reference: FloatArray | None = None,
) -> Log:
    """A log of angles and torques (2, N) with white noise; a joint may turn as often as it will."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((2, *tau.shape))
    logged = tau + SIGMA_TAU * noise[1]
    if passive:
        logged[passive - 1] = 0.0
    origin = Origin(
        f"run {seed}", "csv", {}, reading=Reading(passive=passive, accepted=("DEGREES",))
    )
    stamps = np.round(motion.t * 1e9).astype(np.int64)
    theta = motion.theta + SIGMA_THETA * noise[0]
    return Log(stamps, theta, logged, origin, reference=reference)


def disturbance(t: FloatArray, size: FloatArray, seed: int) -> Torque:
    """An Ornstein-Uhlenbeck torque of `size` (2, 1) N m, by straight lines between samples."""
    rng = np.random.default_rng([seed, 1])
    keep = np.exp(-(t[1] - t[0]) / PERSISTENCE)
    value = np.empty((2, t.size))
    value[:, 0] = rng.standard_normal(2)
    for n in range(1, t.size):
        value[:, n] = keep * value[:, n - 1] + np.sqrt(1 - keep**2) * rng.standard_normal(2)
    return SampledTorque(t, size * value, "foh")


def open_loop(
    seed: int,
    own: Callable[..., FloatArray] | None = None,
    share: float = 0.0,
    payload: float = 0.0,
    factor: float = 1.0,
) -> Log:
    """The arm with a `payload` in kg under a wide torque times `factor`, which the log holds.

    What it does not hold: a disturbance of `share` of its RMS, or `own` (angles, velocities, drive,
    RMS) in N m.
    """
    t = times()
    wide = wide_multi_sine(ARM, seed)
    wide = replace(
        wide, amplitude=tuple(tuple(factor * a for a in joint) for joint in wide.amplitude)
    )
    k = ARM.constants(payload)
    size = np.sqrt(np.mean(wide(t) ** 2, axis=1, keepdims=True))
    push = disturbance(t, share * size, seed)

    def controller(instants: FloatArray) -> Driven:
        drive, pushed = wide(instants), push(instants)

        def torque(theta: FloatArray, omega: FloatArray) -> FloatArray:
            return drive + pushed + (own(theta, omega, drive, size) if own else 0.0)

        return torque

    return log_of(steered(k, controller, t, HANGING, corners=t), wide(t), seed)


def outweighed() -> Logs:
    """A payload of five times link 2, whose logs need many times the torque; a disturbance each."""
    unloaded = [open_loop(seed, share=0.05) for seed in (10, 11)]
    heavy = 5 * ARM.m2
    return unloaded, [open_loop(seed, share=0.05, payload=heavy, factor=6.0) for seed in (12, 13)]


def disturbed() -> Logs:
    """Open loop beside a torque that nobody logs."""
    return [open_loop(seed, share=0.3) for seed in range(3)], []


def geared() -> Logs:
    """Gears that rub by 1 % of the motor's torque, unlogged."""

    def rub(_q: FloatArray, w: FloatArray, u: FloatArray, _size: FloatArray) -> FloatArray:
        return np.asarray(-0.01 * np.abs(u) * np.tanh(w / WIDTH))

    return [open_loop(5, rub)], []


def controlled(*, reference: bool) -> Logs:
    """A PD controller follows three sines a joint, while a disturbance pushes."""
    t, k = times(), ARM.constants()
    inertia = np.array([k[4] + k[2] + 2 * k[0], k[2]])[:, None]
    size = 0.3 * np.array([[k[3] + k[1]], [k[1]]])
    logs = []
    for seed in range(3):
        rng = np.random.default_rng([seed, 7])
        frequency, phase = rng.uniform(0.3, 2.0, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
        push = disturbance(t, size, seed)

        def wanted(
            instants: FloatArray, frequency: FloatArray = frequency, phase: FloatArray = phase
        ) -> tuple[FloatArray, FloatArray]:
            angle = 2 * np.pi * frequency[..., None] * instants + phase[..., None]
            slope = 2 * np.pi * frequency[..., None] * 0.4 * np.cos(angle)
            return HANGING[:, None] + 0.4 * np.sin(angle).sum(axis=1), slope.sum(axis=1)

        def motors(
            instants: FloatArray,
            wanted: Callable[[FloatArray], tuple[FloatArray, FloatArray]] = wanted,
        ) -> Driven:
            angle, slope = wanted(instants)
            return lambda q, w: inertia * (64.0 * (angle - q) + 11.2 * (slope - w))

        def controller(
            instants: FloatArray,
            motors: Callable[[FloatArray], Driven] = motors,
            push: Torque = push,
        ) -> Driven:
            drive, pushed = motors(instants), push(instants)
            return lambda q, w: drive(q, w) + pushed

        motion = steered(k, controller, t, HANGING, corners=t)
        tau = motors(t)(motion.theta, motion.omega)
        logs.append(log_of(motion, tau, seed, reference=wanted(t)[0] if reference else None))
    return logs, []


def clipped(cause: str) -> Logs:
    """Torques cut off at 0.7 of their peak: in the log by its `sensor`, or in the `drive`."""
    t, wide = times(), wide_multi_sine(ARM, 3)
    limit = 0.7 * np.abs(wide(t)).max(axis=1)

    def within(instants: FloatArray) -> FloatArray:
        torque = wide(instants)
        bound = limit.reshape(2, *[1] * (torque.ndim - 1))
        return np.clip(torque, -bound, bound)

    motion = simulate(ARM.constants(), wide if cause == "sensor" else within, t)
    log = log_of(motion, wide(t), 3)
    if cause == "sensor":
        log = replace(log, tau=np.clip(log.tau, -limit[:, None], limit[:, None]))
    return [log], []


def passive(joint: int) -> Logs:
    """One joint has no motor but the friction of a bearing, and cables pull at both."""
    t, wide = times(), wide_multi_sine(ARM, 2)
    motors = np.array([[float(joint != 1)], [float(joint != 2)]])
    size = np.sqrt(np.mean((motors * wide(t)) ** 2))
    pull = disturbance(t, 0.02 * size * np.ones((2, 1)), 2)

    def controller(instants: FloatArray) -> Driven:
        acting = motors * wide(instants) + pull(instants)
        bearing = 0.01 * size * (1.0 - motors)
        return lambda _q, w: acting - bearing * np.tanh(w / WIDTH)

    motion = steered(ARM.constants(), controller, t, HANGING, corners=t)
    return [log_of(motion, motors * wide(t), 2, passive=joint)], []


def compensated(effort: str) -> Logs:
    """Logs without and with payload whose torque lacks the arm's weight, or all of the arm's."""
    t, k = times(), ARM.constants()
    k_loaded = k + np.append(ARM.payload_constants(PAYLOAD), [0.0, 0.0])[:7]
    logs = []
    for seed, constants in ((0, k), (1, k_loaded)):
        motion = simulate(constants, wide_multi_sine(ARM, seed), t)
        q = np.cumsum(motion.theta, axis=0)
        weight = np.stack([k[3] * np.cos(q[0]) + k[1] * np.cos(q[1]), k[1] * np.cos(q[1])])
        tau = motion.tau - weight
        if effort == "external":  # what the arm without payload needs for the same motion
            c, s = np.cos(motion.theta[1]), np.sin(motion.theta[1])
            a, w = np.gradient(motion.omega, t, axis=1), motion.omega
            inertia = (k[4] + k[2] + 2 * k[0] * c, k[2] + k[0] * c)
            moving = (
                inertia[0] * a[0] + inertia[1] * a[1] - k[0] * s * w[1] * (2 * w[0] + w[1]),
                inertia[1] * a[0] + k[2] * a[1] + k[0] * s * w[0] ** 2,
            )
            tau = tau - np.stack(moving) - k[5:, None] * w
        logs.append(log_of(motion, tau, seed))
    return logs[:1], logs[1:]


def held() -> Logs:
    """A random binary torque, each value held for 50 ms and from sample to sample."""
    t = times(1000.0, 3.0)
    size = np.sqrt(np.mean(wide_multi_sine(ARM, 4)(t) ** 2, axis=1, keepdims=True))
    sign = np.random.default_rng(4).choice([-1.0, 1.0], (2, 1 + t.size // 50))
    tau = SampledTorque(t, size * np.repeat(sign, 50, axis=1)[:, : t.size], "zoh")
    return [log_of(simulate(ARM.constants(), tau, t), tau(t), 4)], []


def bent() -> Logs:
    """Centres of mass 20° off the links' lines, and a body as payload, 20° off too."""
    t = times()
    arm = replace(ARM, delta1=np.radians(20.0), delta2=np.radians(20.0))
    place = arm.l2 * np.exp(1j * np.radians(20.0))
    k_loaded = arm.phasors(PAYLOAD, place.real, place.imag, PAYLOAD * 0.05**2)
    motions = (
        simulate(k, wide_multi_sine(ARM, seed), t)
        for seed, k in ((0, arm.phasors()), (1, k_loaded))
    )
    first, second = (log_of(motion, motion.tau, n) for n, motion in enumerate(motions))
    return [first], [second]


def repeated() -> Logs:
    """Six runs of one motion."""
    t = times(duration=2.0)
    motion = simulate(ARM.constants(), wide_multi_sine(ARM, 6), t)
    return [log_of(motion, motion.tau, seed) for seed in range(6)], []


def slow() -> Logs:
    """A fast arm at 50 Hz: it turns far from sample to sample."""
    t = times(50.0)
    motion = simulate(ARM.constants(), wide_multi_sine(ARM, 8), t)
    return [log_of(motion, motion.tau, 8)], []


def semi_implicit() -> Logs:
    """Noiseless, of another integrator: velocities step before angles, the torque held between."""
    arm: Arm = ARM
    t, k = times(1000.0, 2.0), arm.constants()
    tau = wide_multi_sine(arm, 9)(t)
    theta, state, speed = np.empty((2, t.size)), HANGING.copy(), np.zeros(2)
    for n in range(t.size):
        theta[:, n] = state
        rate = forward_dynamics(k, state[:, None], speed[:, None], tau[:, n, None])[:, 0]
        speed = speed + 1e-3 * rate
        state = state + 1e-3 * speed
    return [Log.from_arrays(t, theta, tau)], []


SCENES: Mapping[str, Callable[[], Logs]] = {
    "disturbed": disturbed,
    "disturbed, PD": lambda: controlled(reference=False),
    "disturbed, PD with reference": lambda: controlled(reference=True),
    "clipped by the sensor": lambda: clipped("sensor"),
    "clipped by the drive": lambda: clipped("drive"),
    "acrobot": lambda: passive(1),
    "pendubot": lambda: passive(2),
    "gravity-compensated": lambda: compensated("gravity"),
    "external torque": lambda: compensated("external"),
    "held random binary torque": held,
    "bent links, payload beside the line": bent,
    "gears that rub": geared,
    "payload that outweighs the arm": outweighed,
    "six repeats": repeated,
    "50 Hz": slow,
    "semi-implicit Euler": semi_implicit,
}
