"""Named checks of a log: what is wrong with it, and whether that forbids its use.

====================  =======  ==========================================================
code                  refused  seen
====================  =======  ==========================================================
EFFORT_ZERO           yes      a torque is zero throughout
EFFORT_DENORMAL       yes      a torque below 1e-6 N m throughout, as from unset memory
EFFORT_CONSTANT       yes      a torque that never changes
WRAPPED_ANGLE         yes      an angle jumps by 2π between two samples
DEGREES               yes      angles or velocities are 57.3 times what the others say
ANGLE_CONSTANT        no       an angle that never changes
STUCK_SENSOR          no       an angle freezes in motion and jumps when it comes back
SPIKES                no       single samples far off their neighbours
SATURATED_EFFORT      no       a torque clipped at its limit
DEAD_EFFORT           no       a torque that keeps one value where others change all the time
LOST_SAMPLES          no       steps twice as long as usual, though the stamps are even
RESTS                 no       the arm stands still before it moves, or after
GAPS                  no       samples are missing
JITTER                no       uneven stamps
SLOW_SAMPLING         no       fewer than ten samples in a period of the motion
SHORT_LOG             no       less than a second
NEAR_STAMPS           no       samples that stand all but on top of one another
GRAVITY_COMPENSATED   no       torques do not carry the arm's weight
WRONG_CONVENTION      no       physics contradicts signs, order, reference or zeros, and one other convention is right
ZERO_OFFSET           no       the zeros of the angles are a little off
FLIPPED_SIGN          no       gravity pulls upwards: a sign is wrong
WRONG_ZERO            no       gravity pulls sideways: θ1 is not from the horizontal
====================  =======  ==========================================================
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from algid.arm import FloatArray
from algid.errors import LogError
from algid.estimators.conventions import Judgement
from algid.inspection.conventions import Mend, is_right, judged, mend
from algid.inspection.dynamics import DynamicFigures, dynamic_figures
from algid.inspection.figures import clock_figures, robust_deviation, saturated_share, signal_figures
from algid.log import Log, Notice
from algid.signals.spacing import NEAR, near_stamps
from algid.words import counted

_DENORMAL = 1e-6
_SPIKE = 30.0
_DEAD, _DEAD_RUNS = 0.1, 20  # s, and in usual runs: a torque that keeps one value so long is not measured
_LOST, _LOST_SHARE, _AGAINST = 0.3, 0.003, 5.0
"""Of a step: how near it lies to the double; of the samples: how many do; and over those as near to none at all."""
_TURN = 2 * math.pi
_SHORTEST = 1.0
_FEWEST = 10.0
_REST, _STILL = 0.5, 1e-3
"""Seconds at rest that are worth a word; and of an angle's range, how far it may creep meanwhile."""
_LEAST_PULL = 1.3
"""Weight in N m to inertia in kg m^2: a fifth of g/l for links of 1.5 m."""


REFUSED = ("EFFORT_ZERO", "EFFORT_DENORMAL", "EFFORT_CONSTANT", "WRAPPED_ANGLE", "DEGREES")
"""The checks that refuse a log unless they are accepted."""


@dataclass(frozen=True)
class Finding:
    """One thing seen: its code, what it means, whether the log is refused for it, and the flags that mend it.

    `note` tells that it may be right as it is, and is no reason to doubt a result.
    """

    code: str
    text: str
    refuse: bool = False
    flags: tuple[str, ...] = ()
    note: bool = False


def examine(log: Log, *, gravity: float = 9.81, whole: bool = True) -> tuple[Finding, ...]:
    """Everything that the checks above find in a log.

    Parameters
    ----------
    log : Log
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    whole : bool
        False where `log` is the beginning of a longer one.
    """
    if len(log) < 4:
        return ()
    tried = cache(partial(judged, log, gravity=gravity > 0))
    every = (
        *_efforts(log),
        *_dead_efforts(log),
        *_angles(log),
        *_degrees(log, tried),
        *_spikes(log),
        *_clock(log),
        *_rests(log, whole),
    )
    found = [_yielding(finding, log.origin.reading.accepted) for finding in every]
    if any(finding.refuse for finding in found):
        return tuple(found)
    mended = mend(log, tried())
    if mended is not None:
        found.append(_convention(mended))
    elif gravity > 0:
        figures = dynamic_figures(log)
        found += _gravity(figures) if figures is not None else []
    return tuple(found)


def _convention(mended: Mend) -> Finding:
    told = f"use {' '.join(map(shlex.quote, mended.flags))} (profile: {mended.lines})"
    if not mended.another:
        return Finding("ZERO_OFFSET", f"{mended.words}; {told}", flags=mended.flags)
    text = f"{mended.words}, by all that physics says ({mended.contradiction}); {told}"
    return Finding("WRONG_CONVENTION", text, flags=mended.flags)


def noticed(log: Log, *, gravity: float = 9.81, whole: bool = True) -> tuple[Notice, ...]:
    """What `examine` finds, as notices.

    Raises
    ------
    LogError
        If a check forbids the use of a log that is all there.
    """
    findings = examine(log, gravity=gravity, whole=whole)
    refused = next((finding for finding in findings if finding.refuse), None)
    if refused is not None and whole:
        raise LogError(f"{log.origin.path}: {refused.code}: {refused.text}")
    place = "" if whole else f" (in its first {log.duration:.0f} s)"
    return tuple(Notice(one.code, f"{one.code}: {one.text}{place}", flags=one.flags, note=one.note) for one in findings)


def _yielding(finding: Finding, accepted: Collection[str]) -> Finding:
    """A refusal names what overrides it, and becomes a warning where that was said."""
    if not finding.refuse:
        return finding
    if finding.code in accepted:
        return replace(finding, refuse=False, text=f"{finding.text}; used nevertheless, as accept says")
    code = finding.code
    return replace(
        finding, text=f'{finding.text}; to use it nevertheless: --accept {code} (profile: accept = ["{code}"])'
    )


def _source(log: Log, name: str) -> str:
    source = log.origin.mapping.get(name, name)
    return name if source == name else f"{name} ({source})"


def _efforts(log: Log) -> Iterator[Finding]:
    for joint, tau in enumerate(log.tau, start=1):
        if joint == log.origin.reading.passive:
            continue
        name = f"tau{joint}"
        largest, what = float(np.abs(tau).max()), _source(log, name)
        if largest == 0:
            text = (
                f"{what} is zero in every sample; name the measured torque: {_other(name)}; for a joint without a "
                f"motor: --passive {joint} (profile: passive = {joint})"
            )
            yield Finding("EFFORT_ZERO", text, True)
        elif largest < _DENORMAL:
            text = f"{what} never exceeds {largest:.3g} N m: no torque; name the measured one: {_other(name)}"
            yield Finding("EFFORT_DENORMAL", text, True)
        elif tau.min() == tau.max():
            text = f"{what} is {tau[0]:.6g} N m in every sample; name the measured torque: {_other(name)}"
            yield Finding("EFFORT_CONSTANT", text, True)
        elif (share := saturated_share(tau)) > 0.01:
            text = f"{what} stands at its limit in {100 * share:.3g} % of the samples"
            yield Finding("SATURATED_EFFORT", text)


def _dead_efforts(log: Log) -> Iterator[Finding]:
    for name, tau in zip(("tau1", "tau2"), log.tau, strict=True):
        dead = _dead(tau, log.period)
        if dead:
            text = f"{_source(log, name)} stands still for {dead[1]:.3g} s from t = {dead[0]:.6g} s; leave that out"
            yield Finding("DEAD_EFFORT", text)


def _dead(tau: FloatArray, period: float) -> tuple[float, float] | None:
    """Start and length in s of the longest run of one value, where runs are far shorter elsewhere; or None.

    A run at the largest or the smallest value is a limit's, and slow publishers repeat every value as often.
    """
    changes = np.flatnonzero(np.diff(tau))
    if changes.size < _DEAD_RUNS:
        return None
    lengths = np.diff(changes)
    place = int(np.argmax(lengths))
    value, longest = tau[changes[place] + 1], int(lengths[place])
    usual = float(np.quantile(lengths, 0.95))
    at_limit = value in (tau.max(), tau.min())
    if at_limit or longest * period < _DEAD or longest < _DEAD_RUNS * usual:
        return None
    return float(changes[place] + 1) * period, longest * period


def _angles(log: Log) -> Iterator[Finding]:
    for name, theta in zip(("theta1", "theta2"), log.theta, strict=True):
        steps, what = np.diff(theta), _source(log, name)
        if not steps.any():
            yield Finding("ANGLE_CONSTANT", f"{what} is {theta[0]:.6g} rad in every sample")
            continue
        wraps = int(np.count_nonzero(np.abs(np.abs(steps) - _TURN) < 0.1 * _TURN))
        if wraps and _quiet(steps):
            text = (
                f"{what} jumps by a turn {counted(wraps, 'time')}: --set {name}.unwrap=true "
                f"(profile: unwrap = true of [{name}])"
            )
            yield Finding("WRAPPED_ANGLE", text, True)
        frozen = _frozen(steps, log.period)
        if frozen:
            text = f"{what} freezes for {frozen[1]:.3g} s from t = {frozen[0]:.6g} s, then jumps"
            yield Finding("STUCK_SENSOR", text)


def _other(name: str) -> str:
    """How to name another source of a channel."""
    return f'--set {name}.source=NAME (profile: source = "NAME" of [{name}])'


def _quiet(steps: FloatArray) -> bool:
    """Whether an arm at this rate moves by far less than a turn between two samples."""
    return float(np.median(np.abs(steps))) < 0.5


def _frozen(steps: FloatArray, period: float) -> tuple[float, float] | None:
    """Start and length in s of a run without change that a jump ends, or None."""
    moving = np.flatnonzero(steps)
    lengths = np.diff(moving)
    usual = float(np.quantile(np.abs(steps[moving]), 0.99))
    long_enough = max(10, round(0.02 / period))
    for place in np.flatnonzero(lengths > long_enough).tolist():
        if abs(steps[moving[place + 1]]) > 5 * usual:
            return float(moving[place] + 1) * period, float(lengths[place]) * period
    return None


def _degrees(log: Log, tried: Callable[[], Judgement | None]) -> Iterator[Finding]:
    pairs = (("angles", "theta", 180 / math.pi), ("velocities", "omega", math.pi / 180))
    if log.omega is not None and len(log) > 20:
        for joint in (0, 1):
            ratio = _ratio(log, joint)
            for what, quantity, factor in pairs:
                if 0.8 < ratio / factor < 1.25:
                    text = f"{what} of joint {joint + 1} are in degrees by the other signal"
                    yield _in_degrees(log, f"{quantity}{joint + 1}", text)
    widest = np.abs(log.theta).max(axis=1)
    joint = int(np.argmax(widest))
    unsaid = widest[joint] > 12 * math.pi and not any(_ratio(log, one) for one in (0, 1))
    if unsaid and not is_right(tried()):  # a joint may turn as often as it will
        yield _in_degrees(log, f"theta{joint + 1}", f"angles reach {widest[joint]:.4g}: few arms turn that far in rad")


def _in_degrees(log: Log, name: str, text: str) -> Finding:
    """Refused, unless the user has said the unit of the channel `name`."""
    if log.origin.reading.told(name):
        unit = log.origin.reading.channels[name].unit
        return Finding("DEGREES", f"{text}; they are taken for {unit} as told")
    flags = ("--angle-unit deg", "--angle-unit rad")
    if name.startswith("omega"):
        flags = (f"--set {name}.unit=deg", f"--set {name}.unit=rad")
    motor = "" if name.startswith("omega") else f", --set {name}.gear_ratio=N for the angle of a motor behind its gear"
    told = f"{flags[0]}{motor}, or {flags[1]} where it is right (profile: unit or gear_ratio of [{name}])"
    return Finding("DEGREES", f"{text}: {told}", True)


def _ratio(log: Log, joint: int) -> float:
    """Angle travelled over velocity summed, robustly; 0 where there is no velocity or no motion."""
    if log.omega is None:
        return 0.0
    width = max(1, len(log) // 200)
    t = log.t[::width]
    travelled = np.abs(np.diff(log.theta[joint, ::width]))
    summed = np.add.reduceat(np.abs(log.omega[joint]), np.arange(0, len(log), width))[: travelled.size]
    summed = summed / width * np.diff(t)
    moving = travelled > 0.2 * travelled.max()
    total = float(np.sum(summed[moving]))
    return float(np.sum(travelled[moving])) / total if total > 0 else 0.0


def _spikes(log: Log) -> Iterator[Finding]:
    for names, pair in ((("theta1", "theta2"), log.theta), (("tau1", "tau2"), log.tau)):
        for name, values in zip(names, pair, strict=True):
            if values.size < 20:
                continue
            off = values[1:-1] - (values[:-2] + values[2:]) / 2
            aside = np.abs(values[2:] - values[:-2])
            limit = _SPIKE * max(robust_deviation(off), float(np.quantile(np.abs(off), 0.9)))
            spikes = np.flatnonzero((np.abs(off) > limit) & (aside < 0.2 * np.abs(off)) & (limit > 0))
            if spikes.size:
                place = float(log.t[1:-1][spikes][0])
                text = f"{_source(log, name)} has {counted(len(spikes), 'spike')}, the first at t = {place:.6g} s"
                yield Finding("SPIKES", text)


def _clock(log: Log) -> Iterator[Finding]:
    clock = clock_figures(log)
    if clock.duration < _SHORTEST:
        text = f"the log lasts {clock.duration:.3g} s; an estimate needs a second of motion at least, ten are better"
        yield Finding("SHORT_LOG", text)
    samples = _samples_a_period(log)
    if samples < _FEWEST:
        text = (
            f"{samples:.2g} samples in a period of the motion at {clock.rate:.4g} Hz: too slow to tell its "
            "acceleration; record faster, or move more slowly"
        )
        yield Finding("SLOW_SAMPLING", text)
    near = near_stamps(log.stamp_ns, log.period)
    if near:
        text = (
            f"{counted(near, 'sample follows', 'samples follow')} the one before by less than {NEAR:g} "
            f"of a period of {1e3 / clock.rate:.4g} ms, as "
            "receipt times do: late ones go back to the period they are missing from, the mean stands for the others"
        )
        yield Finding("NEAR_STAMPS", text)
    lost = _lost(log)
    if lost:
        text = (
            f"{counted(lost, 'step of the angles is', 'steps of the angles are')} twice as long as usual, though "
            "the stamps are even: samples were lost and the others renumbered, so that no estimate can be right; take "
            "the stamps of the messages, or record without losses; to use it nevertheless: --accept LOST_SAMPLES "
            '(profile: accept = ["LOST_SAMPLES"])'
        )
        yield Finding("LOST_SAMPLES", text)
    if clock.gaps:
        text = f"{counted(clock.gaps, 'gap')}, the longest {clock.longest_gap:.4g} s; no window spans one"
        yield Finding("GAPS", text)
    if clock.jitter * clock.rate > 0.01:
        told = f"stamps jitter by {clock.jitter * 1e3:.3g} ms about a period of {1e3 / clock.rate:.4g} ms"
        bend = max(float(np.sqrt(np.mean(np.diff(row, 2) ** 2))) for row in log.theta) / 8
        yield Finding("JITTER", f"{told}; resampling moves angles by {bend:.2g} rad at most, linearly")


def _rests(log: Log, whole: bool) -> Iterator[Finding]:
    """A joint that stiction holds bears a torque of which the motion tells nothing: gravity's constants take it.

    A posture that a motor holds freely tells more of gravity than any motion. The log cannot tell which it is: the
    rest is named, with the flags that leave it out, and stays.
    """
    rooms = [_room(theta) for theta in log.theta]
    few = max(4, round(0.02 / log.period))
    before = _still(log.t, log.theta, rooms, few)
    after = _still(log.duration - log.t[::-1], log.theta[:, ::-1], rooms, few) if whole else 0.0
    if before == log.duration or max(before, after) < _REST:
        return
    parts = [(before, f"for its first {before:.3g} s", f"--start {before:.4g}", f"start = {before:.4g}")]
    end = log.duration - after
    parts += [(after, f"for its last {after:.3g} s", f"--end {end:.4g}", f"end = {end:.4g}")]
    _, words, flags, lines = zip(*(part for part in parts if part[0] >= _REST), strict=True)
    text = (
        f"the arm rests {' and '.join(words)}; where friction holds it there, the torque is not that of the weight: "
        f"leave the rest out with {' '.join(flags)} (profile: {', '.join(lines)})"
    )
    yield Finding("RESTS", text, flags=flags, note=True)


def _room(theta: FloatArray) -> float:
    """How far noise and encoder let an angle (N,) be from its place."""
    figures = signal_figures(theta)
    return max(8 * figures.noise, 2 * figures.step, _STILL * (figures.high - figures.low))


def _still(t: FloatArray, theta: FloatArray, rooms: Sequence[float], few: int) -> float:
    """Seconds until one of the angles (2, N) at times t (N,) has left its place, the median of the first `few`."""
    places = np.median(theta[:, :few], axis=1, keepdims=True)
    away = np.flatnonzero(np.any(np.abs(theta - places) > np.array(rooms)[:, None], axis=0))
    moved = int(away[0]) if away.size else t.size
    return float(t[moved - 1]) if moved else 0.0


def _lost(log: Log) -> int:
    """How many steps both joints make in the time of one; 0 where noise or a slow motion does not tell.

    A velocity that is twice the mean of its neighbours' is a lost sample's. Noise makes one that is nought as often.
    """
    velocity = np.diff(log.theta) / (np.diff(log.stamp_ns) * 1e-9)
    around = 0.5 * (velocity[:, 2:] + velocity[:, :-2])
    own = velocity[:, 1:-1]
    power = np.sum(around**2, axis=0)
    share = np.sum(own * around, axis=0) / np.maximum(power, 1e-300)
    off = np.sqrt(np.sum((own - share * around) ** 2, axis=0))
    told = (power > np.quantile(power, 0.25)) & (off < _LOST * np.sqrt(power))
    lost = int(np.count_nonzero(told & (np.abs(share - 2) < _LOST)))
    chance = int(np.count_nonzero(told & (np.abs(share) < _LOST)))
    return lost if lost > max(_LOST_SHARE * len(log), _FEWEST, _AGAINST * chance) else 0


def _samples_a_period(log: Log) -> float:
    """Samples in a period of the faster joint's motion; infinite where a step between samples is below 0.02 rad.

    Of a sine with p samples a period, second differences are 2 sin(π/p) times first ones in size. Medians, so that
    spikes and rest do not count; steps that small may be noise.
    """
    fewest = math.inf
    for theta in log.theta:
        first, second = np.diff(theta), np.diff(theta, 2)
        step = float(np.median(np.abs(first)))
        if step > 0.02:
            bend = min(1.0, float(np.median(np.abs(second))) / (2 * step))
            fewest = min(fewest, math.pi / math.asin(bend)) if bend > 0 else fewest
    return fewest


def _gravity(figures: DynamicFigures) -> Iterator[Finding]:
    if figures.condition > 1e6 or figures.explained < 0.3:
        return
    weightless = math.hypot(figures.weight1, figures.weight2) < _LEAST_PULL * abs(figures.inertia)
    if figures.seen > 0.15 and figures.gravity_share < 0.01 and weightless:
        text = (
            f"torques carry no weight (gravity explains {100 * figures.gravity_share:.2g} % of them): "
            "they are gravity-compensated, or the arm moves in a horizontal plane (--gravity 0; profile: gravity = 0)"
        )
        yield Finding("GRAVITY_COMPENSATED", text)
    elif figures.seen < 0.015 or figures.gravity_share < 0.02:
        return  # the motion does not tell where gravity pulls
    elif abs(figures.turn) > 135:
        text = (
            f"gravity pulls upwards (k4 = {figures.weight1:.3g} N m): the sign of torques or angles is wrong; turn the "
            "torques round: --set tau1.sign=-1 --set tau2.sign=-1 (profile: sign = -1 of [tau1] and [tau2]), or angles "
            "and velocities likewise"
        )
        yield Finding("FLIPPED_SIGN", text)
    elif abs(figures.turn) > 45:
        text = (
            f"gravity is turned by {figures.turn:.0f}°: θ1 is not from the horizontal: --zero hanging "
            '(profile: zero = "hanging"), or --set theta1.offset=RAD'
        )
        yield Finding("WRONG_ZERO", text)
