"""Checks of a log's sampling: length, rate, stamps, lost samples, and rest at both ends."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from algid.base.quantiles import median, medians, quantile
from algid.inspection.figures import clock_figures, differences, grid_step, noise_floor, windows
from algid.log import Log
from algid.notices import Notice, Remedy, nevertheless
from algid.signals.spacing import NEAR, near_stamps

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
    few, rests, flags = max(4, round(0.02 / log.period)), [], {}
    # how far noise and encoder let an angle be from its place
    room = [
        [max(8 * noise_floor(theta), 2 * grid_step(theta), _STILL * float(np.ptp(theta)))]
        for theta in log.theta
    ]
    for flag, step, word in (("start", 1, "first"), ("end", -1, "last"))[: 1 + whole]:
        theta, t = log.theta[:, ::step], log.t[::step]
        away = np.abs(theta - medians(theta[:, :few])[:, None]) > room
        left = np.flatnonzero(away.any(axis=0))
        if not left.size:  # it rests all the time
            return
        edge = float(t[max(left[0] - 1, 0)])
        lasts = abs(edge - float(t[0]))
        if lasts >= _REST:
            rests.append(f"for its {word} {lasts:.3g} s")
            flags[flag] = float(f"{edge:.4g}")
    if rests:
        yield Notice("RESTS", numbers={"rests": rests}, remedies=(Remedy(flags),))
