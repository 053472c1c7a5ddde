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
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
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
    model = settings.model
    iterated = [model.names.index(name) for name in model.iterated if name in model.names]
    compliances = [place for place, _ in acting(model, "elastic")]
    soft = np.isin(range(len(model.names)), compliances)
    at: dict[bool, FloatArray] = {}
    for _ in range(_PASSES):
        normals = {}
        for kind, sources in problem.kinds():
            own = normals_of(sources, settings, at.get(kind))
            if own:
                normals[kind] = own
        solved = {kind: solve(own, kind) for kind, own in normals.items()}
        beta, logs = first_estimate(shared, solved, prior)
        base, change = settings.shift.delay, 0.0
        if shared.delay:
            change = float(beta[len(model.names)])
            since = base * np.isin(shared.names, DELAYS)
            beta = beta + since
            logs = [replace(log, c0=log.c0 + since[: log.c0.size]) for log in logs]
            settings = settings.delayed(base + change)
        settled = True
        if not model.linear:
            before, at = at, {log.loaded: log.c0[: len(model.names)] for log in logs}
            moves = [np.abs(at[kind] - before.get(kind, np.inf))[iterated] for kind in at]
            sizes = [np.where(soft, np.abs(at[kind]), 1.0)[iterated] for kind in at]
            settled = bool(np.all(np.array(moves) <= _SETTLED * np.array(sizes)))
        every = [normal for own in normals.values() for normal in own]
        if settled and abs(change) < _DELAY_SETTLED * max(normal.dt for normal in every):
            break
    moved = np.max([normal.moved for normal in every], axis=0)
    return with_body(finish("weak", shared, logs, beta, moved, prior, coloured=True))


def normals_of(
    sources: Sequence[Source],
    settings: WeakSettings,
    at: FloatArray | None = None,
    beside: Callable[[Segment, Windows], FloatArray] | None = None,
) -> list[Normal]:
    """Normal equations of the logs that are long enough for a window: see `normal_equations`."""
    normals = []
    for source in sources:
        normal = normal_equations(source, settings, at, beside=beside)
        if normal is not None:
            normals.append(normal)
    return normals


def first_estimate(
    shared: Shared, solved: Mapping[bool, Solved], prior: Prior | None
) -> tuple[FloatArray, list[LogInformation]]:
    """Shared parameters from which `finish` starts, and each log's likelihood.

    `solved` holds what unloaded (False) and loaded logs give by themselves, where there are any.
    The payload is the one that fits the loaded logs best for the arm: masses are tried in turn,
    each with the lengths that follow from k2 and k4 of both arms (Table 2).

    Raises
    ------
    TooShortError
        If those that are needed are not there.
    """
    if False not in solved and (prior is None or True not in solved):
        raise TooShortError(f"no unloaded {OF_A_WINDOW}")
    if shared.payload and True not in solved:
        raise TooShortError(f"no loaded {OF_A_WINDOW}")
    arm: FloatArray = np.zeros(len(shared.log_names))
    logs: list[LogInformation] = []
    if False in solved:
        arm, logs = solved[False]
    elif prior is not None:
        arm[prior.places(shared.log_names)] = prior.mean
    if not shared.payload:
        return arm, logs
    _, under_load = solved[True]
    ((whole,), _) = by_kind(under_load)
    # A prior far tighter than the loaded logs holds the arm.
    hold = Prior.of(shared.log_names, arm, scaled_pinv(whole.total[0]) * 1e-4)
    change = dict(zip(shared.log_names, (whole.c0 - arm).tolist(), strict=True))
    best: FloatArray | None = None
    most = -np.inf
    for mass in _FIRST_MASSES:
        guess = {"m_p": mass}
        for name, moment in (("l1", K4), ("l2", K2)):
            length = change.get(moment, 0.0) / max(mass * shared.model.gravity, 1e-300)
            guess[name] = length if 0.01 < length < 10 else _FIRST_LENGTH
        start = np.append(arm, [guess[name] for name in shared.names[arm.size :]])
        beta, _, value = combine(shared, [whole], start, hold)
        if value > most and np.all(beta[arm.size :] > 0):
            best, most = beta, value
    return start if best is None else best, logs + under_load


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of a log: Gram matrices (B, 2, q + 1, q + 1) by stretch and joint.

    The torque is the last column.

    `samples` counts the log's samples, `rows` (2,) the windows of each joint, `dt` is in s, and
    `moved` (2,) is the spread of each joint's angle in rad.
    """

    gram: FloatArray
    dt: float
    samples: int
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
    beside: Callable[[Segment, Windows], FloatArray] | None = None,
) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window.

    A log without a stretch of four windows gets windows of a quarter of its longest stretch. Terms
    that are not linear are linearised at the coefficients `at` (q,). Of a log that is looked at
    with several models, at one hold of the torque, `known` keeps the moments by piece. Columns
    (2, m, R) `beside` those of the model stand before the torque.
    """

    def gather(window: float) -> tuple[Normal | None, float]:
        sums = BlockSums()
        samples, rows = 0, np.zeros(2)
        longest = dt = 0.0
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for piece, windows, fresh in overlapping(source(), settings, window):
            dt = piece.dt
            longest = max(longest, _seconds(piece))
            samples += fresh
            low = np.minimum(low, piece.theta.min(axis=1))
            high = np.maximum(high, piece.theta.max(axis=1))
            kept = None
            if known is not None:
                kept = known.setdefault((piece.start, len(piece)), {})
            X = windows.equations(settings.model, piece, settings.estimate_delay, at, kept)
            if not X.shape[2]:
                continue
            if beside is not None:
                X = np.concatenate([X[:, :-1], beside(piece, windows), X[:, -1:]], axis=1)
            moving = np.ones((2, X.shape[2]), dtype=bool)
            if settings.rest is not None:
                moving = windows.square_speeds(piece) >= np.square(settings.rest)[:, None]
                X = np.where(moving[:, None], X, 0.0)
            rows += moving.sum(axis=1)
            sums.add(grams(X, OVERLAP))
        if not rows.any():
            return None, longest
        return Normal(sums.values(), dt, samples, rows, high - low), longest

    return _with_window(gather, settings.window)


def speeds(sources: Sequence[Source], settings: WeakSettings) -> FloatArray:
    """Speed (2,) in rad/s of each joint, RMS over the windows of logs."""
    squares, count = np.zeros(2), 0
    for source in sources:
        for piece, windows, _ in overlapping(source(), settings):
            squares_of_piece = windows.square_speeds(piece)
            squares += squares_of_piece.sum(axis=1)
            count += squares_of_piece.shape[1]
    return np.sqrt(squares / max(count, 1))


def residual_rows(
    source: Source, settings: WeakSettings, c: FloatArray, window: float | None = None
) -> Iterator[tuple[Segment, Windows, FloatArray]]:
    """A log's pieces, their windows, and residuals at `c` (q,) above torques' moments (4, R)."""
    for piece, windows, _ in overlapping(source(), settings, window):
        X = windows.equations(settings.model, piece, False, c)
        residual = X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1])
        yield piece, windows, np.concatenate([residual, X[:, -1]])


def residuals(source: Source, settings: WeakSettings, c: FloatArray) -> ResidualSums | None:
    """Sums over the windows' residual y − Xᵀc of one log at `c` (q,), with the torque's moments.

    The windows are those of `normal_equations`; None where the log is too short for one.
    """

    def gather(window: float) -> tuple[list[ResidualSums], float]:
        gathered: list[ResidualSums] = []
        rows: list[FloatArray] = []
        longest = spacing = 0.0

        def add_up() -> None:
            if _count(rows) >= 2 * OVERLAP:
                together = np.concatenate(rows, axis=1)
                gathered.append(residual_sums(together, spacing, OVERLAP, LAGS * OVERLAP // 2))
            rows.clear()

        for piece, windows, own in residual_rows(source, settings, c, window):
            longest = max(longest, _seconds(piece))
            if not piece.continues or _count(rows) >= PIECE_SAMPLES:  # no log is held whole
                add_up()
            spacing = windows.step * windows.dt
            rows.append(own)
        add_up()
        return gathered, longest

    return pooled(_with_window(gather, settings.window))


def _count(rows: Iterable[FloatArray]) -> int:
    """How many windows the parts (4, R) have together."""
    return sum(part.shape[1] for part in rows)


def _with_window(gather: Callable[[float], tuple[Gathered, float]], window: float) -> Gathered:
    """Gather by windows of `window` s, or shorter if the longest piece holds fewer than four."""
    gathered, longest = gather(window)
    if 0 < longest < 4 * window:
        gathered, _ = gather(longest / 4)
    return gathered


def _seconds(piece: Segment) -> float:
    """Seconds of a piece, 0 of one that is too short for a window."""
    if len(piece) < _SHORTEST:
        return 0.0
    return len(piece) * piece.dt


def overlapping(
    segments: Iterable[Segment], settings: WeakSettings, window: float | None = None
) -> Iterator[tuple[Segment, Windows, int]]:
    """Pieces that repeat the last samples of the piece before, their windows and fresh samples.

    The windows' bandwidth is what the rate and their length leave room for.
    """
    before: Segment | None = None
    windows: Windows | None = None
    left_over = 0
    if window is None:
        window = settings.window
    for piece in pieces(segments, PIECE_SAMPLES):
        if windows is None:
            bandwidth = settings.bandwidth
            if bandwidth is not None:
                bandwidth = max(min(bandwidth, 0.2 / piece.dt), 6.0 / window)
            windows = Windows(piece.dt, window, settings.shift.at(piece.dt), bandwidth)
        fresh = len(piece)
        if piece.continues and before is not None:
            first = max(len(before) - windows.overlap - left_over, 0)
            piece = replace(append(before.part(first, len(before)), piece), continues=True)
        left_over = (len(piece) - 2 * windows.margin) % windows.step
        before = piece
        if settings.shift.held and len(piece) > 1:
            piece = replace(piece, tau=Stencil(piece.dt, held=True).moving(piece.tau))
        yield piece, windows, fresh


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
