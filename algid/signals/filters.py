"""Filters: zero-phase ones by matrix products, recursive ones by banded substitution; no loop over samples.

The differentiator is the ideal one below its bandwidth, cut by a Kaiser window (Oppenheim & Schafer, Discrete-
Time Signal Processing, sec. 7.5), and exact for angles that are polynomials of sixth degree in time.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from algid.arm import FloatArray

_KAISER_BETA = 7.0  # stop band at -70 dB
_PERIODS = 2.5  # half length of a kernel in periods of its bandwidth
_LEAST = 3  # half length that three odd moments ask for, however slowly a log was sampled
_ROWS = 32  # outputs a matrix product makes at once


def half_length(dt: float, bandwidth: float) -> int:
    """Samples that a kernel of `bandwidth` Hz reaches to either side."""
    return max(_LEAST, round(_PERIODS / (bandwidth * dt)))


@lru_cache(maxsize=16)
def differentiator(dt: float, bandwidth: float) -> FloatArray:
    """Kernel (2 M + 1,) in s^-1 whose correlation with an angle is its velocity below `bandwidth` Hz."""
    n, taper = _support(dt, bandwidth)
    x = 2 * bandwidth * dt * n
    safe = np.where(n == 0, 1, n)
    slope = np.where(n == 0, 0.0, (np.sinc(x) - np.cos(np.pi * x)) / safe)
    kernel = slope * taper
    kernel /= kernel @ n * dt
    # The window leaves a ripple of some tenths of a percent; the odd moments take it out where motion lives.
    s = n / n[-1]
    odd = np.stack([s, s**3, s**5])
    wanted = np.array([1 / (n[-1] * dt), 0.0, 0.0])
    return _shared(kernel + np.linalg.solve((odd * taper) @ odd.T, wanted - odd @ kernel) @ (odd * taper))


@lru_cache(maxsize=16)
def smoother(dt: float, bandwidth: float) -> FloatArray:
    """Kernel (2 M + 1,) whose correlation with a signal passes what lies below `bandwidth` Hz."""
    n, taper = _support(dt, bandwidth)
    kernel = np.sinc(2 * bandwidth * dt * n) * taper
    return _shared(kernel / kernel.sum())


def _shared(kernel: FloatArray) -> FloatArray:
    """The kernel, now read-only: it is kept for the next piece of log."""
    kernel.flags.writeable = False
    return kernel


def _support(dt: float, bandwidth: float) -> tuple[FloatArray, FloatArray]:
    reach = half_length(dt, bandwidth)
    n = np.arange(-reach, reach + 1, dtype=np.float64)
    return n, np.kaiser(n.size, _KAISER_BETA)


def correlate(x: FloatArray, kernel: FloatArray, step: int = 1) -> FloatArray:
    """Correlation of each row of x (m, N) with a kernel (K,), where they overlap entirely.

    Returns
    -------
    (m, (N - K) // step + 1): every `step`-th value of it
    """
    taps = kernel.size
    wanted = (x.shape[1] - taps) // step + 1
    rows = max(4, _ROWS // step)
    blocks = -(-wanted // rows)
    width = (rows - 1) * step + taps
    padded = np.zeros((x.shape[0], (blocks - 1) * rows * step + width))
    used = min(x.shape[1], padded.shape[1])
    padded[:, :used] = x[:, :used]
    windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=1)[:, :: rows * step]
    toeplitz = np.zeros((width, rows))
    for column in range(rows):
        toeplitz[column * step : column * step + taps, column] = kernel
    return (np.ascontiguousarray(windows) @ toeplitz).reshape(x.shape[0], -1)[:, :wanted]


def smoothed(x: FloatArray, dt: float, bandwidth: float) -> FloatArray:
    """Signals (m, N) without what lies above `bandwidth` Hz; both ends continue by point reflection."""
    kernel = smoother(dt, bandwidth)
    reach = min(kernel.size // 2, x.shape[1] - 1)
    kernel = kernel[kernel.size // 2 - reach : kernel.size // 2 + reach + 1]
    before = 2 * x[:, :1] - x[:, reach:0:-1]
    after = 2 * x[:, -1:] - x[:, -2 : -reach - 2 : -1]
    return correlate(np.concatenate([before, x, after], axis=1), kernel / kernel.sum())


def butterworth(x: FloatArray, dt: float, cutoff: float, order: int) -> FloatArray:
    """Signals (m, N) after a digital Butterworth filter of `order` and `cutoff` Hz, forwards and backwards.

    Its response |H|² = |1 + z|^2n / (|1 + z|^2n + γ |1 - z|^2n), γ = tan(π cutoff dt)^-2n, is that of the minimum
    of |S (y - x)|² + γ |D y|² with the n-fold sum S and difference D of neighbours: one banded system, whose ends
    are free. N must be above n.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the system is not positive definite in double precision: the cutoff is too low for the order.
    """
    from scipy.linalg import lapack

    wanted = x.shape[1] - order
    sums = np.array([comb(order, k) for k in range(order + 1)], dtype=np.float64)
    differences = sums * (-1.0) ** np.arange(order + 1)
    gamma = float(np.tan(np.pi * cutoff * dt)) ** (-2 * order)
    band = np.zeros((order + 1, x.shape[1]))
    for b in range(order + 1):
        for a in range(b, order + 1):
            band[a - b, b : b + wanted] += sums[a] * sums[b] + gamma * differences[a] * differences[b]
    summed = sum(weight * x[:, k : k + wanted] for k, weight in enumerate(sums))
    rhs = np.zeros_like(x)
    for k, weight in enumerate(sums):
        rhs[:, k : k + wanted] += weight * summed
    _, y, info = lapack.dpbsv(band, rhs.T, lower=1, overwrite_ab=1)
    if info != 0:
        raise np.linalg.LinAlgError(f"the filter's system is not positive definite (row {info})")
    return np.ascontiguousarray(y.T)


def recursion(
    numerator: FloatArray, denominator: FloatArray, x: FloatArray, state: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """A signal x (n,) after the filter Σ b_k z^-k / Σ a_k z^-k, b and a (m + 1,), a_0 = 1, and the state it leaves.

    The recursion Σ a_k y[i - k] = Σ b_k x[i - k] is one triangular banded system. `state` (m,) is what the samples
    before add to its right side; zeros are a filter at rest. (`scipy.signal.lfilter` does the same; its package takes
    a second to import, which a short log does not take to identify.)
    """
    from scipy.linalg import lapack

    driven = np.convolve(numerator, x)
    driven[: state.size] += state
    band = np.tile(denominator, (x.size, 1)).T
    y, _ = lapack.dtbtrs(band, driven[: x.size], uplo="L", diag="U")
    settled = np.convolve(denominator, y[-state.size :])
    return y, driven[x.size :] - settled[-state.size :]
