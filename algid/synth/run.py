"""Synthetic logs of a case: the arm without and with its payload, under one torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from algid.base.errors import SettingError
from algid.base.limits import PHYSICAL
from algid.base.progress import Progress
from algid.log import Log, Truth
from algid.options import flag
from algid.synth.cases import Case
from algid.synth.excitation import Hold, SampledTorque, Torque, no_torque, wide_multi_sine
from algid.synth.follow import Reference, follow
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, simulate

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
    runs: dict[str, list[tuple[float, float]]] = {"unloaded": [(0.0, 0.0)]}
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
        reached, mass = _counted(progress, role, recording), payloads[0][1]
        if isinstance(drive, Reference):
            k, tuned = case.constants(mass), case.constants(0.0)
            motion = follow(k, drive, t, tuned, bool(mass), reached)
        else:
            state, since = np.array(recording.initial), [time for time, _ in payloads[1:]]
            k = case.constants(mass)
            if changes:
                k = np.stack([case.constants(carried) for _, carried in payloads], axis=-1)
            motion = simulate(k, drive, t, state[:2], state[2:], reached, since)
        truth = Truth(case.arm, mass, case.name, changes)
        logs.append(record(motion, sensors, truth, f"{case.name}-{role}"))
    return logs


def _counted(
    progress: Progress | None, stage: str, recording: Acquisition
) -> Callable[[float], None] | None:
    """Reports in samples the time to which the simulation has come."""
    if progress is None:
        return None
    total = round(recording.rate * recording.duration) + 1
    return lambda now: progress(stage, min(round(recording.rate * now) + 1, total), total)
