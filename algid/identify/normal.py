"""Normal equations of the weak estimator, in one pass over a log.

They are kept by stretch and by joint, so that the joints' weights, the residual's size and the error bars follow
from them without a second pass. See `algid.identify.moments`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.identify.blocks import BlockSums
from algid.identify.information import LogInformation, scaled_pinv
from algid.identify.model import Model
from algid.identify.moments import OVERLAP, Windows
from algid.sampling import Segment, pieces

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


def normal_equations(source: Source, settings: WeakSettings) -> Normal | None:
    """Normal equations of one log; None where it is too short for a window.

    A log without a stretch of four windows gets windows of a quarter of its longest stretch.
    """
    found, longest = _pass(source(), settings, settings.window)
    if longest < 4 * settings.window and longest > 0:
        found, _ = _pass(source(), settings, longest / 4)
    return found


def _pass(segments: Iterable[Segment], settings: WeakSettings, window: float) -> tuple[Normal | None, float]:
    """Normal equations with windows of a given length, and the longest piece of the log in s."""
    sums = BlockSums()
    samples = rows = 0
    longest = dt = 0.0
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for piece, windows, fresh in _overlapping(segments, settings, window):
        dt = piece.dt
        longest = max(longest, len(piece) * dt if len(piece) >= _SHORTEST else 0.0)
        samples += fresh
        low = np.minimum(low, piece.theta.min(axis=1))
        high = np.maximum(high, piece.theta.max(axis=1))
        X = windows.equations(settings.model, piece, settings.estimate_delay)
        rows += X.shape[2]
        if X.shape[2]:
            sums.add(_grams(X))
    return (Normal(sums.values(), dt, samples, rows, high - low) if rows else None), longest


def _overlapping(
    segments: Iterable[Segment], settings: WeakSettings, window: float
) -> Iterator[tuple[Segment, Windows, int]]:
    """Pieces that share the samples a window needs with the piece before, their windows and fresh samples."""
    before: Segment | None = None
    windows: Windows | None = None
    left_over = 0
    for piece in pieces(segments, PIECE_SAMPLES):
        if windows is None:
            windows = _windows(piece.dt, settings, window)
        fresh = len(piece)
        if piece.continues and before is not None:
            piece = _prefixed(before, piece, windows.overlap + left_over)
        left_over = (len(piece) - 2 * windows.margin) % windows.step
        before = piece
        yield piece, windows, fresh


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


def _grams(X: FloatArray) -> FloatArray:
    """Gram matrices (B, 2, q + 1, q + 1) of X (2, q + 1, R), by stretches of `OVERLAP` rows."""
    size, rows = X.shape[1:]
    stretches = -(-rows // OVERLAP)
    padded = np.zeros((2, size, stretches * OVERLAP))
    padded[:, :, :rows] = X
    parts = padded.reshape(2, size, stretches, OVERLAP).transpose(2, 0, 1, 3)
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
        weights = [_weights(normal, c) for normal in normals]
    return c, [_information(n, c, w, loaded) for n, w in zip(normals, weights, strict=True)]


def _weights(normal: Normal, c: FloatArray) -> FloatArray:
    """Inverse residual variance (2,) of a row of each joint."""
    v = np.append(-c, 1.0)
    gram = normal.gram.sum(axis=0)
    squares = np.einsum("x,axy,y->a", v, gram, v)
    floor = 1e-24 * gram[:, -1, -1] + 1e-300
    return normal.rows / np.maximum(squares, floor)


def _information(normal: Normal, c: FloatArray, weights: FloatArray, loaded: bool) -> LogInformation:
    # Overlapping rows repeat each other: a window's worth of rows counts as two.
    gram = np.einsum("a,baxy->bxy", weights * (2.0 / OVERLAP), normal.gram)
    return LogInformation(loaded, c, gram[:, :-1, :-1], gram[:, :-1, -1] - gram[:, :-1, :-1] @ c)
