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
from math import ceil
from operator import itemgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.names import named_values, vector
from algid.estimators.body import with_body
from algid.estimators.combine import (
    BlockSums,
    LogInformation,
    Prior,
    by_kind,
    combine,
    scaled_pinv,
)
from algid.estimators.fit import Fit, finish
from algid.estimators.innovations import LAGS, ResidualSums, pooled, residual_sums
from algid.estimators.modulating_functions import OVERLAP, Known, Windows, row_weights
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import OF_A_WINDOW, Problem, Source, TooShortError, WeakSettings
from algid.model import DELAYS, K2, K4, acting
from algid.signals.differences import Stencil
from algid.signals.segments import Segment, append, pieces

Gathered = TypeVar("Gathered")
State = TypeVar("State")
Weighed = TypeVar("Weighed")
Solved = tuple[FloatArray, list[LogInformation]]
"""Coefficients (q,) that logs share, and their likelihoods there."""
Beside = Callable[[Segment, Windows], FloatArray]
"""Gives columns (2, m, R) beside those of the model."""
NO_MEMORY: Mapping[Source, dict[Hashable, Known]] = {}
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
    settings, shared, prior = problem.settings, problem.shared, problem.prior
    names = settings.model.names
    iterated = np.isin(names, settings.model.iterated)
    soft = np.isin(range(len(names)), [place for place, _ in acting(settings.model, "elastic")])
    at: dict[bool, FloatArray] = {}
    for _ in range(_PASSES):
        normals = normals_by_kind(problem, settings, at)
        beta, logs = first_estimate(shared, normals, prior)
        every = together(normals)
        settled = True
        if shared.delay:
            change = float(beta[len(names)])
            settled = abs(change) < _DELAY_SETTLED * max(normal.dt for normal in every)
            since = settings.shift.delay * np.isin(shared.names, DELAYS)
            beta = beta + since
            logs = [replace(log, c0=log.c0 + since[: log.c0.size]) for log in logs]
            settings = settings.delayed(settings.shift.delay + change)
        before, at = at, {log.loaded: log.c0[: len(names)] for log in logs}
        for kind, c in at.items():
            moves = np.abs(c - before.get(kind, np.inf))
            near = moves <= _SETTLED * np.where(soft, np.abs(c), 1.0)
            settled &= bool(near[iterated].all())
        if settled:
            break
    moved = np.max([normal.moved for normal in every], axis=0)
    return with_body(finish("weak", shared, logs, beta, moved, prior, coloured=True))


def normals_of(
    sources: Iterable[Source],
    settings: WeakSettings,
    at: FloatArray | None = None,
    beside: Beside | None = None,
    memory: Mapping[Source, dict[Hashable, Known]] = NO_MEMORY,
) -> list[Normal]:
    """Normal equations of the logs that are long enough for a window: see `normal_equations`."""
    every = (
        normal_equations(source, settings, at, memory.get(source), beside) for source in sources
    )
    return [normal for normal in every if normal is not None]


def normals_by_kind(
    problem: Problem,
    settings: WeakSettings,
    at: Mapping[bool, FloatArray],
    beside: Beside | None = None,
    memory: Mapping[Source, dict[Hashable, Known]] = NO_MEMORY,
) -> dict[bool, list[Normal]]:
    """The same of unloaded (False) and of loaded logs, `at` the coefficients of each kind."""
    return {
        kind: normals_of(sources, settings, at.get(kind), beside, memory)
        for kind, sources in problem.kinds()
    }


def together(normals: Mapping[bool, list[Normal]]) -> list[Normal]:
    """Those of both kinds, unloaded ones first."""
    return [normal for kind in normals for normal in normals[kind]]


def first_estimate(
    shared: Shared, normals: Mapping[bool, Sequence[Normal]], prior: Prior | None
) -> Solved:
    """Shared parameters from which `finish` starts, and each log's likelihood.

    Of unloaded (False) and of loaded logs, each kind by itself, where there are any. The payload is
    the one that fits the loaded logs best for the arm: masses are tried in turn, each with the
    lengths that follow from k2 and k4 of both arms (Table 2).

    Raises
    ------
    TooShortError
        If those that are needed are not there.
    """
    if normals.get(False):
        arm, logs = solve(normals[False])
    elif prior is not None and normals.get(True):
        arm, logs = np.zeros(len(shared.log_names)), []
        arm[prior.places(shared.log_names)] = prior.mean
    else:
        raise TooShortError(f"no unloaded {OF_A_WINDOW}")
    if not shared.payload:
        return arm, logs
    if not normals.get(True):
        raise TooShortError(f"no loaded {OF_A_WINDOW}")
    _, under_load = solve(normals[True], True)
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

    `rows` (2,) counts the windows of each joint, `dt` is in s, and
    `moved` (2,) is the spread of each joint's angle in rad.
    """

    gram: FloatArray
    dt: float
    rows: FloatArray
    moved: FloatArray

    @property
    def power(self) -> FloatArray:
        """Squares of each joint's torque, summed (2,)."""
        return np.asarray(self.gram[:, :, -1, -1].sum(axis=0))


def normal_equations(
    source: Source,
    settings: WeakSettings,
    at: FloatArray | None = None,
    known: dict[Hashable, Known] | None = None,
    beside: Beside | None = None,
) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window.

    A log without a stretch of four windows gets windows of a quarter of its longest stretch. Terms
    that are not linear are linearised at the coefficients `at` (q,). Of a log that is looked at
    with several models, at one hold of the torque, `known` keeps the moments by piece. Columns
    (2, m, R) `beside` those of the model stand before the torque.
    """

    def gather(settings: WeakSettings) -> tuple[Normal | None, float]:
        sums = BlockSums()
        rows, longest, dt = np.zeros(2), 0.0, 0.0
        ends: list[FloatArray] = []
        for piece, windows in overlapping(source(), settings):
            dt = piece.dt
            longest = max(longest, _seconds(piece))
            ends += piece.theta.min(axis=1), piece.theta.max(axis=1)
            kept = None
            if known is not None:
                kept = known.setdefault((piece.start, len(piece)), {})
            X = windows.equations(settings.model, piece, settings.estimate_delay, at, kept)
            if not X.shape[2]:
                continue
            if beside is not None:
                X = np.concatenate([X[:, :-1], beside(piece, windows), X[:, -1:]], axis=1)
            moving = windows.moving(piece, settings.rest)
            rows += moving.sum(axis=1)
            sums.add(grams(np.where(moving[:, None], X, 0.0), OVERLAP))
        if not rows.any():
            return None, longest
        return Normal(sums.values(), dt, rows, np.ptp(ends, axis=0)), longest

    return _with_window(gather, settings)


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
) -> Iterator[tuple[Segment, Windows, FloatArray]]:
    """A log's pieces, their windows, and residuals at `c` (q,) above torques' moments (4, R)."""
    for piece, windows in overlapping(source(), settings):
        X = windows.equations(settings.model, piece, False, c)
        residual = X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1])
        yield piece, windows, np.concatenate([residual, X[:, -1]])


def residuals(source: Source, settings: WeakSettings, c: FloatArray) -> ResidualSums | None:
    """Sums over the windows' residual y − Xᵀc of one log at `c` (q,), with the torque's moments.

    The windows are those of `normal_equations`; None where the log is too short for one.
    """

    def gather(settings: WeakSettings) -> tuple[list[ResidualSums], float]:
        gathered: list[ResidualSums] = []
        rows: list[FloatArray] = []
        longest = spacing = 0.0

        def add_up() -> None:
            if _count(rows) >= 2 * OVERLAP:
                together = np.concatenate(rows, axis=1)
                gathered.append(residual_sums(together, spacing, OVERLAP, LAGS * OVERLAP // 2))
            rows.clear()

        for piece, windows, own in residual_rows(source, settings, c):
            longest = max(longest, _seconds(piece))
            if not piece.continues or _count(rows) >= PIECE_SAMPLES:  # no log is held whole
                add_up()
            spacing = windows.step * windows.dt
            rows.append(own)
        add_up()
        return gathered, longest

    return pooled(_with_window(gather, settings))


def _count(rows: Iterable[FloatArray]) -> int:
    """How many windows the parts (4, R) have together."""
    return sum(part.shape[1] for part in rows)


def _with_window(
    gather: Callable[[WeakSettings], tuple[Gathered, float]], settings: WeakSettings
) -> Gathered:
    """Gather by the settings' windows, or shorter if the longest piece holds fewer than four."""
    gathered, longest = gather(settings)
    if 0 < longest < 4 * settings.window:
        gathered, _ = gather(replace(settings, window=longest / 4))
    return gathered


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


def solve(normals: Sequence[Normal], loaded: bool = False) -> Solved:
    """Coefficients of logs that share them, and each log's likelihood there.

    The rows of a joint weigh by its own residual, log by log.
    """
    grams = np.stack([normal.gram.sum(axis=0) for normal in normals])
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
    return c, [evidence(normal.gram, normal.rows, c, loaded) for normal in normals]
