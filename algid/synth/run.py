"""Synthetic logs of a case: the arm without and with its payload, under one torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.limits import PHYSICAL
from algid.base.progress import Progress
from algid.log import Log, Truth
from algid.options import flag
from algid.synth.cases import Case
from algid.synth.excitation import Hold, SampledTorque, Torque, no_torque, wide_multi_sine
from algid.synth.follow import Reference, follow
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, SimulatedMotion, simulate

EXCITATIONS = ("case", "wide", "none")


@dataclass(frozen=True)
class Acquisition:
    """How long, how often and how a case is recorded, and the state it starts from."""

    rate: float = 1000.0
    duration: float = 1.0
    initial: tuple[float, float, float, float] = (float(HANGING[0]), float(HANGING[1]), 0.0, 0.0)
    sensors: Sensors = field(default_factory=Sensors)

    def __post_init__(self) -> None:
        samples, (least, most) = round(self.rate * self.duration) + 1, PHYSICAL.samples
        if not least <= samples <= most:
            raise SettingError(
                f"{flag('duration')}: {self.duration:g} s at {flag('rate')} {self.rate:g} Hz are "
                f"{samples:.3g} samples; expected {least:g} to {most:g}"
            )


def excitation(case: Case, name: str) -> Torque:
    """The torque among `EXCITATIONS`: the case's own, `wide` (0.3 to 8 Hz) or `none`.

    A case file without a torque is driven by the wide one.
    """
    wide = wide_multi_sine(case.arm)
    torques: dict[str, Torque] = {"case": case.torque or wide, "wide": wide, "none": no_torque}
    return torques[name]


def held(torque: Torque, rate: float, duration: float, hold: Hold) -> SampledTorque:
    """The torque of a drive commanded at `rate` Hz: held, or ramped, between commands."""
    t = np.arange(round(rate * duration) + 1) / rate
    return SampledTorque(t, torque(t), hold)


def synthesise(
    case: Case,
    drive: Torque | Reference,
    recording: Acquisition,
    progress: Progress | None = None,
    schedule: Sequence[tuple[float, float]] | None = None,
) -> list[Log]:
    """Logs of a case: unloaded and, with a payload, loaded; or one whose payload changes.

    Parameters
    ----------
    case : Case
    drive : torque, or the plan that a controller follows
    recording : Acquisition
        The noise of each log is of a seed of its own.
    progress : callable
        Hears in samples how far each log is.
    schedule : pairs of time in s, increasing, and payload in kg from then, or None
        Before the first time the arm is unloaded. An object is grasped and let go at the tip's own
        velocity, so that the motion has no step. The truth in the log names the schedule.

    Raises
    ------
    SettingError
        If the times do not increase.
    """
    runs: dict[str, Sequence[tuple[float, float]]] = {"unloaded": [(0.0, 0.0)]}
    if case.payload:
        runs["loaded"] = [(0.0, case.payload)]
    changes: tuple[tuple[float, float], ...] = ()
    if schedule is not None:
        changes = tuple((float(time), float(mass)) for time, mass in schedule)
        times = [time for time, _ in changes]
        if not times or times != sorted(set(times)):
            raise SettingError(
                f"{flag('payload_schedule')}: expected increasing times like 2=0.05,4=0, found "
                f"{list(schedule)}"
            )
        runs = {"schedule": [(0.0, 0.0), *changes]}
    logs = []
    for place, (role, payloads) in enumerate(runs.items()):
        sensors = replace(recording.sensors, seed=recording.sensors.seed + place)
        t = sample_times(recording.rate, recording.duration, sensors)
        motion = _moved(case, drive, recording, t, payloads, _counted(progress, role, recording))
        mass = 0.0 if changes else payloads[0][1]
        truth = Truth(case.arm, mass, case.name, changes)
        logs.append(record(motion, sensors, truth, f"{case.name}-{role}"))
    return logs


def _moved(
    case: Case,
    drive: Torque | Reference,
    recording: Acquisition,
    t: FloatArray,
    payloads: Sequence[tuple[float, float]],
    reached: Callable[[float], None] | None,
) -> SimulatedMotion:
    """The arm's motion at `t` (N,), part by part with each payload from its time on."""
    state, parts = np.array(recording.initial), []
    edges = np.clip([*(time for time, _ in payloads), np.inf], 0.0, t[-1])
    for (_, mass), start, end in zip(payloads, edges, edges[1:], strict=False):
        if end <= start:
            continue
        every = np.unique(np.concatenate([[start], t[(t > start) & (t < end)], [end]]))
        k = case.constants(mass)
        if isinstance(drive, Reference):
            motion = follow(k, drive, every, case.constants(0.0), bool(mass), reached)
        else:
            motion = simulate(k, drive, every, state[:2], state[2:], reached)
        rows = np.concatenate([motion.theta, motion.omega, motion.tau])
        state = rows[:4, -1]
        # a sample at the change is the first one with the payload
        own = np.isin(every, t) & ((every < end) | (end == t[-1]))
        parts.append(rows[:, own])
    signals = np.concatenate(parts, axis=1)
    return SimulatedMotion(t, signals[:2], signals[2:4], signals[4:])


def _counted(
    progress: Progress | None, stage: str, recording: Acquisition
) -> Callable[[float], None] | None:
    """Reports in samples the time to which the simulation has come."""
    if progress is None:
        return None
    total = round(recording.rate * recording.duration) + 1
    return lambda now: progress(stage, min(round(recording.rate * now) + 1, total), total)
