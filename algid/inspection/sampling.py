"""Checks of a log's sampling: length, rate, stamps, lost samples, and rest at both ends."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from algid.arm import FloatArray
from algid.base.quantiles import median, medians, quantile
from algid.inspection.figures import clock_figures, differences, noise_floor, signal_figures
from algid.log import Log
from algid.notices import Notice, Remedy
from algid.signals.spacing import NEAR, near_stamps

_LOST, _LOST_SHARE, _AGAINST = 0.3, 0.003, 5.0
"""Lost samples: distance to a double step, share of samples, and ratio to as near no step."""
_SHORTEST = 1.0
_FEWEST = 10.0
_REST, _STILL = 0.5, 1e-3
"""Least seconds at rest for a notice, and largest creep in that time, of an angle's range."""


def sampling(log: Log) -> Iterator[Notice]:
    """Logs too short or too slow for their motion; stamps that cluster, miss samples or jitter."""
    clock = clock_figures(log)
    period = 1e3 / clock.rate
    if clock.duration < _SHORTEST:
        yield Notice("SHORT_LOG", numbers={"case": "estimate", "seconds": clock.duration})
    samples = samples_a_period(log)
    if samples < _FEWEST:
        yield Notice(
            "SLOW_SAMPLING", numbers={"case": "period", "samples": samples, "rate": clock.rate}
        )
    near = near_stamps(log.stamp_ns, log.period)
    if near:
        yield Notice(
            "UNEVEN_STAMPS",
            numbers={"case": "near", "count": near, "share": NEAR, "period": period},
        )
    lost = lost_steps(log)
    if lost:
        override = Remedy({"accept": "LOST_SAMPLES"}, "to use it nevertheless")
        yield Notice("LOST_SAMPLES", numbers={"count": lost}, remedies=(override,))
    if clock.gaps:
        yield Notice(
            "GAPS", numbers={"case": "gaps", "count": clock.gaps, "seconds": clock.longest_gap}
        )
    if clock.jitter * clock.rate > 0.01:
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

    A velocity that is twice the mean of its neighbours' is a lost sample's, if the angles' plain
    step is twice theirs too: one alone is a stamp's jitter. Noise makes a step that is zero as
    often.
    """
    count = len(log) - 3

    def steps(first: int) -> FloatArray:
        return np.asarray(differences(log.theta[:, first : first + count + 1], 1))

    def seconds(first: int) -> FloatArray:
        return np.asarray(differences(log.stamp_ns[first : first + count + 1], 1) * 1e-9)

    shares, clear = [], np.True_
    for by in ([seconds(first) for first in range(3)], [1.0, 1.0, 1.0]):
        own, around = steps(1) / by[1], 0.5 * (steps(0) / by[0] + steps(2) / by[2])
        power = np.sum(around**2, axis=0)
        share = np.sum(own * around, axis=0) / np.maximum(power, 1e-300)
        off = np.sqrt(np.sum((own - share * around) ** 2, axis=0))
        clear = clear & (power > quantile(power, 0.25)) & (off < _LOST * np.sqrt(power))
        shares.append(share)
    each = count / max(1, power.size)  # of a long log some steps stand for all
    velocity, plain = shares
    double = (np.abs(velocity - 2) < _LOST) & (np.abs(plain - 2) < _LOST)
    none = (np.abs(velocity) < _LOST) & (np.abs(plain) < _LOST)
    lost = round(each * np.count_nonzero(clear & double))
    chance = round(each * np.count_nonzero(clear & none))
    if lost <= max(_LOST_SHARE * len(log), _FEWEST, _AGAINST * chance):
        return 0
    return lost


def rests(log: Log, whole: bool) -> Iterator[Notice]:
    """Rest before the motion and, where the log is `whole`, after it.

    A joint that stiction holds has a torque that the motion does not determine: gravity's
    constants take it. A posture that a motor holds freely informs more on gravity than any motion.
    The log does not say which it is: the rest is named, with the flags that leave it out, and
    stays.
    """
    room = np.empty(2)
    for joint, theta in enumerate(log.theta):
        one = signal_figures(theta)
        room[joint] = max(8 * one.noise, 2 * one.step, _STILL * (one.high - one.low))
    few = max(4, round(0.02 / log.period))
    before = _still(log.t, log.theta, room, few)
    if before == log.duration:
        return
    after = 0.0
    if whole:
        after = _still(log.duration - log.t[::-1], log.theta[:, ::-1], room, few)
    words, cut = [], {}
    if before >= _REST:
        words.append(f"for its first {before:.3g} s")
        cut["start"] = float(f"{before:.4g}")
    if after >= _REST:
        words.append(f"for its last {after:.3g} s")
        cut["end"] = float(f"{log.duration - after:.4g}")
    if words:
        yield Notice("RESTS", numbers={"rests": words}, remedies=(Remedy(cut),))


def _still(t: FloatArray, theta: FloatArray, room: FloatArray, few: int) -> float:
    """Seconds until an angle (2, N) at times t (N,) leaves its place, the median of `few` samples.

    `room` (2,) is how far noise and encoder let it be from there.
    """
    moved = t.size
    for angle, place, least in zip(theta, medians(theta[:, :few]), room, strict=True):
        away = np.abs(angle - place) > least
        moved = min(moved, int(np.argmax(away)) if away.any() else t.size)
    return float(t[moved - 1]) if moved else 0.0
