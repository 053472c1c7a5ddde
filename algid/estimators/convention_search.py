"""Find the convention of angles and torques under which a log obeys the equations of motion.

See `algid.estimators.conventions` for what each does to a log, and for the fits.

**What physics demands** (Table 1): M22 = k3 + j2 > 0, k5 > 0 and k3 k5 > k1² (M positive definite,
by the inequality of Cauchy and Schwarz on m2 l1² ≤ k5, m2 lc2² ≤ k3), friction that brakes, k1 k2
≥ 0; and k2, k4 ≥ 0: gravity pulls down. Friction is judged by its torque at the joint's RMS speed,
since a real one falls with speed at first (Stribeck).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product
from math import copysign, pi, remainder
from operator import itemgetter

import numpy as np

from algid.arm import FloatArray
from algid.base.names import evenly_spread, named_values, outside, vector
from algid.base.significance import SURE
from algid.estimators.conventions import (
    AS_READ,
    MODEL,
    WINDOW,
    Convention,
    ConventionSums,
    solved,
    summed,
    thinned,
)
from algid.estimators.problem import TooShortError
from algid.model import (
    F1,
    F2,
    J2,
    K1,
    K2,
    K3,
    K4,
    K5,
    K6,
    K7,
    LARGEST_PHASE,
    MOMENTS,
    SINE_OF,
    SINES,
    phasor_of,
)

# Hz and s: what is looked at, and what scales are sought in
_FINE, _COARSE = (
    (250.0, 40.0),
    (125.0, 12.0),
)
_EACH = 10.0  # s of each of several logs, at least
_SHORTEST = 6 * WINDOW  # of motion
_TURNS = tuple(product((0.0, 0.5 * pi, pi, -0.5 * pi), (0.0, pi)))  # of both zeros
_SHIFTED = 3  # conventions, of the best, whose zeros are set free
_REACH, _SETTLED = 0.2, 1e-5  # rad or of a scale, of the grid on which those are sought
_MOST_GRIDS = 100
_GRID = (0.0, -0.5, 0.5, -1.0, 1.0)  # its middle first
_SCALES = (0.0025, 400.0)  # from angles read in degrees that are in turns to large gears' motors
_WIDEST = 40.0  # rad: no scale is tried under which a joint would move further
_EXACT = [gear**way for gear in range(2, 401) for way in (1, -1)]
"""Scales of their own right: whole gears and their inverses."""
_NEAR = 0.01  # of a scale: how near one of those it is tried for them

_NEXT_TO_AXIS, _LONG = 0.02, 1.5
_OF_SIDE = ("k1 > 0", "k2 > 0", "k1 k2 > 0")
"""Demands that hold where link 2's centre of mass is off its axis: see `Candidate.balanced`."""
_INERTIAL = ("M22 > 0", "k5 > 0", "det M > 0", "k1 k2 > 0")

MOST_LOGS = 32
"""Logs that are looked at, evenly spread."""
BROKEN = -SURE
"""A demand of physics missed by more standard deviations than this is broken."""
MET = SURE
"""A convention is physical where the demands of inertia are met by as many."""
APART = 1.0
"""Two conventions are distinct where their summed log residuals differ by this much."""
EVIDENCE = 15.0
"""They also need this log-likelihood ratio: a chance of 1 in 3000 for a thousand conventions."""
LEAST = 1e-5
"""A residual share below this is no merit: one exact equation must not outweigh the other."""
EXPLAINED = 0.2
"""A convention that leaves more than this share of a torque explains nothing."""


def _score(left: FloatArray, least: float = 0.0) -> FloatArray:
    """Sums of logarithms (…) of what is left of both torques (…, 2), no share below the `least`."""
    return np.asarray(np.log(np.maximum(left, least)).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A convention and what the log says under it.

    Parameters
    ----------
    family : Convention, without its zeros
    zero : those, in rad
    constants : by name, what is found for those that the log may determine
    covariance : (q, q), of these
    left : (2,), share of each recorded torque's mean square that is not explained
    speed : (2,), RMS of the joints' in rad/s
    """

    family: Convention
    zero: tuple[float, float]
    constants: dict[str, float]
    covariance: FloatArray
    left: FloatArray
    speed: FloatArray

    @cached_property
    def score(self) -> float:
        """Sum of the logarithms of what is left: less is better."""
        return float(_score(self.left, LEAST))

    @property
    def convention(self) -> Convention:
        """The convention, zeros included."""
        return replace(self.family, zero=self.zero)

    @property
    def other_side(self) -> Convention:
        """The convention with θ2 half a turn off, which turns the signs of k1 and k2."""
        return replace(self.family, zero=(self.zero[0], (self.zero[1] + pi) % (2 * pi)))

    @cached_property
    def demands(self) -> dict[str, float]:
        """What physics demands, and how many standard deviations the log is on the right side."""
        k, demands = self.constants, dict[str, float]()
        k1, m22, k5 = k[K1], k[K3] + k[J2], k[K5]
        first, second = self.speed.tolist()
        slopes = {
            "M22 > 0": {K3: 1.0, J2: 1.0},
            "k5 > 0": {K5: 1.0},
            "det M > 0": {K1: -2 * k1, K3: k5 + k[J2], K5: m22, J2: k5 + k[K3]},
            "friction of joint 1 > 0": {K6: first, F1: 1.0},
            "friction of joint 2 > 0": {K7: second, F2: 1.0},
            "k1 > 0": {K1: 1.0},
            "k2 > 0": {K2: 1.0},
            "k4 > 0": {K4: 1.0},
        }
        for name, of_demand in slopes.items():
            if of_demand.keys() <= k.keys():
                slope = vector(k, of_demand, otherwise=0.0)
                spread = max(float(slope @ self.covariance @ slope), 1e-300) ** 0.5
                demands[name] = float(slope @ vector(k, k)) / spread
        demands["det M > 0"] /= 2  # of second degree, so that its slopes make twice its value
        if "k2 > 0" in demands:
            of_k1, of_k2 = demands.pop("k1 > 0"), demands["k2 > 0"]
            demands["k1 k2 > 0"] = copysign(min(abs(of_k1), abs(of_k2)), of_k1 * of_k2)
        if self.balanced:
            return {name: demands[name] for name in outside(demands, _OF_SIDE)}
        return demands

    @property
    def balanced(self) -> bool:
        """True if link 2's centre of mass is next to its axis: k1 and k2 have either sign then.

        lc2² ≥ k1 k2 / (k3 k4) k3 / m2, since m2 ≤ k4 / (g l1) with l1 = g k1 / k2 (Table 1), or
        without gravity m2 ≤ k5 / l1². Of a link much lighter than the first that bound says
        little: it has to be a long pendulum too, k3 / k1 in lengths l1.
        """
        k = self.constants
        along = abs(k[K1] * k.get(K2, k[K1]))
        own = k[K3] * k.get(K4, k[K5])
        return along < _NEXT_TO_AXIS * own and _LONG * abs(k[K1]) < k[K3]

    @property
    def broken(self) -> dict[str, float]:
        """The demands that the log breaks under this convention."""
        return {name: distance for name, distance in self.demands.items() if distance < BROKEN}

    @property
    def convincing(self) -> bool:
        """Whether this is a real arm: inertias determined, no bound broken, torque explained."""
        if self.broken or self.left.max() >= EXPLAINED:
            return False
        return all(self.demands.get(name, np.inf) > MET for name in _INERTIAL)

    @property
    def plausible(self) -> bool:
        """True if it explains the torque and breaks only demands of inertia.

        Slow motion and friction leave those open; weight and the sign of friction they do not.
        """
        return set(self.broken) <= set(_INERTIAL) and float(self.left.max()) < EXPLAINED


@dataclass(frozen=True)
class Judgement:
    """The log as it was read, the best convention, and whether it is `alone`.

    It is where the log shows a real arm under it, and no other convention that physics allows
    comes near. `trials` fit the same log under any other.
    """

    as_read: Candidate
    best: Candidate
    alone: bool
    trials: Trials


@dataclass(frozen=True, eq=False)
class Recorded:
    """Angles and torques (2, N) of a log as it was read, in rad and N m, `dt` s apart.

    The joint `passive` (1 or 2) has no motor. `absolute` and `base` are what a convention has where
    the reference of θ2 or the second motor's place is wrong: -1 where the log was read by them.
    `unit_scales` divide angles that are in another unit than the one they were read in.
    """

    theta: FloatArray
    tau: FloatArray
    dt: float
    passive: int | None = None
    absolute: int = 1
    base: int = 1
    unit_scales: Sequence[float] = ()

    @property
    def usable(self) -> bool:
        """True if its windows hold ten samples each, and its angles may be angles.

        One that spans more than any scale makes a joint's is none, as a spike of 1e6 rad is none.
        """
        spans = float(np.ptp(self.theta, axis=1).max(initial=0.0))
        return spans <= _SCALES[1] * _WIDEST and 10 * self.dt <= WINDOW


def judge_together(logs: Sequence[Recorded], *, gravity: bool = True) -> Judgement | None:
    """Try every convention on logs of one arm that were read alike, on the stretches that move.

    None where they do not move for six windows, were not read alike, or the torque of a motor is
    zero throughout. None other than as it was read stands where a bent arm explains as
    much: zeros turn three moments by two angles, centres of mass off the links' lines, or a
    payload, turn each by its own.
    """
    usable = evenly_spread([log for log in logs if log.usable], MOST_LOGS)
    ways = {(log.passive, log.absolute, log.base) for log in usable}
    # no motor's torque is asked for at a passive joint
    idle = {joint for joint in (1, 2) if not any(log.tau[joint - 1].any() for log in usable)}
    if len(ways) != 1 or idle - {usable[0].passive}:
        return None
    try:
        trials = Trials(usable, gravity)
    except TooShortError:
        return None
    if trials.seconds < _SHORTEST:
        return None
    candidates = trials.unscaled()
    judged = _judged(candidates, trials)
    if not judged.alone:
        for joints in ((1, 1), (1, 0), (0, 1)):
            candidates += trials.scaled(joints)
        judged = _judged(candidates, trials)
    best = judged.best
    if judged.alone and (best.family != AS_READ or max(map(abs, best.zero)) > LARGEST_PHASE):
        return replace(judged, alone=trials.bent() > best.score + trials.apart)
    return judged


def _judged(candidates: Sequence[Candidate], trials: Trials) -> Judgement:
    """The judgement on candidates of which the first is the log as it was read."""
    as_read = candidates[0]
    lawful = sorted((one for one in candidates if not one.broken), key=lambda one: one.score)
    if not lawful:
        return Judgement(as_read, as_read, False, trials)
    # of two sides that explain the same, but for rounding, the log's own
    sides = [lawful[0].convention]
    if lawful[0].balanced:
        sides.append(lawful[0].other_side)
    nearest = min((one.score for one in lawful if one.convention not in sides), default=np.inf)
    same = [one for one in lawful if one.convention in sides and one.score <= nearest]
    best = min(same, key=lambda one: abs(one.zero[1]))
    alone = best.convincing and nearest - best.score > trials.apart
    return Judgement(as_read, best, alone, trials)


def seconds_of_each(count: int, longest: float = _FINE[1]) -> float:
    """How much of each of `count` logs is looked at, in s, where of one alone it is `longest`."""
    return max(longest / count, _EACH)


def _least(scores: Callable[[FloatArray], FloatArray], start: FloatArray) -> FloatArray:
    """Where a function of points (Z, n) is least near `start` (n,).

    On a grid around the best point so far, which shrinks where none of its points is better. (A
    minimiser of scipy's does the same; to import it takes longer than the whole search.)
    """
    reach, best = _REACH, start
    grid = np.array(list(product(_GRID, repeat=start.size)))
    for _ in range(_MOST_GRIDS):
        points = best + reach * grid
        least = points[np.argmin(scores(points))]
        if np.all(np.abs(least - best) < 0.75 * reach):
            reach *= 0.5
        best = least
        if reach < _SETTLED:
            break
    return best


class Trials:
    """Logs, mapped and fitted under any convention."""

    def __init__(self, logs: Sequence[Recorded], gravity: bool) -> None:
        self._logs = logs
        self._fine, self._coarse = (
            tuple(
                thinned(log.theta, log.tau, log.dt, rate, seconds_of_each(len(logs), longest))
                for log in logs
            )
            for rate, longest in (_FINE, _COARSE)
        )
        self._model = MODEL if gravity else replace(MODEL, gravity=0.0)
        self._names = outside(self._model.names, SINES)
        self._turns = _TURNS if gravity else _TURNS[:2]
        self._summed = cache(partial(summed, model=self._model))
        self.seconds = self._sums(AS_READ).seconds
        """How long the logs move, in s."""
        self.apart = max(APART, 2 * EVIDENCE * WINDOW / max(self.seconds, _SHORTEST))
        """By how much the scores of two distinct conventions differ."""

    def under(self, family: Convention, *zeros: tuple[float, float]) -> list[Candidate]:
        """The candidates of a family with each of some zeros."""
        sums = self._sums(family)
        c, left, covariance = solved(sums, [family], self._places(np.array(zeros)))
        found = []
        for zero, k, V, share in zip(zeros, c.tolist(), covariance, left, strict=True):
            constants = dict(zip(self._names, k, strict=True))
            found.append(Candidate(family, zero, constants, V, share, sums.speed))
        return found

    def reweighed(self) -> Candidate:
        """The logs as they were read, without gravity where it was said to act, or with it."""
        return Trials(self._logs, gravity=K4 not in self._names).under(AS_READ, AS_READ.zero)[0]

    def zeroed(self, family: Convention) -> Candidate:
        """The candidate of a family with the zeros δ1 and δ2 that fit best.

        With them k1, k2 and k4 are positive if determined.
        """
        sums, ((c,), _) = self._sums(family), self._with_phases([family])
        of_k1, _, of_k4 = self._phases(c)

        def scores(zeros: FloatArray) -> FloatArray:
            return _score(solved(sums, [family], self._places(zeros))[1])

        first, second = _least(scores, np.array([of_k4, of_k1])).tolist()
        return self.under(family, (remainder(first, 2 * pi), remainder(second, 2 * pi)))[0]

    def unscaled(self) -> list[Candidate]:
        """The log as read, and every convention without a scale that may come near the best.

        No zeros leave less than a free phase for each moment does: the families of conventions are
        gone over from the least of that on, until no lawful convention of the rest can come near.
        """
        bounds: list[tuple[float, Convention]] = []
        for families in _families(self._logs[0]):
            _, left = self._with_phases(families)
            bounds += zip(_score(left, LEAST).tolist(), families, strict=True)
        found = self.under(AS_READ, AS_READ.zero)
        for place, (bound, family) in enumerate(sorted(bounds, key=itemgetter(0))):
            lawful = [one.score for one in found if not one.broken]
            if lawful and bound > min(lawful) + self.apart:
                break
            found += self._of_family(family, bound if place < _SHIFTED else np.inf)
        return found

    def scaled(self, joints: tuple[int, int]) -> list[Candidate]:
        """The scale of the angles of `joints`, each 1 or 0, of least residual, as else read.

        None where no scale leaves far less than none.
        """

        def score(scale: float, *, coarse: bool = False) -> float:
            _, left = self._with_phases([_scaled_by(scale, joints)], coarse=coarse)
            return float(_score(left)[0])

        def scores(points: FloatArray) -> FloatArray:
            return np.array([score(scale) for scale in np.exp(points[:, 0]).tolist()])

        travel = np.max([np.ptp(log.theta, axis=1) for log in self._coarse], axis=0)
        scale = min(_grid(float((travel * joints).max())), key=partial(score, coarse=True))
        if score(scale, coarse=True) > score(1.0, coarse=True) - self.apart:
            return []
        scale = float(np.exp(_least(scores, np.log([scale]))[0]))
        # a unit before a gear: what rubs leaves the scale open by a few per cent
        likely = [one for one in self._logs[0].unit_scales if 0.5 < one / scale < 2]
        nearest = min(_EXACT, key=lambda whole: abs(scale / whole - 1))
        if abs(scale / nearest - 1) < _NEAR:
            likely.append(nearest)
        least = score(scale) + self.apart
        scale = next((one for one in likely if score(one) < least), scale)
        return self._of_family(_scaled_by(scale, joints))

    def _of_family(self, family: Convention, bound: float = -np.inf) -> list[Candidate]:
        """A family with zeros by quarter and half turns, and those that fit best if by far.

        No zeros have a score below the `bound`.
        """
        turned = self.under(family, *self._turns)
        far = min(one.score for one in turned) - self.apart
        if bound < far and (best := self.zeroed(family)).score < far:
            turned.append(best)
        return turned

    def _with_phases(
        self, families: Sequence[Convention], *, coarse: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Coefficients (F, q) of families of the same angles, a free phase for each moment.

        With them the shares (F, 2) that are left.
        """
        every = np.eye(len(self._model.names))[None]
        c, left, _ = solved(self._sums(families[0], coarse=coarse), families, every)
        return c, left

    def _phases(self, c: FloatArray) -> FloatArray:
        """The phases in rad of the moments among coefficients (q,), 0 of one without a column."""
        k = named_values(self._model.names, c)
        return np.angle([phasor_of(k, moment) for moment in MOMENTS])

    def bent(self) -> float:
        """The score as the log was read with a phase for each moment; infinite if one is none."""
        (c,), left = self._with_phases([AS_READ])
        return np.inf if np.abs(self._phases(c)).max() > LARGEST_PHASE else float(_score(left)[0])

    def _places(self, zeros: FloatArray) -> FloatArray:
        """T (Z, q, p) of Z zeros δ1 and δ2 (Z, 2)."""
        places = self._model.compiled.place
        T = np.zeros((len(zeros), len(places), len(self._names)))
        turned = {K1: zeros[:, 1], K2: zeros.sum(axis=1), K4: zeros[:, 0]}
        for column, name in enumerate(self._names):
            angle = turned.get(name, np.zeros(1))
            T[:, places[name], column] = np.cos(angle)
            if name in turned:
                T[:, places[SINE_OF[name]], column] = np.sin(angle)
        return T

    def _sums(self, family: Convention, *, coarse: bool = False) -> ConventionSums:
        """Sums for a family's angles, one pass for all that share them."""
        angles = replace(family, torques_swapped=False, torque_signs=(1, 1), base=0)
        return self._summed(angles, self._coarse if coarse else self._fine)


def _families(read: Recorded) -> Iterator[list[Convention]]:
    """Every convention without scale and zeros, those of the same angles together.

    The torque of a `passive` joint has no sign, and changes places with none.
    """
    for swapped, sign, absolute in product((False, True), (1, -1), (0, read.absolute)):
        angles = Convention(swapped=swapped, signs=(1, sign), absolute=absolute)
        every = []
        for base, swap, one, two in product((0, read.base), (False, True), (1, -1), (1, -1)):
            own = replace(angles, torques_swapped=swap, torque_signs=(one, two), base=base)
            if not read.passive or (not (base or swap) and (one, two)[read.passive - 1] > 0):
                every.append(own)
        yield every


def _scaled_by(scale: float, joints: tuple[int, int]) -> Convention:
    """Divides the angles of the joints with a 1, and leaves those with a 0."""
    return Convention(scale=(scale ** joints[0], scale ** joints[1]))


def _grid(travel: float) -> list[float]:
    """Scales to try for angles of this `travel` (rad as read), at most half a radian apart."""
    scale = max(_SCALES[0], travel / _WIDEST)
    grid = []
    while scale < _SCALES[1]:
        grid.append(scale)
        scale *= 1 + min(0.15, 0.5 * scale / max(travel, 1e-9))
    return grid
