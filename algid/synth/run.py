"""Synthetic logs of a case: the arm without and with its payload, under one torque."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from algid.arm import with_payload
from algid.log import Log, Truth
from algid.synth.cases import Case
from algid.synth.excitation import Hold, SampledTorque, Torque, no_torque, wide_multi_sine
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, simulate

EXCITATIONS = ("case", "wide", "none")


@dataclass(frozen=True)
class Recording:
    """How long, how often and how a case is recorded, and the state it starts from."""

    rate: float = 1000.0
    duration: float = 1.0
    initial: tuple[float, float, float, float] = (*HANGING.tolist(), 0.0, 0.0)
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
    """The torque as a drive applies it that is commanded at `rate` Hz: held, or ramped, between commands."""
    t = np.arange(round(rate * duration) + 1) / rate
    return SampledTorque(t, torque(t), hold)


def synthesise(case: Case, torque: Torque, recording: Recording) -> tuple[Log, Log]:
    """The unloaded and the loaded log of a case; the loaded one has noise of its own."""
    unloaded = _one(case, torque, recording, payload=0.0)
    other = replace(recording.sensors, seed=recording.sensors.seed + 1)
    return unloaded, _one(case, torque, replace(recording, sensors=other), payload=case.payload)


def _one(case: Case, torque: Torque, recording: Recording, payload: float) -> Log:
    k = with_payload(case.arm.constants(), case.arm.payload_constants(payload))
    t = sample_times(recording.rate, recording.duration, recording.sensors)
    initial = np.array(recording.initial)
    motion = simulate(k, torque, t, initial[:2], initial[2:])
    truth = Truth(arm=case.arm, payload=payload, case=case.name)
    return record(motion, recording.sensors, truth, f"{case.name}-{'loaded' if payload else 'unloaded'}")
