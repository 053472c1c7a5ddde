"""The weak estimator: weighted least squares on the momentum form, in one pass over each log.

Normal equations are kept by stretch and by joint, so that the joints' weights, the residual's size
and the error bars follow from them without a second pass. See
`algid.estimators.modulating_functions` for the equations.

======  ============================================================  ====================  =====
symbol  name                                                          shape                 unit
======  ============================================================  ====================  =====
X       columns of the two equations over R windows, the torque last  (2, q + 1, R)         mixed
gram    X Xᵀ by stretch of a window's length and joint                (B, 2, q + 1, q + 1)  mixed
c       coefficients of the columns                                   (q,)                  mixed
beta    parameters that the logs share: the arm's, delay, payload     (Q,)                  mixed
======  ============================================================  ====================  =====
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from operator import itemgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray, read_only
from algid.base.names import named_values, vector
from algid.estimators.body import with_body
from algid.estimators.combine import (
    BlockSums,
    LogInformation,
    Prior,
    by_kind,
    combine,
    of_kind,
    scaled_pinv,
)
from algid.estimators.fit import Fit, finish
from algid.estimators.innovations import LAGS, ResidualSums, pooled, residual_sums
from algid.estimators.modulating_functions import OVERLAP, Known, Windows, row_weights
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import OF_A_WINDOW, Problem, Source, TooShortError, WeakSettings
from algid.model import K2, K4, acting
from algid.signals.differences import Stencil
from algid.signals.segments import Segment, append, pieces

State = TypeVar("State")
Weighed = TypeVar("Weighed")
Solved = tuple[FloatArray, list[LogInformation]]
"""Coefficients (q,) that logs share, and their likelihoods there."""
Beside = Callable[[Segment, Windows], FloatArray]
"""Gives columns (2, m, R) beside those of the model."""
Memory = dict[Hashable, Known]
"""What models have in common of the windows, by log and piece, at one hold of the torque."""
PIECE_SAMPLES = 16384
_SHORTEST = 64  # samples: shorter pieces hold no window
REWEIGHTINGS = 4
_PASSES = 8
_DELAY_SETTLED = 0.02  # samples
_SETTLED = 1e-4  # of coefficients in which the torque is not linear: 1 or rad
_FIRST_MASSES = (0.02, 0.1, 0.5, 2.0, 10.0)  # kg
_FIRST_LENGTH = 0.3  # m


def fit(problem: Problem) -> Fit:
    """Least-squares parameters of the arm, and of its payload where there are loaded logs.

    Each log is gone over once, and a few times more where a delay is estimated or the model is not
    linear.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor a prior.
    """
    model, shared, prior = problem.settings.model, problem.shared, problem.prior
    columns = len(model.names)
    iterated = np.isin(model.names, model.iterated)
    soft = np.isin(range(columns), [place for place, _ in acting(model, "elastic")])
    at: dict[bool, FloatArray] = {}
    for _ in range(_PASSES):
        normals = normals_of(problem, at)
        beta, logs = first_estimate(shared, normals, prior)
        settled = True
        if shared.delay:
            change = beta[columns] - problem.settings.shift.delay
            settled = abs(change) < _DELAY_SETTLED * max(normal.dt for normal in normals)
            problem = problem.at(model, float(beta[columns]), estimate_delay=True)
        before, at = at, {log.loaded: log.c0[:columns] for log in logs}
        for kind, c in at.items():
            moves = np.abs(c - before.get(kind, np.inf))
            near = moves <= _SETTLED * np.where(soft, np.abs(c), 1.0)
            settled &= bool(near[iterated].all())
        if settled:
            break
    moved = np.max([normal.moved for normal in normals], axis=0)
    return with_body(finish("weak", shared, logs, beta, moved, prior, coloured=True))


def normals_of(
    problem: Problem,
    at: Mapping[bool, FloatArray] | None = None,
    beside: Beside | None = None,
    memory: Memory | None = None,
) -> list[Normal]:
    """Normal equations of the logs that are long enough for a window.

    Parameters
    ----------
    problem : Problem
    at : (q,) of unloaded (False) and of loaded logs
        Where terms that are not linear are linearised.
    beside : Beside
        Its columns stand before the torque.
    memory : Memory
        Where moments are kept of logs that are looked at with several models.
    """
    made = []
    for loaded, sources in problem.kinds():
        c = at.get(loaded) if at else None
        for source in sources:
            made.append(_normal(source, loaded, problem.settings, c, beside, memory))
    return [normal for normal in made if normal is not None]


def first_estimate(shared: Shared, normals: Sequence[Normal], prior: Prior | None) -> Solved:
    """Shared parameters from which `finish` starts, and each log's likelihood.

    Of unloaded and of loaded logs, each kind by itself, where there are any. The payload is
    the one that fits the loaded logs best for the arm: masses are tried in turn, each with the
    lengths that follow from k2 and k4 of both arms (Table 2).

    Raises
    ------
    TooShortError
        If those that are needed are not there.
    """
    unloaded, loaded = of_kind(normals, False), of_kind(normals, True)
    if unloaded:
        arm, logs = solve(unloaded)
    elif prior is not None and loaded:
        arm, logs = np.zeros(len(shared.log_names)), []
        arm[prior.places(shared.log_names)] = prior.mean
    else:
        raise TooShortError(f"no unloaded {OF_A_WINDOW}")
    if not shared.payload:
        return arm, logs
    if not loaded:
        raise TooShortError(f"no loaded {OF_A_WINDOW}")
    _, under_load = solve(loaded)
    (whole,) = by_kind(under_load)
    # A prior far tighter than the loaded logs holds the arm.
    hold = Prior(shared.log_names, arm, 1e4 * whole.total[0])
    change = named_values(shared.log_names, whole.c0 - arm)
    tried = []
    for mass in _FIRST_MASSES:
        guess = {"m_p": mass}
        for name, moment in (("l1", K4), ("l2", K2)):
            length = change.get(moment, 0.0) / max(mass * shared.model.gravity, 1e-300)
            guess[name] = length if 0.01 < length < 10 else _FIRST_LENGTH
        start = np.append(arm, vector(shared.names[arm.size :], guess))
        beta, _, value = combine(shared, [whole], start, hold)
        if np.all(beta[arm.size :] > 0):
            tried.append((value, beta))
    _, best = max(tried, key=itemgetter(0), default=(0.0, start))
    return best, logs + under_load


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of a log: Gram matrices (B, 2, q + 1, q + 1) by stretch and joint.

    The torque is the last column.

    `rows` (2,) counts the windows of each joint and `power` (2,) sums the squares of its torques in
    them, `dt` is in s, and `moved` (2,) is the spread of each joint's angle in rad.
    """

    source: Source
    loaded: bool
    gram: FloatArray
    dt: float
    rows: FloatArray
    power: FloatArray
    moved: FloatArray

    @cached_property
    def total(self) -> FloatArray:
        """The Gram matrices (2, q + 1, q + 1) over the whole log."""
        return read_only(self.gram.sum(axis=0))


def _normal(
    source: Source,
    loaded: bool,
    settings: WeakSettings,
    at: FloatArray | None,
    beside: Beside | None,
    memory: Memory | None,
) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window: see `normals_of`."""
    sums, rows, power = BlockSums(), np.zeros(2), np.zeros(2)
    longest = dt = 0.0
    ends: list[FloatArray] = []
    for piece, windows in overlapping(source(), settings):
        longest, dt = max(longest, _seconds(piece)), piece.dt
        ends += piece.theta.min(axis=1), piece.theta.max(axis=1)
        kept = None
        if memory is not None:
            kept = memory.setdefault((source, piece.start, len(piece)), {})
        X = windows.equations(settings.model, piece, settings.estimate_delay, at, kept)
        if not X.shape[2]:
            continue
        moving = windows.moving(piece, settings.rest)
        rows += moving.sum(axis=1)
        power += np.sum(moving * X[:, -1] ** 2, axis=1)
        X = of_whole_delay(X, settings)
        if beside is not None:
            X = np.concatenate([X[:, :-1], beside(piece, windows), X[:, -1:]], axis=1)
        sums.add(grams(np.where(moving[:, None], X, 0.0), OVERLAP))
    shorter = _shorter(settings, longest)
    if shorter is not None:
        return _normal(source, loaded, shorter, at, beside, memory)
    if not rows.any():
        return None
    return Normal(source, loaded, sums.values(), dt, rows, power, np.ptp(ends, axis=0))


def of_whole_delay(X: FloatArray, settings: WeakSettings) -> FloatArray:
    """Columns X (2, q + 1, R) of `Windows.equations`, in which a delay's stands for all of it."""
    if settings.estimate_delay:
        X[:, -1] += settings.shift.delay * X[:, -2]
    return X


def speeds(sources: Sequence[Source], settings: WeakSettings) -> FloatArray:
    """Speed (2,) in rad/s of each joint, RMS over the windows of logs."""
    squares, count = np.zeros(2), 0
    for source in sources:
        for piece, windows in overlapping(source(), settings):
            squares += windows.square_speeds(piece).sum(axis=1)
            count += windows.count(piece)
    return np.sqrt(squares / max(count, 1))


def residual_rows(
    source: Source, settings: WeakSettings, c: FloatArray
) -> Iterator[tuple[Segment, Segment]]:
    """A log's pieces, and for each one that has in the place of samples what its windows hold.

    Residuals at `c` (q,) in the place of angles, and the torques' moments.
    """
    for piece, windows in overlapping(source(), settings):
        X = windows.equations(settings.model, piece, at=c)
        residual = X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1])
        dt = windows.step * windows.dt
        yield piece, Segment(piece.start, dt, residual, X[:, -1], continues=piece.continues)


def residuals(source: Source, settings: WeakSettings, c: FloatArray) -> ResidualSums | None:
    """Sums over the windows' residual y − Xᵀc of one log at `c` (q,), with the torque's moments.

    The windows are those of `normals_of`; None where the log is too short for one.
    """
    longest = 0.0

    def rows() -> Iterator[Segment]:
        nonlocal longest
        for piece, own in residual_rows(source, settings, c):
            longest = max(longest, _seconds(piece))
            yield own

    gathered = [
        residual_sums(np.concatenate([own.theta, own.tau]), own.dt, OVERLAP, LAGS * OVERLAP // 2)
        for own in pieces(rows(), PIECE_SAMPLES, 2 * OVERLAP)
    ]
    shorter = _shorter(settings, longest)
    return pooled(gathered) if shorter is None else residuals(source, shorter, c)


def _shorter(settings: WeakSettings, longest: float) -> WeakSettings | None:
    """Windows for a log whose longest piece, in s, holds fewer than four; None where it does."""
    if settings.shortened or not 0 < longest < 4 * settings.window:
        return None
    return replace(settings, window=longest / 4, shortened=True)


def _seconds(piece: Segment) -> float:
    """Seconds of a piece, 0 of one that is too short for a window."""
    if len(piece) < _SHORTEST:
        return 0.0
    return len(piece) * piece.dt


def overlapping(
    segments: Iterable[Segment], settings: WeakSettings
) -> Iterator[tuple[Segment, Windows]]:
    """Pieces that repeat the last samples of the piece before, and their windows.

    The windows' bandwidth is what the rate and their length leave room for.
    """
    before: Segment | None = None
    windows: Windows | None = None
    left_over = 0
    for piece in pieces(segments, PIECE_SAMPLES):
        if windows is None:
            bandwidth = settings.bandwidth
            if bandwidth is not None:
                bandwidth = max(min(bandwidth, 0.2 / piece.dt), 6.0 / settings.window)
            shift = settings.shift.at(piece.dt)
            windows = Windows(piece.dt, settings.window, shift, bandwidth)
        if piece.continues and before is not None:
            first = max(len(before) - windows.overlap - left_over, 0)
            piece = replace(append(before.part(first, len(before)), piece), continues=True)
        left_over = (len(piece) - 2 * windows.margin) % windows.step
        before = piece
        if settings.shift.held and len(piece) > 1:
            piece = replace(piece, tau=Stencil(piece.dt, held=True).moving(piece.tau))
        yield piece, windows


def grams(X: FloatArray, rows: int) -> FloatArray:
    """Gram matrices (B, 2, m, m) of X (2, m, R), by stretches of `rows` rows."""
    size, count = X.shape[1:]
    stretches = ceil(count / rows)
    padded = np.zeros((2, size, stretches * rows))
    padded[:, :, :count] = X
    parts = padded.reshape(2, size, stretches, rows).transpose(2, 0, 1, 3)
    return parts @ parts.swapaxes(-1, -2)


def reweighted(
    weigh: Callable[[State], Weighed], solve: Callable[[Weighed, State], State], state: State
) -> tuple[State, Weighed]:
    """Least squares whose weights follow from its residual: weighed and solved in turn.

    Parameters
    ----------
    weigh : callable
        Gives the weighed logs at a state of the coefficients.
    solve : callable
        Gives the state of weighed logs, from the last one.
    state : where it starts

    Returns
    -------
    The state, and the weighed logs that have it.
    """
    for _ in range(REWEIGHTINGS):
        weighed = weigh(state)
        state = solve(weighed, state)
    return state, weighed


def evidence(
    gram: FloatArray,
    rows: int | FloatArray,
    c: FloatArray,
    loaded: bool,
    *,
    used: Sequence[bool] | NDArray[np.bool_] = (True, True),
    every: int = 1,
) -> LogInformation:
    """A log's quadratic likelihood at coefficients, its rows weighed by their residual there.

    Parameters
    ----------
    gram : (B, 2, q + 1, q + 1), of [X y], or (B, 2, 2 q + 1, 2 q + 1), of [Z X y]
        With instruments Z the likelihood is projected on them: see `algid.estimators.instruments`.
    rows : how many windows there are, or (2,) of each joint
    c : (q,)
    loaded : whether the log is
    used : (2,), which joints' rows count
    every : every how many windows are among the rows
    """
    q = c.size
    v = np.concatenate([np.zeros(gram.shape[-1] - 1 - q), -c, [1.0]])
    weights = np.where(used, row_weights(gram.sum(axis=0), v, rows), 0.0)
    # Overlapping rows repeat each other: a window's worth of rows counts as two.
    gram = np.einsum("a,baxy->bxy", weights * (2.0 * every / OVERLAP), gram)
    S = gram[:, :q, -1 - q : -1]
    g = gram[:, :q, -1] - S @ c
    if gram.shape[-1] > q + 1:
        projection = S.sum(axis=0).T @ scaled_pinv(gram[:, :q, :q].sum(axis=0))
        S, g = projection @ S, g @ projection.T
    return LogInformation(loaded, c, S, g)


def solve(normals: Sequence[Normal]) -> Solved:
    """Coefficients of logs that share them, and each log's likelihood there.

    The rows of a joint weigh by its own residual, log by log.
    """
    grams = np.stack([normal.total for normal in normals])
    rows = np.stack([normal.rows for normal in normals])

    def weigh(c: FloatArray) -> FloatArray:
        if not c.size:  # the first time
            return np.ones((len(normals), 2))
        return row_weights(grams, np.append(-c, 1.0), rows)

    def solved(weights: FloatArray, _: FloatArray) -> FloatArray:
        total = np.tensordot(weights, grams, 2)
        return scaled_pinv(total[:-1, :-1]) @ total[:-1, -1]

    start: FloatArray = np.empty(0)
    c, _ = reweighted(weigh, solved, start)
    return c, [evidence(normal.gram, normal.rows, c, normal.loaded) for normal in normals]
