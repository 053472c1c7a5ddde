"""Checks of channels: false or cut-off torques, angles that jump or are in degrees, lost samples.

Limits that cut torques off are found by motion, reported, and what lies beyond them is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import CUT
from algid.base.quantiles import median, medians, quantile
from algid.estimators.saturation import UNSEEN, Limit, Saturation, saturation_of
from algid.inspection.figures import (
    channels,
    clock_figures,
    differences,
    grid_step,
    noise_floor,
    saturated_share,
    thinned,
    windows,
)
from algid.log import Log, Origin
from algid.notices import Notice, Remedy, nevertheless
from algid.signals.segments import Segment, segments
from algid.signals.spacing import NEAR, near_stamps

LOOKED_AT = 1 << 18
"""Samples at the beginning of logs in which limits are looked for."""
_DENORMAL = 1e-6
_SPIKE = 30.0
_IN_A_ROW = 5
"""Most doubtful samples in a row: a spike's neighbours bend too."""
_STANDS, _CLEAR = 0.4, 6.0
"""Turning points: share of the speed three samples off, and that speed over the noise."""
_DEAD, _DEAD_RUNS = 0.1, 20
"""A torque that keeps one value for so many s and usual runs is not measured."""
_HELD_RUNS = 50
"""Changes of a torque that show its clock."""
_OFF_STEP, _IN_STEP = 0.15, 0.9
"""Largest distance of a held torque's runs from whole steps, and least share of such runs."""
_TURN = 2 * math.pi
_DEGREES, _AS_DEGREES = 180 / math.pi, 1.25
"""Of a rad, and how far off a ratio of angles to velocities may be from it, either way."""


def _found(code: str, origin: Origin, name: str, *remedies: Remedy, **numbers: Any) -> Notice:
    """A notice of the channel `name`, which is called as in algid and as in its log."""
    own = origin.mapping.get(name, name)
    channel = name if own == name else f"{name} ({own})"
    return Notice(code, numbers={"channel": channel} | numbers, remedies=remedies)


def _refused(code: str, origin: Origin, name: str, *remedies: Remedy, **numbers: Any) -> Notice:
    """The same, for which the log is refused; where that is accepted it warns."""
    if code in origin.reading.accepted:
        return _found(code, origin, name, accepted=True, **numbers)
    found = _found(code, origin, name, *remedies, nevertheless(code), **numbers)
    return replace(found, refuse=True)


def efforts(log: Log, known: Saturation = UNSEEN) -> Iterator[Notice]:
    """Torques that are zero, constant or at a limit.

    That of a joint without a motor may be anything. A limit that motion shows to be true is no
    reason to doubt; of one that cuts the torque off `clipped` warns.
    """
    passive = log.origin.reading.passive
    apart = {limit.joint + 1 for limit in known.limits} | {passive}
    for joint, tau in enumerate(log.tau, start=1):
        name, largest = f"tau{joint}", float(np.abs(tau).max())
        if joint in apart:
            continue
        if largest < _DENORMAL or tau.min() == tau.max():
            case = "constant" if largest >= _DENORMAL else "tiny" if largest else "zero"
            remedies = [Remedy({f"{name}.source": None}, "name the measured torque")]
            if log.tau[2 - joint].any() and not passive:
                remedies.append(Remedy({"passive": joint}, "for a joint without a motor"))
            numbers = {"case": case, "largest": largest, "value": float(tau[0])}
            yield _refused("EFFORT_ZERO", log.origin, name, *remedies, **numbers)
        elif (share := saturated_share(tau)) > 0.01:
            case = "true" if joint - 1 in known.sound else "open"
            yield _found("SATURATED_EFFORT", log.origin, name, percent=100 * share, case=case)


def held(log: Log, is_external: bool) -> Iterator[Notice]:
    """Channels that keep values for several samples, by the lengths of such runs.

    Torques that do so at a slower clock while the angle moves: those in coarse counts change
    whenever they pass a count, and their runs are of every length; a log whose angles are held as
    well was recorded slowly as a whole. Torques that keep one value far longer than elsewhere, not
    at a limit: an external one does where nothing pulls. Angles that keep one until they jump: one
    that rests goes on by a usual step.
    """
    for name, values in channels(log):
        sizes = np.abs(np.diff(values))
        changes = np.flatnonzero(sizes)
        runs = np.diff(changes)
        if not runs.size or runs.size == sizes.size - 1:  # no run is longer than a sample
            continue
        if name.startswith("tau"):
            case, usual = "torque", median(thinned(runs))
            off = np.abs(runs - usual * np.maximum(1.0, np.round(runs / usual)))
            clocked = changes.size >= _HELD_RUNS and usual >= 2
            moves = np.count_nonzero(np.diff(log.theta[int(name[-1]) - 1])) > 1.5 * changes.size
            if clocked and moves and np.mean(off <= _OFF_STEP * usual) >= _IN_STEP:
                lasts = 1e3 * usual * log.period  # ms
                late = 0.5 * (lasts - 1e3 * log.period)  # in the mean
                yield _found("HELD_EFFORT", log.origin, name, held=lasts, late=late)
            kept = values[changes[1:]]
            least = max(_DEAD / log.period, _DEAD_RUNS * quantile(thinned(runs), 0.95))
            long = (runs >= least) & (kept > values.min()) & (kept < values.max())
            long &= (changes.size >= _DEAD_RUNS) and not is_external
        else:
            case, usual = "angle", quantile(thinned(sizes[changes]), 0.99)
            long = (runs > max(10, round(0.02 / log.period))) & (sizes[changes[1:]] > 5 * usual)
        longest = int(np.argmax(runs * long))
        if long[longest]:
            start = (int(changes[longest]) + 1) * log.period
            lasts = int(runs[longest]) * log.period
            yield _found("SENSOR_FAULT", log.origin, name, case=case, seconds=lasts, start=start)


def angles(log: Log) -> Iterator[Notice]:
    """Angles that never change, or jump by a turn."""
    # over a gap that cuts the log, a joint may have turned round
    joined = np.diff(log.stamp_ns) <= CUT * log.period * 1e9
    for name, theta in channels(log, ("theta",)):
        sizes = np.abs(np.diff(theta))
        if not sizes.any():
            value = float(theta[0])
            yield _found("HARDLY_DRIVEN", log.origin, name, case="constant", value=value)
        wraps = int(np.count_nonzero((np.abs(sizes - _TURN) < 0.1 * _TURN) & joined))
        # at this rate the arm moves by far less than a turn between two samples
        if wraps and median(thinned(sizes)) < 0.5:
            unwrap = Remedy({f"{name}.unwrap": True})
            yield _refused("WRAPPED_ANGLE", log.origin, name, unwrap, count=wraps)


def degrees(log: Log, is_to_scale: Callable[[], bool]) -> Iterator[Notice]:
    """Angles or velocities in degrees, by each other or by how far the angles turn.

    A joint may turn as often as it will: `is_to_scale` says whether physics holds for the log as
    it was read, and no scale of its angles does better. A unit that the user has said is no reason
    to refuse.
    """
    ratios, found = np.zeros(2), list[tuple[str, dict[str, Any]]]()
    if log.omega is not None:
        path = np.cumsum(log.omega * np.gradient(log.t), axis=1)
        apart = max(1, len(log) // 200)
        travelled, summed = (
            np.abs(np.diff(one[:, ::apart])).sum(axis=1) for one in (log.theta, path)
        )
        ratios = np.divide(travelled, summed, out=ratios, where=summed > 0)
    for what, name, wrong in ("angles", "theta", _DEGREES), ("velocities", "omega", 1 / _DEGREES):
        for joint, off in enumerate((ratios / wrong).tolist(), start=1):
            if len(log) > 20 and 1 / _AS_DEGREES < off < _AS_DEGREES:
                found.append((f"{name}{joint}", {"case": "signal", "what": what, "joint": joint}))
    widest = np.abs(log.theta).max(axis=1)
    if widest.max() > 12 * math.pi and not ratios.any() and not is_to_scale():
        reach = {"case": "reach", "largest": float(widest.max())}
        found.append((f"theta{np.argmax(widest) + 1}", reach))
    for name, numbers in found:
        unit = "angle_unit" if name.startswith("theta") else f"{name}.unit"
        stated = log.origin.reading.stated_unit(name)
        if stated is not None:
            yield _found("DEGREES", log.origin, name, unit=stated, **numbers)
            continue
        remedies = (
            Remedy({unit: "deg"}, "where they are in degrees"),
            Remedy({f"{name}.gear_ratio": None}, "for those of a motor behind its gear"),
        )
        yield _refused("DEGREES", log.origin, name, *remedies, unit=None, **numbers)


def spikes(log: Log) -> Iterator[Notice]:
    """Single samples that fit neither what comes before them nor what follows.

    Doubtful are those that bend the most, and all that hold the commonest value of such, as where
    a driver writes 0 for torques that it has missed: those count if most of them are odd. A pulse
    of the torque where the joint turns back is dry friction's.
    """
    if len(log) < 20:
        return
    t = log.t / log.period
    for name, values in channels(log):
        bend = _bend(values)
        bent = values[1:-1][bend >= quantile(thinned(bend), 0.9)]
        every, counts = np.unique(bent, return_counts=True)
        common = values == every[counts.argmax()]
        rest = np.flatnonzero(~common)
        even, usual = thinned(rest[2:] - rest[:-2] == 2), thinned(_bend(values[rest]))
        limit = _SPIKE * quantile(usual[even] if even.any() else usual, 0.9)
        if not limit > 0:  # hardly a sample differs from its neighbours
            continue
        marks, places = (
            _odd(t, values, doubtful, limit) for doubtful in (common, np.pad(bend > limit, 1))
        )
        if 2 * marks.size > np.count_nonzero(common):
            places = np.union1d(places, marks)
        if places.size and name.startswith("tau"):
            theta = log.theta[int(name[-1]) - 1]
            beside = np.clip(places + [[-4], [-1], [2]], 0, theta.size - 3)
            before, here, behind = np.abs(theta[beside + 2] - theta[beside])
            slower = np.minimum(before, behind)
            turns_back = (here < _STANDS * slower) & (slower > _CLEAR * noise_floor(theta))
            places = places[~turns_back]
        if places.size:
            seen = {"count": places.size, "start": float(log.t[places[0]])}
            yield _found("SENSOR_FAULT", log.origin, name, case="spikes", **seen)


def _odd(
    t: FloatArray, values: FloatArray, doubtful: NDArray[np.bool_], limit: float
) -> NDArray[np.intp]:
    """Places of `doubtful` samples beyond `limit` off the line between the others on both sides.

    Without them these others fit one another: the sample after a step has none that do. Behind a
    gap in the times t, in periods, a signal has moved on.
    """
    here, rest = np.flatnonzero(doubtful), np.flatnonzero(~doubtful)
    behind = np.searchsorted(rest, here)
    inner = (behind > 1) & (behind < rest.size - 1)
    here, behind = here[inner], behind[inner]
    before, after = rest[behind - 1], rest[behind]
    off = np.abs(values[here] - 0.5 * (values[before] + values[after]))
    bend = _bend(values[rest])
    fits = np.maximum(bend[behind - 2], bend[behind - 1]) < 0.2 * off
    steps = after - before
    near = (steps <= _IN_A_ROW + 1) & (t[after] - t[before] < 2 * steps)
    return here[fits & near & (off > limit)]


def _bend(values: FloatArray) -> FloatArray:
    """How far each inner sample lies off the middle of its neighbours."""
    return np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))


def saturation(*logs: Log, gravity: float = 9.81, effort: str | None = None) -> Saturation:
    """The limits that cut off torques of an arm's logs, and the joints whose limits are sound.

    They are looked for in the beginning of the logs, at most `LOOKED_AT` samples in all.

    Parameters
    ----------
    logs : of one arm, with or without one payload, or their beginnings
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    effort : str, as in a profile
        An external torque is not what moves the arm, and shows no limit.
    """
    pieces: list[Segment] = []
    for log in logs if effort != "external" else ():
        if len(log) > 1 and "CLIPPED_TORQUE" not in log.origin.reading.accepted:
            pieces += segments([log.part(0, LOOKED_AT // len(logs))])
    return saturation_of(pieces, gravity)


def beyond(log: Log, limits: Iterable[Limit]) -> dict[Limit, int]:
    """How many samples of a log, or of a block of it, lie beyond each of its limits."""
    return {limit: int(np.count_nonzero(limit.beyond(log.tau))) for limit in limits}


def clipped(origin: Origin, counts: Mapping[Limit, int], rows: int) -> Iterator[Notice]:
    """Limits beyond which so many samples of `rows` lie."""
    keep = Remedy({"accept": "CLIPPED_TORQUE"}, "to use them nevertheless")
    for limit, count in counts.items():
        if count:
            level = max(abs(side) for side in (limit.low, limit.high) if np.isfinite(side))
            seen = {"level": level, "count": count, "percent": 100 * count / rows}
            yield _found("CLIPPED_TORQUE", origin, f"tau{limit.joint + 1}", keep, **seen)


_LOST, _LOST_SHARE, _AGAINST = 0.3, 0.003, 5.0
"""Lost samples: distance to a double step, share of samples, and ratio to as near no step."""
_SHORTEST = 1.0
_FEWEST = 10.0
_REST, _STILL = 0.5, 1e-3
"""Least seconds at rest for a notice, and largest creep in that time, of an angle's range."""


def sampling(log: Log) -> Iterator[Notice]:
    """Logs too short or too slow for their motion; stamps that cluster, miss samples or jitter."""
    clock, period = clock_figures(log), 1e3 * log.period  # ms
    if clock.duration < _SHORTEST:
        yield Notice("SHORT_LOG", numbers={"case": "estimate", "seconds": clock.duration})
    if (samples := samples_a_period(log)) < _FEWEST:
        slow = {"case": "period", "samples": samples, "rate": clock.rate}
        yield Notice("SLOW_SAMPLING", numbers=slow)
    if near := near_stamps(log.stamp_ns, log.period):
        clusters = {"case": "near", "count": near, "share": NEAR, "period": period}
        yield Notice("UNEVEN_STAMPS", numbers=clusters)
    if lost := lost_steps(log):
        override = (nevertheless("LOST_SAMPLES"),)
        yield Notice("LOST_SAMPLES", numbers={"count": lost}, remedies=override)
    if clock.gaps:
        gaps = {"case": "gaps", "count": clock.gaps, "seconds": clock.longest_gap}
        yield Notice("GAPS", numbers=gaps)
    if clock.jitter > 0.01 * log.period:
        error = np.sqrt(np.mean(np.diff(log.theta, 2, axis=1) ** 2, axis=1)) / 8
        small = all(error <= [noise_floor(theta) for theta in log.theta])
        seen = {"jitter": 1e3 * clock.jitter, "period": period, "error": float(error.max())}
        yield Notice("UNEVEN_STAMPS", numbers={"case": "jitter"} | seen, note=small)


def samples_a_period(log: Log) -> float:
    """Samples in a period of the faster joint's motion.

    Infinite where a step between samples is below 0.02 rad.

    Notes
    -----
    Of a sine with p samples a period, second differences are 2 sin(π/p) times first ones in size.
    Medians, so that spikes and rest do not count; steps that small may be noise.
    """
    fewest = math.inf
    for theta in log.theta:
        step = median(np.abs(differences(theta, 1)))
        bend = median(np.abs(differences(theta, 2)))
        if step > 0.02 and bend > 0:
            fewest = min(fewest, math.pi / math.asin(min(1.0, bend / (2 * step))))
    return fewest


def lost_steps(log: Log) -> int:
    """How many steps both joints make in the time of one.

    0 where noise or a slow motion leaves it open.

    A step that is twice the mean of its neighbours' is a lost sample's, where the stamps of all
    three are even: others are a stamp's jitter. Noise makes a step that is zero as often.
    """
    # three steps that follow one another; of a long log some stand for all
    before, own, after = np.diff(windows(log.theta, 4), axis=1).swapaxes(0, 1)
    periods = np.diff(windows(log.stamp_ns, 4), axis=0) * 1e-9 / log.period
    even = np.abs(periods - 1) < _LOST
    around = 0.5 * (before + after)
    size = np.linalg.norm(around, axis=0)
    clear = (size > quantile(size, 0.25)) & even.all(axis=0)
    each = (len(log) - 3) / size.size
    lost, chance = (
        round(each * np.count_nonzero(clear & (np.linalg.norm(off, axis=0) < _LOST * size)))
        for off in (own - 2 * around, own)
    )
    return lost if lost > max(_LOST_SHARE * len(log), _FEWEST, _AGAINST * chance) else 0


def rests(log: Log, whole: bool) -> Iterator[Notice]:
    """Rest before the motion and, where the log is `whole`, after it.

    A joint that stiction holds has a torque that the motion does not determine: gravity's
    constants take it. A posture that a motor holds freely informs more on gravity than any motion.
    The log does not say which it is: the rest is named, with the flags that leave it out, and
    stays.
    """
    few, flags = max(4, round(0.02 / log.period)), dict[str, float]()
    # how far noise and encoder let an angle be from its place
    room = [
        [max(8 * noise_floor(theta), 2 * grid_step(theta), _STILL * float(np.ptp(theta)))]
        for theta in log.theta
    ]
    for flag, step in (("start", 1), ("end", -1))[: 1 + whole]:
        theta, t = log.theta[:, ::step], log.t[::step]
        away = np.abs(theta - medians(theta[:, :few])[:, None]) > room
        left = np.flatnonzero(away.any(axis=0))
        if not left.size:  # it rests all the time
            return
        edge = float(t[max(left[0] - 1, 0)])
        if abs(edge - float(t[0])) >= _REST:
            flags[flag] = float(f"{edge:.4g}")
    if flags:
        yield Notice("RESTS", remedies=(Remedy(flags),))
