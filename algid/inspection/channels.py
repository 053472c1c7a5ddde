"""Checks of single channels: false torques, angles that jump, freeze or are in degrees, spikes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import CUT
from algid.base.quantiles import median, quantile
from algid.estimators.saturation import UNSEEN, Saturation
from algid.inspection.candidates import torques_beside
from algid.inspection.figures import differences, robust_deviation, saturated_share, thinned
from algid.log import Log
from algid.notices import Notice, Remedy

_DENORMAL = 1e-6
_SPIKE = 30.0
_TURN_BACK, _STANDS, _CLEAR = 3, 0.4, 6.0
"""Turning points: samples before and after, share of their speed, their speed over the noise."""
_DEAD, _DEAD_RUNS = 0.1, 20
"""A torque that keeps one value for so many s and usual runs is not measured."""
_HELD_RUNS, _HELD_SHARE = 50, 0.6
"""Changes of a torque that show its clock, and of how many of the samples at most they are."""
_OFF_STEP, _IN_STEP = 0.15, 0.9
"""Largest distance of a held torque's runs from whole steps, and least share of such runs."""
_TURN = 2 * math.pi


def efforts(log: Log, known: Saturation = UNSEEN) -> Iterator[Notice]:
    """Torques that are zero, constant or at a limit.

    That of a joint without a motor may be anything. A limit that motion shows to be true is no
    reason to doubt; of one that cuts the torque off `algid.inspection.clipping` warns.
    """
    cut_off = {limit.joint + 1 for limit in known.limits}
    for joint, tau in enumerate(log.tau, start=1):
        if joint == log.origin.reading.passive:
            continue
        name = f"tau{joint}"
        largest, what = float(np.abs(tau).max()), _source(log, name)
        if largest < _DENORMAL or tau.min() == tau.max():
            case = "constant" if largest >= _DENORMAL else "tiny" if largest else "zero"
            seen = {"case": case, "channel": what, "largest": largest, "value": float(tau[0])}
            remedies = torques_beside(log, name) if case == "zero" else []
            remedies = remedies or [Remedy({f"{name}.source": None}, "name the measured torque")]
            if case == "zero" and log.tau[2 - joint].any() and not log.origin.reading.passive:
                remedies.append(Remedy({"passive": joint}, "for a joint without a motor"))
            yield Notice("EFFORT_ZERO", numbers=seen, refuse=True, remedies=tuple(remedies))
        elif joint not in cut_off:
            share = saturated_share(tau)
            if share > 0.01:
                sound = joint - 1 in known.sound
                case = {True: "true", False: "open"}[sound]
                seen = {"channel": what, "percent": 100 * share, "case": case}
                yield Notice("SATURATED_EFFORT", numbers=seen, note=sound)


def dead_efforts(log: Log) -> Iterator[Notice]:
    """Torques whose longest run of one value is far longer than their runs elsewhere.

    A run at the largest or the smallest value is a limit's, and slow publishers repeat every value
    as often.
    """
    for name, tau in zip(("tau1", "tau2"), log.tau, strict=True):
        changed = tau[1:] != tau[:-1]
        count = np.count_nonzero(changed)
        if count < _DEAD_RUNS or count == changed.size:  # all runs are of one sample
            continue
        changes = np.flatnonzero(changed)
        runs = np.diff(changes)
        longest = int(np.argmax(runs))
        first, length = int(changes[longest]) + 1, int(runs[longest])
        usual = quantile(thinned(runs), 0.95)
        at_limit = tau[first] in (tau.max(), tau.min())
        if not at_limit and length * log.period >= _DEAD and length >= _DEAD_RUNS * usual:
            numbers = {
                "channel": _source(log, name),
                "seconds": length * log.period,
                "start": first * log.period,
            }
            yield Notice("SENSOR_FAULT", numbers={"case": "torque"} | numbers)


def held_efforts(log: Log) -> Iterator[Notice]:
    """Torques that hold values for several samples, at a slower clock, while the angle moves.

    A torque in coarse counts keeps its values too, but changes whenever it passes a count: its runs
    are of every length. A log whose angles are held as well was recorded slowly as a whole.
    """
    for joint, (theta, tau) in enumerate(zip(log.theta, log.tau, strict=True), start=1):
        changed = tau[1:] != tau[:-1]
        count = np.count_nonzero(changed)
        if not _HELD_RUNS <= count < changed.size * _HELD_SHARE:
            continue
        runs = np.diff(np.flatnonzero(changed))
        usual = median(thinned(runs))
        off = np.abs(runs - usual * np.maximum(1.0, np.round(runs / usual)))
        in_step = float(np.mean(off <= _OFF_STEP * usual))
        moves = np.count_nonzero(theta[1:] != theta[:-1]) > 1.5 * count
        if usual >= 2 and in_step >= _IN_STEP and moves:
            numbers = {
                "channel": _source(log, f"tau{joint}"),
                "held": 1e3 * usual * log.period,
                "late": 5e2 * (usual - 1) * log.period,
            }
            yield Notice("HELD_EFFORT", numbers=numbers)


def angles(log: Log) -> Iterator[Notice]:
    """Angles that never change, jump by a turn, or freeze until they jump."""
    for name, theta in zip(("theta1", "theta2"), log.theta, strict=True):
        steps, what = np.diff(theta), _source(log, name)
        sizes = np.abs(steps, out=steps)
        largest = sizes.max()
        if not largest:
            yield Notice(
                "HARDLY_DRIVEN",
                numbers={"case": "constant", "channel": what, "value": float(theta[0])},
            )
            continue
        wraps = 0
        if largest > 0.8 * _TURN:  # of most logs no step is, and none has to be looked at
            # over a gap that cuts the log, a joint may have turned round
            joined = np.diff(log.stamp_ns) <= CUT * log.period * 1e9
            wraps = int(np.count_nonzero((np.abs(sizes - _TURN) < 0.1 * _TURN) & joined))
        # at this rate the arm moves by far less than a turn between two samples
        if wraps and median(thinned(sizes)) < 0.5:
            yield Notice(
                "WRAPPED_ANGLE",
                numbers={"channel": what, "count": wraps},
                refuse=True,
                remedies=(Remedy({f"{name}.unwrap": True}),),
            )
        if np.count_nonzero(sizes) == sizes.size:  # it never stands still
            continue
        moving = np.flatnonzero(sizes)
        runs, usual = np.diff(moving), quantile(thinned(sizes[moving]), 0.99)
        long_enough = max(10, round(0.02 / log.period))
        frozen = np.flatnonzero((runs > long_enough) & (sizes[moving[1:]] > 5 * usual))
        if frozen.size:
            start = (int(moving[frozen[0]]) + 1) * log.period
            length = int(runs[frozen[0]]) * log.period
            numbers = {"channel": what, "seconds": length, "start": start}
            yield Notice("SENSOR_FAULT", numbers={"case": "angle"} | numbers)


def degrees(log: Log, is_to_scale: Callable[[], bool]) -> Iterator[Notice]:
    """Angles or velocities in degrees, by each other or by how far the angles turn.

    A joint may turn as often as it will: `is_to_scale` says whether physics holds for the log as
    it was read, and no scale of its angles does better.
    """
    ratios = (0.0, 0.0)
    if log.omega is not None:
        ratios = (_travelled_over_summed(log, 0), _travelled_over_summed(log, 1))
    pairs = (("angles", "theta", 180 / math.pi), ("velocities", "omega", math.pi / 180))
    for joint, ratio in enumerate(ratios, start=1):
        for what, quantity, factor in pairs:
            if len(log) > 20 and 0.8 < ratio / factor < 1.25:
                seen = {"case": "signal", "what": what, "joint": joint}
                yield _in_degrees(log, f"{quantity}{joint}", seen)
    widest = np.abs(log.theta).max(axis=1)
    row = int(np.argmax(widest))
    if widest[row] > 12 * math.pi and not any(ratios) and not is_to_scale():
        seen = {"case": "reach", "largest": float(widest[row])}
        yield _in_degrees(log, f"theta{row + 1}", seen)


def _travelled_over_summed(log: Log, row: int) -> float:
    """Angle travelled over velocity summed, robustly; 0 where there is no velocity or no motion."""
    assert log.omega is not None
    width = max(1, len(log) // 200)
    travelled = np.abs(np.diff(log.theta[row, ::width]))
    summed = np.add.reduceat(np.abs(log.omega[row]), np.arange(0, len(log), width))
    summed = summed[: travelled.size] / width * np.diff(log.t[::width])
    moving = travelled > 0.2 * travelled.max()
    total = float(np.sum(summed[moving]))
    if total <= 0:
        return 0.0
    return float(np.sum(travelled[moving])) / total


def _in_degrees(log: Log, name: str, seen: Mapping[str, Any]) -> Notice:
    """Refused, unless the user has said the unit of the channel `name`."""
    if log.origin.reading.told(name):
        unit = log.origin.reading.channels[name].unit
        return Notice("DEGREES", numbers=dict(seen) | {"unit": unit})
    in_degrees = "where they are in degrees"
    right = Remedy({f"{name}.unit": "rad"}, "where it is right")
    remedies: tuple[Remedy, ...] = (Remedy({f"{name}.unit": "deg"}, in_degrees), right)
    if name.startswith("theta"):
        gear = Remedy({f"{name}.gear_ratio": None}, "for the angle of a motor behind its gear")
        remedies = (Remedy({"angle_unit": "deg"}, in_degrees), gear, right)
    numbers = dict(seen) | {"unit": None}
    return Notice("DEGREES", numbers=numbers, refuse=True, remedies=remedies)


def spikes(log: Log) -> Iterator[Notice]:
    """Single samples that fit neither what comes before them nor what follows.

    They lie thirty times further off the middle of their neighbours than noise and bends of the
    signal do. The sample after a step fits what follows, and a pulse of the torque where the joint
    turns back is dry friction's.
    """
    if len(log) < 20:
        return
    names = ("theta1", "theta2", "tau1", "tau2")
    for name, values in zip(names, (*log.theta, *log.tau), strict=True):
        off = values[:-2] + values[2:]  # in place: a long log's arrays cost more than the sums
        off *= -0.5
        off += values[1:-1]
        deviation = robust_deviation(off)
        size = np.abs(off, out=off)
        limit = _SPIKE * max(deviation, quantile(thinned(size), 0.9))
        if limit == 0:
            continue
        places = np.flatnonzero(size > limit) + 1
        places = places[_alone(values, places, size[places - 1])]
        if name.startswith("tau"):
            places = places[~_turns_back(log.theta[int(name[-1]) - 1], places)]
        if places.size:
            first = float(log.t[places[0]])
            seen = {"channel": _source(log, name), "count": len(places), "start": first}
            yield Notice("SENSOR_FAULT", numbers={"case": "spikes"} | seen)


def _alone(values: FloatArray, places: NDArray[np.int64], size: FloatArray) -> NDArray[np.bool_]:
    """Whether values (N,) at `places` fit neither the line before nor after, though these agree."""
    before, after = values[places - 1], values[places + 1]
    from_before = 2 * before - values[np.maximum(places - 2, 0)]
    from_after = 2 * after - values[np.minimum(places + 2, values.size - 1)]
    here = values[places]
    misfit = np.minimum(np.abs(here - from_before), np.abs(here - from_after))
    return (np.abs(after - before) < 0.2 * size) & (misfit > 0.5 * size)


def _turns_back(theta: FloatArray, places: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a joint stands still at `places` for a sample, and moves before it and behind."""
    noise = robust_deviation(differences(theta, 3)) / math.sqrt(20)
    inside = np.clip(places, _TURN_BACK + 1, theta.size - _TURN_BACK - 2)

    def travel(places: NDArray[np.int64]) -> FloatArray:
        return np.abs(theta[places + 1] - theta[places - 1])

    slower = np.minimum(travel(inside - _TURN_BACK), travel(inside + _TURN_BACK))
    return (travel(inside) < _STANDS * slower) & (slower > _CLEAR * noise)


def _source(log: Log, name: str) -> str:
    """A channel and what it is called in the log."""
    source = log.origin.mapping.get(name, name)
    if source == name:
        return name
    return f"{name} ({source})"
