"""Synthetic logs of a case: the arm without and with its payload, under one torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from algid.arm import FloatArray
from algid.base.progress import Progress
from algid.log import Log, Truth
from algid.synth.cases import Case
from algid.synth.excitation import Hold, SampledTorque, Torque, no_torque, wide_multi_sine
from algid.synth.follow import Reference, follow
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, SimulatedMotion, simulate

Reached = Callable[[float], None] | None
"""Called with each time in s that a simulation has come to."""

EXCITATIONS = ("case", "wide", "none")


@dataclass(frozen=True)
class Acquisition:
    """How long, how often and how a case is recorded, and the state it starts from."""

    rate: float = 1000.0
    duration: float = 1.0
    initial: tuple[float, float, float, float] = (float(HANGING[0]), float(HANGING[1]), 0.0, 0.0)
    sensors: Sensors = field(default_factory=Sensors)


def excitation(case: Case, name: str) -> Torque:
    """The torque of that name: the case's own, `wide` (0.3 to 8 Hz) or `none`.

    A case file without a torque is driven by the wide one.

    Raises
    ------
    ValueError
        If there is no excitation of that name.
    """
    if name == "none":
        return no_torque
    if name == "wide" or (name == "case" and case.torque is None):
        return wide_multi_sine(case.arm)
    if name == "case" and case.torque is not None:
        return case.torque
    raise ValueError(f"excitation must be one of {', '.join(EXCITATIONS)}, got {name}")


def held(torque: Torque, rate: float, duration: float, hold: Hold) -> SampledTorque:
    """The torque of a drive commanded at `rate` Hz: held, or ramped, between commands."""
    t = np.arange(round(rate * duration) + 1) / rate
    return SampledTorque(t, torque(t), hold)


def synthesise(
    case: Case, torque: Torque, recording: Acquisition, progress: Progress | None = None
) -> tuple[Log, Log]:
    """The unloaded and the loaded log of a case, each with noise of its own.

    `progress` hears how far each is.
    """
    initial = np.array(recording.initial)

    def move(payload: float, t: FloatArray, reached: Reached) -> SimulatedMotion:
        return simulate(case.constants(payload), torque, t, initial[:2], initial[2:], reached)

    unloaded, loaded = _recorded(case, (0.0, case.payload), move, recording, progress)
    return unloaded, loaded


def rehearse(
    case: Case, plan: Reference, recording: Acquisition, progress: Progress | None = None
) -> list[Log]:
    """Logs of a case whose controller follows a plan: unloaded and, with a payload, loaded."""
    unloaded = case.constants(0.0)

    def move(payload: float, t: FloatArray, reached: Reached) -> SimulatedMotion:
        return follow(case.constants(payload), plan, t, unloaded, bool(payload), reached)

    payloads = tuple(dict.fromkeys((0.0, case.payload)))
    return _recorded(case, payloads, move, recording, progress)


def _recorded(
    case: Case,
    payloads: Sequence[float],
    move: Callable[[float, FloatArray, Reached], SimulatedMotion],
    recording: Acquisition,
    progress: Progress | None,
) -> list[Log]:
    """A log of each payload, whose noise is of a seed of its own."""
    logs = []
    for place, payload in enumerate(payloads):
        role = "loaded" if payload else "unloaded"
        sensors = replace(recording.sensors, seed=recording.sensors.seed + place)
        t = sample_times(recording.rate, recording.duration, sensors)
        motion = move(payload, t, _counted(progress, role, recording))
        truth = Truth(case.arm, payload, case.name)
        logs.append(record(motion, sensors, truth, f"{case.name}-{role}"))
    return logs


def with_schedule(
    case: Case,
    torque: Torque,
    recording: Acquisition,
    schedule: Sequence[tuple[float, float]],
    progress: Progress | None = None,
) -> Log:
    """A log with changes of payload: pairs of time in s, increasing, and payload in kg from then.

    Before the first time the arm is unloaded. An object is grasped and let go at the tip's own
    velocity, so that the motion has no step. The truth in the log names the schedule.

    Raises
    ------
    ValueError
        If the times do not increase or a payload is negative.
    """
    table = np.array(schedule, dtype=np.float64).reshape(-1, 2)
    times, masses = table.T
    if not np.all(np.isfinite(table)) or np.any(np.diff(times) <= 0) or np.any(masses < 0):
        raise ValueError(
            f"schedule must hold increasing times and payloads of 0 or more, got {list(schedule)}"
        )
    t = sample_times(recording.rate, recording.duration, recording.sensors)
    state, parts = np.array(recording.initial), []
    edges = np.clip(np.concatenate([[0.0], times, [np.inf]]), 0.0, t[-1])
    for start, end, mass in zip(edges, edges[1:], np.append(0.0, masses), strict=False):
        if end <= start:
            continue
        every = np.unique(np.concatenate([[start], t[(t > start) & (t < end)], [end]]))
        counted = _counted(progress, "schedule", recording)
        k = case.constants(float(mass))
        motion = simulate(k, torque, every, state[:2], state[2:], counted)
        rows = np.concatenate([motion.theta, motion.omega, motion.tau])
        state = rows[:4, -1]
        # a sample at the change is the first one with the payload
        own = np.isin(every, t) & ((every < end) | (end == t[-1]))
        parts.append(rows[:, own])
    signals = np.concatenate(parts, axis=1)
    whole = SimulatedMotion(t, signals[:2], signals[2:4], signals[4:])
    changes = tuple((time, mass) for time, mass in table.tolist())
    truth = Truth(case.arm, 0.0, case.name, changes)
    return record(whole, recording.sensors, truth, f"{case.name}-schedule")


def _counted(progress: Progress | None, stage: str, recording: Acquisition) -> Reached:
    """Reports in samples the time to which the simulation has come."""
    if progress is None:
        return None
    total = round(recording.rate * recording.duration) + 1
    return lambda now: progress(stage, min(round(recording.rate * now) + 1, total), total)
