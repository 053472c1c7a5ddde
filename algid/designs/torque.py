"""Open loop: a multi-sine torque moves the arm from rest; limits hold for arms of the belief.

τ_i(t) = w(t) τ̂_i Σ_l (a_il sin ω_l t + b_il cos ω_l t), with the window w of
`algid.designs.position` and amplitudes in shares of τ̂: the torque's limit or, where a drive is far
stronger than its arm, what the believed arms need outstretched at the highest speed and
acceleration that the limits leave to the fastest harmonic. Where the arm goes depends on the arm:
each candidate is simulated for the believed arm and for arms drawn from the belief, without and
with the payload, all in one batch. An evolution strategy (recombination of the better half, step
sizes by the spread of it) needs no derivatives of that. A joint whose limit is zero has no drive
and is swung along.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.designs.belief import Asked, Belief
from algid.designs.information import Experiment, Slopes, informations
from algid.designs.limits import Limits, Row, Usage, usage
from algid.designs.position import Fourier
from algid.designs.swing import FAST, Swings, step_for, swing
from algid.errors import SettingError
from algid.model import Motion, regressor
from algid.options import flag
from algid.progress import Progress

POPULATION = 24
GENERATIONS = 30
SEARCHED_ARMS = 2  # drawn beside the believed one while searching
CHECKED_ARMS = 24  # drawn for the last check of the limits
END = 0.1  # of the largest velocity, that may be left of it at the end
_BROKEN = 1.001  # of a limit: beyond it by more than rounding
_PENALTY = 20.0  # on each share of a limit beyond it
_LOST = 0.5  # beyond the limits by so much, the motion does not matter
_INFORMATION_RATE = 100.0  # Hz, about


@dataclass(frozen=True, eq=False)
class Swung:
    """A pattern x (n,) within limits: motions of the believed arm by kind at t, constraint use."""

    x: FloatArray
    t: FloatArray
    motions: dict[bool, Motion]
    usage: Usage


class TorqueProblem:
    """Open-loop torques within limits, for arms of a belief.

    Parameters
    ----------
    experiment, belief, limits, asked : as for `algid.designs.position.PositionProblem`
    duration : float, s
    start : (2,), rad
        Where the arm hangs at rest.
    seed : int
        Of the arms drawn.

    Raises
    ------
    SettingError
        If a torque has no limit: an open loop needs one.
    """

    def __init__(
        self,
        experiment: Experiment,
        belief: Belief,
        limits: Limits,
        asked: Asked,
        duration: float,
        start: FloatArray,
        seed: int,
    ) -> None:
        if not np.all(np.isfinite(limits.torque)):
            raise SettingError(
                f"{flag('torque')}: an open loop needs a limit at each joint, found inf; give one"
            )
        if np.any(start <= limits.low) or np.any(start >= limits.high):
            raise SettingError(
                f"{flag('range')}: an open loop starts hanging at rest, which the range leaves "
                "out; widen it"
            )
        self._experiment, self._belief = experiment, belief
        self._limits, self._asked = limits, asked
        self._start = start
        self._family = Fourier(duration)
        self._driven = np.flatnonzero(limits.torque > 0)
        self.size = 2 * self._family.harmonics.size * self._driven.size
        self._arms = np.vstack([belief.mean, belief.draws(SEARCHED_ARMS, seed)])
        self._checked = np.vstack([belief.mean, belief.draws(CHECKED_ARMS, seed + 1)])
        every = self._coefficients(self._checked, list(experiment.kinds))
        self._step = step_for(experiment.shared.model, every, duration)
        self._strength = np.minimum(limits.torque, self._need())

    def _need(self) -> FloatArray:
        """What arms of the belief ask for at most (2,), about, in motions within the limits."""
        limits, highest = self._limits, self._family.harmonics[-1]
        speed = np.minimum(np.minimum(limits.speed, limits.half * highest), FAST)
        acceleration = np.minimum(limits.acceleration, speed * highest)
        fastest = Motion(np.zeros((2, 1)), speed[:, None], acceleration[:, None])
        Y = regressor(self._experiment.shared.model, fastest)[..., 0]
        c = self._coefficients(self._arms, list(self._experiment.kinds))
        return np.max(np.abs(Y) @ np.abs(c), axis=1)

    def _coefficients(self, arms: FloatArray, kinds: list[bool]) -> FloatArray:
        """C (q, arms × kinds), the kinds of an arm side by side."""
        shared = self._experiment.shared
        columns = []
        for arm in arms:
            for loaded in kinds:
                columns.append(shared.coefficients(arm, loaded))
        return np.array(columns).T

    def torques(self, x: FloatArray, t: FloatArray) -> FloatArray:
        """Torques (2, N) of a pattern at the times `t` (N,) in s."""
        phase = np.multiply.outer(self._family.harmonics, t)
        waves = np.concatenate([np.sin(phase), np.cos(phase)]) * self._family.window(t)[0]
        torque = np.zeros((2, t.size))
        torque[self._driven] = x.reshape(self._driven.size, -1) @ waves
        return torque * self._strength[:, None]

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random pattern: slow harmonics as strong as fast ones, peaks near τ̂ at most."""
        x = rng.standard_normal(self.size)
        return x / np.sqrt(self._family.harmonics.size) * rng.uniform(0.05, 0.4)

    def _swings(
        self,
        patterns: FloatArray,
        arms: FloatArray,
        lost: Callable[[FloatArray], bool] | None = None,
    ) -> Swings:
        """Every pattern (P, n) on every arm and kind, in that order of columns."""
        count = 2 * round(self._family.duration / self._step) + 1
        t = 0.5 * self._step * np.arange(count)
        each = np.array([self.torques(x, t).T for x in patterns]).transpose(1, 2, 0)
        C = self._coefficients(arms, list(self._experiment.kinds))
        return swing(
            self._experiment.shared.model,
            np.tile(C, (1, len(patterns))),
            np.repeat(each, C.shape[1], axis=2),
            self._step,
            self._start,
            lost,
        )

    def figures(self, patterns: FloatArray) -> FloatArray:
        """Objective (P,): logarithm of the largest relative bound, and a penalty on limits."""
        kinds = list(self._experiment.kinds)
        swings = self._swings(patterns, self._arms)
        width = len(self._arms) * len(kinds)
        rows = []
        for place, x in enumerate(patterns):
            columns = range(place * width, (place + 1) * width)
            motions = list(map(swings.motion, columns))
            beyond = max(0.0, _most(self._used(x, swings.t, motions)) - 1.0)
            bound = 1.0
            if beyond < _LOST:
                bound = self._bound(dict(zip(kinds, motions, strict=False)))
            rows.append(np.log(bound) + _PENALTY * min(beyond, 1e3))
        return np.array(rows)

    def _bound(self, motions: dict[bool, Motion]) -> float:
        """The believed arm's largest relative bound.

        Infinite where nothing can be said of the motion.
        """
        every = max(1, int(1 / (self._step * _INFORMATION_RATE)))
        try:
            runs = informations(self._experiment, motions, self._belief.mean, every, 1 / self._step)
            bound = self._asked.largest(np.sum([one.S for one in runs], axis=0))
        except np.linalg.LinAlgError:
            return np.inf
        if not np.isfinite(bound):
            return np.inf
        return bound

    def _used(self, x: FloatArray, t: FloatArray, motions: list[Motion]) -> list[Usage]:
        """Constraint use of motions: kinematics, torque, the believed arm's rest at the end."""
        model = self._experiment.shared.model
        uses = []
        for motion in motions:
            slopes = Slopes(model, motion, 1.0)
            uses.append(usage(self._limits, slopes, (), derivatives=False))
        share = np.abs(self.torques(x, t)[self._driven]) / self._limits.torque[self._driven, None]
        uses.append(Usage(_rows("torque", self._driven.tolist()), share))
        believed = np.abs([motion.omega for motion in motions[: len(self._experiment.kinds)]])
        left = believed[:, :, -1] / (END * np.maximum(believed.max(axis=2), 1e-9))
        uses.append(Usage(_rows("rest", range(2)), left.max(axis=0)[:, None]))
        return uses

    def checked(self, x: FloatArray) -> Swung:
        """The pattern's motion, its amplitude reduced until all checked arms keep the limits."""
        kinds, limits = list(self._experiment.kinds), self._limits
        reach = np.concatenate([limits.half, limits.speed])[:, None]
        middle = np.concatenate([limits.middle, np.zeros(2)])[:, None]

        def broken(states: FloatArray) -> bool:
            return bool(np.any(np.abs(states - middle) > _BROKEN * reach))

        for shrunk in x * np.linspace(1.0, 0.0, 41)[:, None]:
            swings = self._swings(shrunk[None], self._checked, broken)
            motions = list(map(swings.motion, range(swings.theta.shape[2])))
            used = self._used(shrunk, swings.t, motions)
            if _most(used) <= 1.0 or not shrunk.any():
                break
        most: dict[Row, float] = {}
        for one in used:
            for row, value in zip(one.rows, one.most.tolist(), strict=True):
                most[row] = max(most.get(row, 0.0), value)
        worst = Usage(tuple(most), np.array(list(most.values()))[:, None])
        return Swung(shrunk, swings.t, dict(zip(kinds, motions, strict=False)), worst)


def _rows(limit: str, joints: Iterable[int]) -> tuple[Row, ...]:
    """A row of a limit for each of the joints."""
    return tuple(Row(limit, joint) for joint in joints)


def _most(uses: Sequence[Usage]) -> float:
    """The largest share of any limit that is used."""
    return max(float(one.u.max()) for one in uses)


def search(
    problem: TorqueProblem, seed: int, progress: Progress | None = None
) -> tuple[FloatArray, bool]:
    """The best pattern found (n,), and whether the search was broken off.

    An evolution strategy with weighted recombination and a step size for each number (Ros & Hansen
    2008 restrict the covariance to a diagonal as well).

    Raises
    ------
    KeyboardInterrupt
        If it is interrupted before there is a pattern to keep.
    """
    rng = np.random.default_rng(seed)
    best: tuple[float, FloatArray] | None = None
    try:
        patterns = np.array([problem.random(rng) for _ in range(2 * POPULATION)])
        weights = np.log(POPULATION / 2 + 0.5) - np.log(np.arange(1, POPULATION // 2 + 1))
        weights /= weights.sum()
        middle, spread = np.zeros(problem.size), np.full(problem.size, 0.1)
        for generation in range(GENERATIONS):
            figures = problem.figures(patterns)
            order = np.argsort(figures)
            if best is None or figures[order[0]] < best[0]:
                best = float(figures[order[0]]), patterns[order[0]]
            if generation == 0:
                middle = patterns[order[0]]
                spread = np.full(problem.size, 0.5 * np.std(middle))
            else:
                chosen = patterns[order[: POPULATION // 2]]
                moved = weights @ chosen
                variance = weights @ (chosen - middle) ** 2
                middle, spread = moved, np.sqrt(0.8 * spread**2 + 0.2 * variance)
            patterns = middle + spread * rng.standard_normal((POPULATION, problem.size))
            if progress is not None:
                progress("searching", generation + 1, GENERATIONS)
    except KeyboardInterrupt:
        if best is None:
            raise
        return best[1], True
    assert best is not None
    return best[1], False
