"""Normal equations of the weak estimator, in one pass over a log.

They are kept by stretch and by joint, so that the joints' weights, the residual's size and the error bars follow
from them without a second pass. See `algid.estimators.modulating_functions`.

A first guess of payload and link lengths from the constants of the bare and of the loaded arm (Table 2).

The weak estimator: weighted least squares on the momentum form.

See `algid.estimators.modulating_functions` for the equations and below for the one pass over each log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import FEWEST_LOGS, BlockSums, LogInformation, Prior, combine, scaled_pinv
from algid.estimators.fit import Fit, conclude
from algid.estimators.innovations import LAGS, ResidualSums, pooled, residual_sums
from algid.estimators.modulating_functions import OVERLAP, Windows, row_weights
from algid.estimators.parametrisation import Shared
from algid.model import Model
from algid.signals.differences import held_torque
from algid.signals.segments import Segment, pieces

Source = Callable[[], Iterable[Segment]]
PIECE_SAMPLES = 16384
_SHORTEST = 64  # samples: shorter pieces hold no window
_REWEIGHTINGS = 4


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
    hold : "foh" or "zoh"
        Whether the torque moved evenly from sample to sample, or was held from each sample to the next.
    delay : float, s
        After how long a logged torque acts; where the estimate of it starts with `estimate_delay`.
    estimate_delay : bool
    """

    model: Model = field(default_factory=Model)
    window: float = 0.4
    bandwidth: float | None = 40.0
    hold: Literal["foh", "zoh"] = "foh"
    delay: float = 0.0
    estimate_delay: bool = False


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of one log: Gram matrices (B, 2, q + 1, q + 1) by stretch and joint, the torque last.

    `samples` counts the log's samples, `rows` the windows, `dt` is in s, and `moved` (2,) is the spread of each
    joint's angle in rad.
    """

    gram: FloatArray
    dt: float
    samples: int
    rows: int
    moved: FloatArray


def normal_equations(source: Source, settings: WeakSettings, at: FloatArray | None = None) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window.

    A log without a stretch of four windows gets windows of a quarter of its longest stretch. Terms that are not
    linear are linearised at the coefficients `at` (q,).
    """
    found, longest = _pass(source(), settings, settings.window, at)
    if longest < 4 * settings.window and longest > 0:
        found, _ = _pass(source(), settings, longest / 4, at)
    return found


def _pass(
    segments: Iterable[Segment], settings: WeakSettings, window: float, at: FloatArray | None
) -> tuple[Normal | None, float]:
    """Normal equations with windows of a given length, and the longest piece of the log in s."""
    sums = BlockSums()
    samples = rows = 0
    longest = dt = 0.0
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for piece, windows, fresh in overlapping(segments, settings, window):
        dt = piece.dt
        longest = max(longest, len(piece) * dt if len(piece) >= _SHORTEST else 0.0)
        samples += fresh
        low = np.minimum(low, piece.theta.min(axis=1))
        high = np.maximum(high, piece.theta.max(axis=1))
        X = windows.equations(settings.model, piece, settings.estimate_delay, at)
        rows += X.shape[2]
        if X.shape[2]:
            sums.add(grams(X, OVERLAP))
    return (Normal(sums.values(), dt, samples, rows, high - low) if rows else None), longest


def residuals(source: Source, settings: WeakSettings, c: FloatArray) -> ResidualSums | None:
    """Sums over the windows' residual y − Xᵀc at coefficients `c` (q,) of one log, the torque's moments beside it.

    The windows are those of `normal_equations`; None where the log is too short for one.
    """
    gathered, longest = _residuals(source(), settings, settings.window, c)
    if longest < 4 * settings.window and longest > 0:
        gathered, _ = _residuals(source(), settings, longest / 4, c)
    return pooled(gathered)


def _residuals(
    segments: Iterable[Segment], settings: WeakSettings, window: float, c: FloatArray
) -> tuple[list[ResidualSums], float]:
    found: list[ResidualSums] = []
    rows: list[FloatArray] = []
    longest = spacing = 0.0
    for piece, windows, _ in overlapping(segments, settings, window):
        longest = max(longest, len(piece) * piece.dt if len(piece) >= _SHORTEST else 0.0)
        if not piece.continues or sum(part.shape[1] for part in rows) >= PIECE_SAMPLES:
            found, rows = _summed(found, rows, spacing), []
        spacing = windows.step * windows.dt
        X = windows.equations(settings.model, piece, False, c)
        rows.append(np.concatenate([X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1]), X[:, -1]]))
    return _summed(found, rows, spacing), longest


def _summed(found: list[ResidualSums], rows: list[FloatArray], spacing: float) -> list[ResidualSums]:
    together = np.concatenate(rows, axis=1) if rows else np.empty((4, 0))
    if together.shape[1] < 2 * OVERLAP:
        return found
    return [*found, residual_sums(together, spacing, OVERLAP, LAGS * OVERLAP // 2)]


def overlapping(
    segments: Iterable[Segment], settings: WeakSettings, window: float | None = None
) -> Iterator[tuple[Segment, Windows, int]]:
    """Pieces that share the samples a window needs with the piece before, their windows and fresh samples."""
    before: Segment | None = None
    windows: Windows | None = None
    left_over = 0
    for piece in pieces(segments, PIECE_SAMPLES):
        if windows is None:
            windows = _windows(piece.dt, settings, settings.window if window is None else window)
        fresh = len(piece)
        if piece.continues and before is not None:
            piece = _prefixed(before, piece, windows.overlap + left_over)
        left_over = (len(piece) - 2 * windows.margin) % windows.step
        before = piece
        yield replace(piece, tau=held_torque(piece.tau)) if settings.hold == "zoh" else piece, windows, fresh


def _windows(dt: float, settings: WeakSettings, window: float) -> Windows:
    """Windows for samples `dt` s apart, with a bandwidth that the rate and the window's length leave room for."""
    bandwidth = settings.bandwidth
    if bandwidth is not None:
        bandwidth = max(min(bandwidth, 0.2 / dt), 6.0 / window)
    shift = settings.delay + (0.5 * dt if settings.hold == "zoh" else 0.0)
    return Windows(dt, window, shift, bandwidth)


def _prefixed(before: Segment, piece: Segment, overlap: int) -> Segment:
    overlap = min(overlap, len(before))
    omega = None
    if before.omega is not None and piece.omega is not None:
        omega = np.concatenate([before.omega[:, len(before) - overlap :], piece.omega], axis=1)
    return replace(
        piece,
        start=piece.start - overlap * piece.dt,
        theta=np.concatenate([before.theta[:, len(before) - overlap :], piece.theta], axis=1),
        tau=np.concatenate([before.tau[:, len(before) - overlap :], piece.tau], axis=1),
        omega=omega,
    )


def grams(X: FloatArray, rows: int) -> FloatArray:
    """Gram matrices (B, 2, m, m) of X (2, m, R), by stretches of `rows` rows."""
    size, count = X.shape[1:]
    stretches = -(-count // rows)
    padded = np.zeros((2, size, stretches * rows))
    padded[:, :, :count] = X
    parts = padded.reshape(2, size, stretches, rows).transpose(2, 0, 1, 3)
    return parts @ parts.swapaxes(-1, -2)


def solve(normals: Sequence[Normal], loaded: bool = False) -> tuple[FloatArray, list[LogInformation]]:
    """Coefficients (q,) of logs that share them, and each log's likelihood there.

    The rows of a joint weigh by its own residual, log by log.
    """
    weights: list[FloatArray] = [np.ones(2) for _ in normals]
    c: FloatArray = np.zeros(normals[0].gram.shape[-1] - 1)
    for _ in range(_REWEIGHTINGS):
        total = np.sum(
            [np.einsum("a,axy->xy", w, n.gram.sum(axis=0)) for w, n in zip(weights, normals, strict=True)], axis=0
        )
        c = scaled_pinv(total[:-1, :-1]) @ total[:-1, -1]
        weights = [row_weights(n.gram.sum(axis=0), np.append(-c, 1.0), n.rows) for n in normals]
    return c, [_information(n, c, w, loaded) for n, w in zip(normals, weights, strict=True)]


def _information(normal: Normal, c: FloatArray, weights: FloatArray, loaded: bool) -> LogInformation:
    # Overlapping rows repeat each other: a window's worth of rows counts as two.
    gram = np.einsum("a,baxy->bxy", weights * (2.0 / OVERLAP), normal.gram)
    return LogInformation(loaded, c, gram[:, :-1, :-1], gram[:, :-1, -1] - gram[:, :-1, :-1] @ c)


_FIRST_MASSES = (0.02, 0.1, 0.5, 2.0, 10.0)  # kg
_FIRST_LENGTH = 0.3  # m


def first_payload(shared: Shared, bare: FloatArray, loaded: LogInformation) -> FloatArray:
    """Shared parameters (Q,) with the payload that fits the loaded log best while the bare arm stays `bare` (q,).

    `loaded` is the sum over the loaded logs, linearised at the loaded arm's own coefficients.
    """
    best: FloatArray | None = None
    best_value = -np.inf
    start = bare
    for mass in _FIRST_MASSES:
        guess = {
            "m_p": mass,
            "l1": _length(shared, loaded, bare, mass, "k4"),
            "l2": _length(shared, loaded, bare, mass, "k2"),
        }
        start = np.concatenate([bare, [guess[name] for name in shared.names[len(bare) :]]])
        beta, value = _fitted(shared, start, loaded)
        if value > best_value and np.all(beta[len(bare) :] > 0):
            best, best_value = beta, value
    return start if best is None else best


def _length(shared: Shared, loaded: LogInformation, bare: FloatArray, mass: float, name: str) -> float:
    """Length that the change of a gravity constant tells for a given mass."""
    if name not in shared.log_names:
        return _FIRST_LENGTH
    place = shared.log_names.index(name)
    length = (loaded.c0[place] - bare[place]) / (mass * shared.model.gravity)
    return float(length) if 0.01 < length < 10 else _FIRST_LENGTH


def _fitted(shared: Shared, start: FloatArray, loaded: LogInformation) -> tuple[FloatArray, float]:
    count = len(shared.log_names)
    S, _ = loaded.total
    # The bare arm is held by a prior far tighter than the loaded log.
    hold = Prior.of(shared.log_names, start[:count], scaled_pinv(S) * 1e-4)
    beta, _, value = combine(shared, [loaded], start, hold)
    return beta, value


__all__ = ["Source", "WeakSettings", "fit"]

_PASSES = 8
_DELAY_SETTLED = 0.02  # samples
_SETTLED = 1e-4  # of e1, e2, gain2, zero1, zero2: 1 or rad
_ITERATED = ("e1", "e2", "gain2", "zero1", "zero2")


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
        Each gives a fresh iterable of `Segment`, the stretches of one log in time. It is called once, and a few
        times more where a delay is estimated or the model is not linear.
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
    shared = Shared(settings.model, settings.estimate_delay, bool(loaded), dict(lengths or {}))
    at: tuple[FloatArray | None, FloatArray | None] = (None, None)
    for _ in range(_PASSES):
        bare = _normals(unloaded, settings, at[0])
        burdened = _normals(loaded, settings, at[1])
        beta, logs = _start(shared, bare, burdened, prior)
        base, change = settings.delay, 0.0
        if shared.delay:
            change = float(beta[len(settings.model.names)])
            beta, logs = _from(shared, beta, logs, base)
            settings = replace(settings, delay=base + change)
        before, at = at, _linearisation(shared, beta, logs)
        if abs(change) < _DELAY_SETTLED * max(normal.dt for normal in bare + burdened) and _settled(shared, before, at):
            break
    moved = np.max([normal.moved for normal in bare + burdened], axis=0)
    without = _left_out(shared, bare, burdened, prior, base, beta)
    return conclude("weak", shared, logs, beta, moved, prior, coloured=True, without=without)


def _left_out(
    shared: Shared,
    bare: list[Normal],
    burdened: list[Normal],
    prior: Prior | None,
    base: float,
    beta: FloatArray,
) -> FloatArray | None:
    """Estimates (n, Q) without each log, every other one weighed anew; None where no error bar needs them.

    `base` is the delay, in s, from which the passes tell a change.
    """
    if len(bare) + len(burdened) < FEWEST_LOGS:
        return None
    found = []
    for place in range(len(bare) + len(burdened)):
        rest = [n for number, n in enumerate(bare) if number != place]
        rest_loaded = [n for number, n in enumerate(burdened) if len(bare) + number != place]
        if (bare and not rest) or (burdened and not rest_loaded):
            found.append(beta)  # a kind of which there is no other log
            continue
        start, others = _from(shared, *_start(shared, rest, rest_loaded, prior), base)
        found.append(combine(shared, others, start, prior)[0])
    return np.array(found)


def _linearisation(
    shared: Shared, beta: FloatArray, logs: Sequence[LogInformation]
) -> tuple[FloatArray | None, FloatArray | None]:
    """Coefficients of the model's columns at which the next pass linearises unloaded and loaded logs."""
    if shared.model.linear:
        return None, None
    count = len(shared.model.names)
    found = [next((log.c0[:count] for log in logs if log.loaded is loaded), None) for loaded in (False, True)]
    return (beta[:count] if found[0] is None else found[0]), found[1]


def _settled(
    shared: Shared,
    before: tuple[FloatArray | None, FloatArray | None],
    after: tuple[FloatArray | None, FloatArray | None],
) -> bool:
    if shared.model.linear:
        return True
    places = [shared.model.names.index(name) for name in _ITERATED if name in shared.model.names]
    return all(
        new is None or (old is not None and bool(np.all(np.abs(new - old)[places] < _SETTLED)))
        for old, new in zip(before, after, strict=True)
    )


def _normals(sources: Sequence[Source], settings: WeakSettings, at: FloatArray | None) -> list[Normal]:
    found = [normal_equations(source, settings, at) for source in sources]
    return [normal for normal in found if normal is not None]


def _start(
    shared: Shared, bare: list[Normal], burdened: list[Normal], prior: Prior | None
) -> tuple[FloatArray, list[LogInformation]]:
    """Shared parameters from which `conclude` starts, and each log's likelihood."""
    if not bare and (prior is None or not burdened):
        raise ValueError("no unloaded log is long enough: expected at least a second of samples without a gap")
    logs: list[LogInformation] = []
    arm: FloatArray = np.zeros(len(shared.log_names))
    if bare:
        arm, logs = solve(bare)
    elif prior is not None:
        arm[[shared.log_names.index(name) for name in prior.names]] = prior.mean
    if not shared.payload:
        return arm, logs
    if not burdened:
        raise ValueError("no loaded log is long enough: expected at least a second of samples without a gap")
    _, under_load = solve(burdened, loaded=True)
    together = LogInformation(True, under_load[0].c0, *_stacked(under_load))
    return first_payload(shared, arm, together), logs + under_load


def _stacked(logs: Sequence[LogInformation]) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([log.S for log in logs]), np.concatenate([log.g for log in logs])


def _from(
    shared: Shared, beta: FloatArray, logs: Sequence[LogInformation], base: float
) -> tuple[FloatArray, list[LogInformation]]:
    """Estimate and likelihoods in the whole delay, where they were in the change from `base`."""
    if not shared.delay:
        return beta, list(logs)
    place = len(shared.model.names)

    def whole(values: FloatArray) -> FloatArray:
        return np.where(np.arange(values.size) == place, values + base, values)

    return whole(beta), [replace(log, c0=whole(log.c0)) for log in logs]
