"""Search for the best motion: sequential quadratic programming from several random ones.

Each limit is one constraint: the soft maximum over time of its usage, log Σ exp(ρ u) / ρ, is never
below the largest. The figure and the limits are smoothed less and less from stage to stage. A
motion that the search ends with is drawn back to the resting start until it keeps every limit
exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from algid.arm import FloatArray
from algid.base.progress import Progress

_DONE = 1e-5  # change of the figure at which a stage ends
_HALVINGS = 24
_HOPELESS = 1e6
_EASY = 0.8  # usage of the limits that a random start leaves halfway to one
STARTS = 4  # random motions that the search starts from
KEPT = 1  # of them, that go on to the later stages


@dataclass(frozen=True)
class Stage:
    """Sharpness of the figure's p-norm and the limits' soft maximum, rate (Hz), most iterations."""

    sharpness: float
    hardness: float
    rate: float
    iterations: int


FIRST = Stage(3.0, 50.0, 50.0, 50)
LATER = (Stage(8.0, 200.0, 50.0, 60), Stage(16.0, 600.0, 100.0, 50))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Figure and its gradient (n,); room left to each limit (m,) and its derivatives (m, n)."""

    figure: float
    gradient: FloatArray
    room: FloatArray
    room_gradient: FloatArray


class Programme(Protocol):
    """A family of motions within limits."""

    @property
    def rest(self) -> FloatArray:
        """A motion (n,) that keeps all limits: none at all."""

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion (n,), not yet within the limits."""

    def evaluate(self, x: FloatArray, stage: Stage) -> Evaluation:
        """Figure and limits of a motion."""

    def excess(self, x: FloatArray, rate: float) -> float:
        """The largest usage of any limit."""

    def score(self, x: FloatArray) -> float:
        """What the finalists are judged by, the smaller the better."""


@dataclass(frozen=True, eq=False)
class Found:
    """The best motion, its score, and whether the search was broken off."""

    x: FloatArray
    score: float
    interrupted: bool


def optimise(problem: Programme, rate: float, seed: int, progress: Progress | None = None) -> Found:
    """The best motion that the search finds; the best so far where it is interrupted.

    Parameters
    ----------
    problem : Programme
    rate : float, Hz
        Samples a second at which the limits are kept in the end.
    seed : int
    progress : callable
        Called with how many iterations of how many are done.

    Raises
    ------
    KeyboardInterrupt
        If it is interrupted before there is a motion to keep.
    """
    search = _Search(problem, rate, progress)
    try:
        rng = np.random.default_rng(seed)
        room = 0.5 * (1 + max(_EASY, problem.excess(problem.rest, FIRST.rate)))
        starts = []
        for _ in range(STARTS):
            start = kept(problem, problem.random(rng), FIRST.rate, room)
            starts.append(search.run(start, FIRST))
        for x in sorted(starts, key=search.judged)[:KEPT]:
            better = x
            for stage in LATER:
                better = search.run(better, stage)
                search.judged(better)
    except KeyboardInterrupt:
        if search.current is None:
            raise
        search.judged(search.current)
        assert search.best is not None
        return Found(*search.best, interrupted=True)
    assert search.best is not None
    return Found(*search.best, interrupted=False)


def kept(problem: Programme, x: FloatArray, rate: float, most: float = 1.0) -> FloatArray:
    """The motion `x`, drawn back to rest until it uses `most` of the limits.

    a small one is enlarged to that.
    """
    rest = problem.rest
    low, high = 0.0, 1.0
    while most < 1.0 and problem.excess(rest + high * (x - rest), rate) < most and high < 1e3:
        low, high = high, 2 * high
    if problem.excess(rest + high * (x - rest), rate) <= most:
        return rest + high * (x - rest)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if problem.excess(rest + middle * (x - rest), rate) <= most:
            low = middle
        else:
            high = middle
    return rest + low * (x - rest)


class _Search:
    """Run stages, keep the best motion that obeys the limits, and report the progress."""

    def __init__(self, problem: Programme, rate: float, progress: Progress | None) -> None:
        self._problem, self._rate, self._progress = problem, rate, progress
        self.best: tuple[FloatArray, float] | None = None
        self.current: FloatArray | None = None
        self._rows = 1
        self._done = 0
        self._total = STARTS * FIRST.iterations + KEPT * sum(stage.iterations for stage in LATER)

    def judged(self, x: FloatArray) -> float:
        """The score of a motion within the limits, remembered if it is the best so far."""
        x = kept(self._problem, x, self._rate)
        score = self._problem.score(x)
        if self.best is None or score < self.best[1]:
            self.best = (x, score)
        return score

    def run(self, x: FloatArray, stage: Stage) -> FloatArray:
        """The motion that a stage ends with."""
        from scipy.optimize import minimize

        # SLSQP asks for the figure, the limits and their gradients at one x after another
        @lru_cache(maxsize=1)
        def evaluated(key: bytes) -> Evaluation:
            return self._evaluated(np.frombuffer(key), stage)

        def at(x: FloatArray) -> Evaluation:
            return evaluated(x.tobytes())

        start = self._done

        def step(x: FloatArray) -> None:
            self.current = x.copy()
            self._done += 1
            if self._progress is not None:
                self._progress("searching", self._done, self._total)

        limits = {"type": "ineq", "fun": lambda x: at(x).room, "jac": lambda x: at(x).room_gradient}
        ended = minimize(
            lambda x: at(x).figure,
            x,
            jac=lambda x: at(x).gradient,
            constraints=limits,
            method="SLSQP",
            callback=step,
            options={"maxiter": stage.iterations, "ftol": _DONE},
        )
        self._done = start + stage.iterations
        if not np.all(np.isfinite(ended.x)):
            return x
        return ended.x

    def _evaluated(self, x: FloatArray, stage: Stage) -> Evaluation:
        """The evaluation of `x`.

        a step so long that nothing can be said of the motion is one to be shortened.
        """
        try:
            evaluation = self._problem.evaluate(x, stage)
        except np.linalg.LinAlgError:
            evaluation = None
        if (
            evaluation is not None
            and np.isfinite(evaluation.figure)
            and np.all(np.isfinite(evaluation.room))
        ):
            self._rows = evaluation.room.size
            return evaluation
        room = np.full(self._rows, -_HOPELESS)
        return Evaluation(_HOPELESS, np.zeros(x.size), room, np.zeros((self._rows, x.size)))


def soft_maximum(u: FloatArray, hardness: float) -> tuple[FloatArray, FloatArray]:
    """Soft maximum (m,) over time of rows (m, N), and its derivatives (m, N)."""
    top = u.max(axis=1, keepdims=True)
    parts = np.exp(hardness * (u - top))
    total = parts.sum(axis=1, keepdims=True)
    return (top + np.log(total) / hardness)[:, 0], parts / total
