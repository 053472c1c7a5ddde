"""Search for the best motion: sequential quadratic programming from several random ones.

Each limit is one constraint: the soft maximum over time of its usage, log Σ exp(ρ u) / ρ, is never
below the largest. The figure and the limits are smoothed less and less from stage to stage. A
motion that the search ends with is drawn back to the resting start until it keeps every limit
exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.progress import Progress

if TYPE_CHECKING:
    from algid.designs.position import PositionProblem

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


def optimise(
    problem: PositionProblem, rate: float, seed: int, progress: Progress | None = None
) -> tuple[FloatArray, bool]:
    """The best motion that the search finds, and whether it was broken off before its end.

    Parameters
    ----------
    problem : PositionProblem
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
    from scipy.optimize import minimize

    total = STARTS * FIRST.iterations + KEPT * sum(stage.iterations for stage in LATER)
    done = 0
    current: FloatArray | None = None
    judged: dict[float, FloatArray] = {}

    def score(x: FloatArray) -> float:
        """The score of a motion drawn within the limits, which is remembered."""
        x = kept(problem, x, rate)
        found = problem.score(x)
        judged.setdefault(found, x)
        return found

    def step(x: FloatArray) -> None:
        nonlocal done, current
        current = x.copy()
        done += 1
        if progress is not None:
            progress("searching", done, total)

    def run(x: FloatArray, stage: Stage) -> FloatArray:
        """The motion that a stage ends with."""
        nonlocal done

        # SLSQP asks for the figure, the limits and their gradients at one x after another
        @lru_cache(maxsize=1)
        def evaluated(key: bytes) -> Evaluation:
            return _evaluated(problem, np.frombuffer(key), stage, rows)

        def at(x: FloatArray) -> Evaluation:
            return evaluated(x.tobytes())

        rows = 1
        rows = at(x).room.size
        start = done
        ended = minimize(
            lambda x: at(x).figure,
            x,
            jac=lambda x: at(x).gradient,
            constraints={
                "type": "ineq",
                "fun": lambda x: at(x).room,
                "jac": lambda x: at(x).room_gradient,
            },
            method="SLSQP",
            callback=step,
            options={"maxiter": stage.iterations, "ftol": _DONE},
        )
        done = start + stage.iterations
        return ended.x if np.all(np.isfinite(ended.x)) else x

    interrupted = False
    try:
        rng = np.random.default_rng(seed)
        room = 0.5 * (1 + max(_EASY, problem.excess(problem.rest, FIRST.rate)))
        ends = []
        for _ in range(STARTS):
            ends.append(run(kept(problem, problem.random(rng), FIRST.rate, room), FIRST))
        for end in sorted(ends, key=score)[:KEPT]:
            better = end
            for stage in LATER:
                better = run(better, stage)
                score(better)
    except KeyboardInterrupt:
        if current is None:
            raise
        score(current)
        interrupted = True
    return judged[min(judged)], interrupted


def kept(problem: PositionProblem, x: FloatArray, rate: float, most: float = 1.0) -> FloatArray:
    """The motion `x`, drawn back to rest until it uses `most` of the limits.

    A small one is enlarged to that.
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


def _evaluated(problem: PositionProblem, x: FloatArray, stage: Stage, rows: int) -> Evaluation:
    """The evaluation of `x`, of `rows` limits.

    A step so long that nothing can be said of the motion is one to be shortened.
    """
    try:
        found = problem.evaluate(x, stage)
        if np.isfinite(found.figure) and np.all(np.isfinite(found.room)):
            return found
    except np.linalg.LinAlgError:
        pass
    room = np.full(rows, -_HOPELESS)
    return Evaluation(_HOPELESS, np.zeros(x.size), room, np.zeros((rows, x.size)))


def soft_maximum(u: FloatArray, hardness: float) -> tuple[FloatArray, FloatArray]:
    """Soft maximum (m,) over time of rows (m, N), and its derivatives (m, N)."""
    top = u.max(axis=1, keepdims=True)
    parts = np.exp(hardness * (u - top))
    total = parts.sum(axis=1, keepdims=True)
    return (top + np.log(total) / hardness)[:, 0], parts / total
