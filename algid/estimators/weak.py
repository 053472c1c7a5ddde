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

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import TypeVar

import numpy as np

from algid.arm import FloatArray
from algid.estimators.body import with_body
from algid.estimators.combine import (
    FEWEST_LOGS,
    BlockSums,
    LogInformation,
    Prior,
    combine,
    scaled_pinv,
    scaled_pinvs,
)
from algid.estimators.fit import Fit, conclude
from algid.estimators.innovations import LAGS, ResidualSums, pooled, residual_sums
from algid.estimators.modulating_functions import OVERLAP, Known, Windows, row_weights
from algid.estimators.parametrisation import Shared
from algid.estimators.too_short import OF_A_WINDOW, TooShortError
from algid.model import K2, K4, Model
from algid.signals.differences import held_torque
from algid.signals.segments import Segment, pieces
from algid.signals.shift import AT_ONCE, TorqueShift

Source = Callable[[], Iterable[Segment]]
Gathered = TypeVar("Gathered")
Solved = tuple[FloatArray, list[LogInformation]]
"""Coefficients (q,) that logs share, and their likelihoods there."""
PIECE_SAMPLES = 16384
_SHORTEST = 64  # samples: shorter pieces hold no window
_REWEIGHTINGS = 4
_TOGETHER = 256  # logs that are left out at once
_PASSES = 8
_DELAY_SETTLED = 0.02  # samples
_SETTLED = 1e-4  # of coefficients in which the torque is not linear: 1 or rad
_FIRST_MASSES = (0.02, 0.1, 0.5, 2.0, 10.0)  # kg
_FIRST_LENGTH = 0.3  # m


@dataclass(frozen=True)
class WeakSettings:
    """Settings of the weak estimator.

    Parameters
    ----------
    model : Model
    window : float, s
        Length of a window; a record shorter than four windows gets shorter ones.
    bandwidth : float, Hz, or None for the log's own velocities
        Of the zero-phase differentiator behind k1's column.
    shift : TorqueShift
        After how long a logged torque acts; its delay is where the estimate of it starts with
        `estimate_delay`.
    estimate_delay : bool
    rest : (2,) float, rad/s
        Speeds of the joints, RMS over a window, below which a joint stands: dry friction holds it
        then, and its window is left out. None looks at every window.
    """

    model: Model = field(default_factory=Model)
    window: float = 0.4
    bandwidth: float | None = 40.0
    shift: TorqueShift = AT_ONCE
    estimate_delay: bool = False
    rest: tuple[float, float] | None = None

    def delayed(self, delay: float) -> WeakSettings:
        """The same with a delay of the torque, s."""
        return replace(self, shift=replace(self.shift, delay=delay))


def fit(
    unloaded: Sequence[Source],
    loaded: Sequence[Source] = (),
    settings: WeakSettings | None = None,
    lengths: dict[str, float] | None = None,
    prior: Prior | None = None,
) -> Fit:
    """Least-squares parameters of the arm, and of its payload where there are loaded logs.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`, the stretches of one log in time. It is called
        once, and a few times more where a delay is estimated or the model is not linear.
    settings : WeakSettings
    lengths : dict
        Known link lengths "l1", "l2" in m.
    prior : Prior
        What an earlier result knows of the arm; unloaded logs are not needed then.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor a prior.
    """
    settings = settings or WeakSettings()
    model = settings.model
    shared = Shared(model, settings.estimate_delay, bool(loaded), dict(lengths or {}))
    iterated = [model.names.index(name) for name in model.iterated if name in model.names]
    at: list[FloatArray | None] = [None, None]
    for _ in range(_PASSES):
        normals = normals_of(unloaded, settings, at[0])
        loaded_normals = normals_of(loaded, settings, at[1])
        beta, logs = first_estimate(shared, normals, loaded_normals, prior)
        base, change = settings.shift.delay, 0.0
        if shared.delay:
            change = float(beta[len(model.names)])
            beta, logs = _from(shared, beta, logs, base)
            settings = settings.delayed(base + change)
        settled = True
        if not model.linear:
            before, at = at, _linearisation(shared, beta, logs)
            settled = _has_settled(before, at, iterated)
        every = normals + loaded_normals
        if settled and abs(change) < _DELAY_SETTLED * max(normal.dt for normal in every):
            break
    moved = np.max([normal.moved for normal in every], axis=0)
    without = None
    if len(every) >= FEWEST_LOGS:
        without = _left_out(shared, normals, loaded_normals, prior, base, beta)
    return with_body(
        conclude("weak", shared, logs, beta, moved, prior, coloured=True, without=without)
    )


def _has_settled(
    before: Sequence[FloatArray | None], after: Sequence[FloatArray | None], iterated: list[int]
) -> bool:
    """Whether the coefficients in which the torque is not linear have hardly moved."""
    for old, new in zip(before, after, strict=True):
        if new is None:
            continue
        if old is None or not np.all(np.abs(new - old)[iterated] < _SETTLED):
            return False
    return True


def _left_out(
    shared: Shared,
    unloaded: list[Normal],
    loaded: list[Normal],
    prior: Prior | None,
    base: float,
    beta: FloatArray,
) -> FloatArray:
    """Estimates (n, Q) without each log, every other one weighed anew.

    `base` is the delay, in s, from which the passes estimate a change; without the only log of its
    kind stands `beta`.
    """
    every, every_loaded = _solved_together(unloaded, False), _solved_together(loaded, True)
    pairs = [(rest, every_loaded) for rest in _solved_without_each(unloaded, False)]
    pairs += [(every, rest) for rest in _solved_without_each(loaded, True)]
    estimates = []
    for rest, rest_loaded in pairs:
        if (unloaded and rest is None) or (loaded and rest_loaded is None):
            estimates.append(beta)
            continue
        start, others = _started(shared, rest, rest_loaded, prior)
        start, others = _from(shared, start, others, base)
        estimates.append(combine(shared, others, start, prior)[0])
    return np.array(estimates)


def _solved_together(normals: Sequence[Normal], loaded: bool) -> Solved | None:
    """What `solve` gives, all logs in one sum; None without any."""
    if not normals:
        return None
    c, logs = solve(normals, loaded)
    S, g = np.zeros((c.size, c.size)), np.zeros(c.size)
    for log in logs:
        log_S, log_g = log.total
        S += log_S
        g += log_g
    return c, [LogInformation(loaded, c, S[None], g[None])]


def _solved_without_each(normals: Sequence[Normal], loaded: bool) -> list[Solved | None]:
    """What `solve` gives without each of several logs, all others in one sum.

    None without the only one.

    The sums without a log are those of all less its own, and many logs' are taken in one product.
    """
    if len(normals) < 2:
        return [None] * len(normals)
    grams = np.stack([normal.gram.sum(axis=0) for normal in normals])
    rows = np.stack([normal.rows for normal in normals])
    least = 1e-24 * grams[:, :, -1, -1].max(axis=1)[:, None] + 1e-300
    size, flat = grams.shape[-1], grams.reshape(2 * len(normals), -1)
    solutions: list[Solved | None] = []
    for first in range(0, len(normals), _TOGETHER):
        left = np.arange(first, min(first + _TOGETHER, len(normals)))
        others = np.ones((left.size, len(normals), 1))
        others[np.arange(left.size), left] = 0.0
        weights = np.broadcast_to(others, (left.size, len(normals), 2))
        for _ in range(_REWEIGHTINGS):
            total = (weights.reshape(left.size, -1) @ flat).reshape(-1, size, size)
            c = np.einsum("nij,nj->ni", scaled_pinvs(total[:, :-1, :-1]), total[:, :-1, -1])
            v = np.concatenate([-c, np.ones((left.size, 1))], axis=1)
            squares = (v[:, :, None] * v[:, None, :]).reshape(left.size, -1) @ flat.T
            squares = squares.reshape(left.size, len(normals), 2)
            weights = others * (rows / np.maximum(squares, least))
        total = 2.0 / OVERLAP * (weights.reshape(left.size, -1) @ flat).reshape(-1, size, size)
        for own, gram in zip(c, total, strict=True):
            S = gram[:-1, :-1]
            g = gram[:-1, -1] - S @ own
            solutions.append((own, [LogInformation(loaded, own, S[None], g[None])]))
    return solutions


def _linearisation(
    shared: Shared, beta: FloatArray, logs: Sequence[LogInformation]
) -> list[FloatArray | None]:
    """Model coefficients at which the next pass linearises unloaded and loaded logs."""
    count = len(shared.model.names)
    at: list[FloatArray | None] = [beta[:count], None]
    for log in reversed(logs):  # the first log of each kind stands in the end
        at[log.loaded] = log.c0[:count]
    return at


def normals_of(
    sources: Sequence[Source], settings: WeakSettings, at: FloatArray | None = None
) -> list[Normal]:
    """Normal equations of the logs that are long enough for a window: see `normal_equations`."""
    normals = []
    for source in sources:
        normal = normal_equations(source, settings, at)
        if normal is not None:
            normals.append(normal)
    return normals


def first_estimate(
    shared: Shared, unloaded: list[Normal], loaded: list[Normal], prior: Prior | None
) -> tuple[FloatArray, list[LogInformation]]:
    """Shared parameters from which `conclude` starts, and each log's likelihood."""
    arm, loaded_arm = None, None
    if unloaded:
        arm = solve(unloaded)
    if loaded:
        loaded_arm = solve(loaded, loaded=True)
    return _started(shared, arm, loaded_arm, prior)


def _started(
    shared: Shared, unloaded: Solved | None, loaded: Solved | None, prior: Prior | None
) -> tuple[FloatArray, list[LogInformation]]:
    """The same from what logs without and with payload give by themselves."""
    if unloaded is None and (prior is None or loaded is None):
        raise TooShortError(f"no unloaded {OF_A_WINDOW}")
    logs: list[LogInformation] = []
    arm: FloatArray = np.zeros(len(shared.log_names))
    if unloaded is not None:
        arm, logs = unloaded
    elif prior is not None:
        arm[prior.places(shared.log_names)] = prior.mean
    if not shared.payload:
        return arm, logs
    if loaded is None:
        raise TooShortError(f"no loaded {OF_A_WINDOW}")
    c, under_load = loaded
    S = np.concatenate([log.S for log in under_load])
    g = np.concatenate([log.g for log in under_load])
    return first_payload(shared, arm, LogInformation(True, c, S, g)), logs + under_load


def _from(
    shared: Shared, beta: FloatArray, logs: list[LogInformation], base: float
) -> tuple[FloatArray, list[LogInformation]]:
    """Estimate and likelihoods in the whole delay, where they were in the change from `base`."""
    if not shared.delay:
        return beta, logs
    place = len(shared.model.names)

    def whole(values: FloatArray) -> FloatArray:
        values = values.copy()
        values[place] += base
        return values

    return whole(beta), [replace(log, c0=whole(log.c0)) for log in logs]


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


def normal_equations(
    source: Source,
    settings: WeakSettings,
    at: FloatArray | None = None,
    known: dict[Hashable, Known] | None = None,
) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window.

    A log without a stretch of four windows gets windows of a quarter of its longest stretch. Terms
    that are not linear are linearised at the coefficients `at` (q,). Of a log that is looked at
    with several models, at one hold of the torque, `known` keeps the moments by piece.
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

        for piece, windows, _ in overlapping(source(), settings, window):
            longest = max(longest, _seconds(piece))
            if not piece.continues or _count(rows) >= PIECE_SAMPLES:
                add_up()
            spacing = windows.step * windows.dt
            X = windows.equations(settings.model, piece, False, c)
            residual = X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1])
            rows.append(np.concatenate([residual, X[:, -1]]))
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
            piece = _prefixed(before, piece, windows.overlap + left_over)
        left_over = (len(piece) - 2 * windows.margin) % windows.step
        before = piece
        if settings.shift.held:
            piece = replace(piece, tau=held_torque(piece.tau))
        yield piece, windows, fresh


def _prefixed(before: Segment, piece: Segment, overlap: int) -> Segment:
    """The piece with the last `overlap` samples of the one before."""
    first = max(len(before) - overlap, 0)

    def joined(old: FloatArray, new: FloatArray) -> FloatArray:
        return np.concatenate([old[:, first:], new], axis=1)

    omega = reference = None
    if before.omega is not None and piece.omega is not None:
        omega = joined(before.omega, piece.omega)
    if before.reference is not None and piece.reference is not None:
        reference = joined(before.reference, piece.reference)
    return replace(
        piece,
        start=piece.start - (len(before) - first) * piece.dt,
        theta=joined(before.theta, piece.theta),
        tau=joined(before.tau, piece.tau),
        omega=omega,
        reference=reference,
    )


def grams(X: FloatArray, rows: int) -> FloatArray:
    """Gram matrices (B, 2, m, m) of X (2, m, R), by stretches of `rows` rows."""
    size, count = X.shape[1:]
    stretches = ceil(count / rows)
    padded = np.zeros((2, size, stretches * rows))
    padded[:, :, :count] = X
    parts = padded.reshape(2, size, stretches, rows).transpose(2, 0, 1, 3)
    return parts @ parts.swapaxes(-1, -2)


def solve(
    normals: Sequence[Normal], loaded: bool = False
) -> tuple[FloatArray, list[LogInformation]]:
    """Coefficients (q,) of logs that share them, and each log's likelihood there.

    The rows of a joint weigh by its own residual, log by log.
    """
    whole = np.stack([normal.gram.sum(axis=0) for normal in normals])
    rows = np.stack([normal.rows for normal in normals])
    weights: FloatArray = np.ones((len(normals), 2))
    for _ in range(_REWEIGHTINGS):
        total = np.tensordot(weights, whole, 2)
        c = scaled_pinv(total[:-1, :-1]) @ total[:-1, -1]
        weights = row_weights(whole, np.append(-c, 1.0), rows)
    logs = []
    for normal, w in zip(normals, weights, strict=True):
        # Overlapping rows repeat each other: a window's worth of rows counts as two.
        gram = np.einsum("a,baxy->bxy", w * (2.0 / OVERLAP), normal.gram)
        S = gram[:, :-1, :-1]
        logs.append(LogInformation(loaded, c, S, gram[:, :-1, -1] - S @ c))
    return c, logs


def first_payload(shared: Shared, arm: FloatArray, loaded: LogInformation) -> FloatArray:
    """Shared parameters (Q,): the payload that fits the loaded logs best for a given arm (q,).

    Masses are tried in turn, each with the link lengths that follow from k2 and k4 of both arms
    (Table 2). `loaded` is the sum over the loaded logs, linearised at the loaded arm's own
    coefficients.
    """
    best: FloatArray | None = None
    best_value = -np.inf
    # A prior far tighter than the loaded logs holds the arm.
    hold = Prior.of(shared.log_names, arm, scaled_pinv(loaded.total[0]) * 1e-4)
    for mass in _FIRST_MASSES:
        change = loaded.c0 - arm
        guess = {
            "m_p": mass,
            "l1": _length_of(shared, change, mass, K4),
            "l2": _length_of(shared, change, mass, K2),
        }
        start = np.append(arm, [guess[name] for name in shared.names[arm.size :]])
        beta, _, value = combine(shared, [loaded], start, hold)
        if value > best_value and np.all(beta[arm.size :] > 0):
            best, best_value = beta, value
    if best is None:
        return start
    return best


def _length_of(shared: Shared, change: FloatArray, mass: float, name: str) -> float:
    """Length in m from the change of the gravity constant `name` by `mass` kg, else a default."""
    if name not in shared.log_names:
        return _FIRST_LENGTH
    length = float(change[shared.log_names.index(name)]) / (mass * shared.model.gravity)
    if not 0.01 < length < 10:
        return _FIRST_LENGTH
    return length
