"""Filters: zero-phase ones by correlation, recursive ones by banded substitution.

No loop over samples.

The differentiator is the ideal one below its bandwidth, cut by a Kaiser window (Oppenheim &
Schafer, Discrete- Time Signal Processing, sec. 7.5), and exact for angles that are polynomials of
sixth degree in time.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from algid.arm import FloatArray, read_only
from algid.base.compiled import lapack

_KAISER_BETA = 7.0  # stop band at -70 dB
_PERIODS = 2.5  # half length of a kernel in periods of its bandwidth
_LEAST = 3  # half length that three odd moments ask for, however slowly a log was sampled
_SETTLED = 3.0  # periods of a Butterworth filter's cutoff, after which it forgets to some 1e-4


def half_length(dt: float, bandwidth: float) -> int:
    """Samples that a kernel of `bandwidth` Hz reaches to either side."""
    return max(_LEAST, round(_PERIODS / (bandwidth * dt)))


@lru_cache(maxsize=16)
def differentiator(dt: float, bandwidth: float) -> FloatArray:
    """Kernel (2 M + 1,) in s^-1 that correlates an angle to its velocity below `bandwidth` Hz."""
    n, taper = _support(dt, bandwidth)
    x = 2 * bandwidth * dt * n
    safe = np.where(n == 0, 1, n)
    slope = np.where(n == 0, 0.0, (np.sinc(x) - np.cos(np.pi * x)) / safe)
    kernel = slope * taper
    kernel /= kernel @ n * dt
    # The window leaves a ripple of some tenths of a percent; the odd moments take it out where
    # motion lives.
    s = n / n[-1]
    odd = np.stack([s, s**3, s**5])
    wanted = np.array([1 / (n[-1] * dt), 0.0, 0.0])
    return read_only(
        kernel + np.linalg.solve((odd * taper) @ odd.T, wanted - odd @ kernel) @ (odd * taper)
    )


@lru_cache(maxsize=16)
def smoother(dt: float, bandwidth: float) -> FloatArray:
    """Kernel (2 M + 1,) whose correlation with a signal passes what lies below `bandwidth` Hz."""
    n, taper = _support(dt, bandwidth)
    kernel = np.sinc(2 * bandwidth * dt * n) * taper
    return read_only(kernel / kernel.sum())


def _support(dt: float, bandwidth: float) -> tuple[FloatArray, FloatArray]:
    reach = half_length(dt, bandwidth)
    n = np.arange(-reach, reach + 1, dtype=np.float64)
    return n, np.kaiser(n.size, _KAISER_BETA)


def correlate(x: FloatArray, kernel: FloatArray, step: int = 1) -> FloatArray:
    """Correlation of signals x (..., N) with a kernel (K,), where they overlap entirely.

    Returns
    -------
    (..., (N - K) // step + 1): every `step`-th value of it, none where N is below K
    """
    if x.shape[-1] < kernel.size:
        return x[..., :0]
    return np.apply_along_axis(np.correlate, -1, x, kernel, "valid")[..., ::step]


def smoothed(x: FloatArray, dt: float, bandwidth: float) -> FloatArray:
    """Signals (m, N) without what lies above `bandwidth` Hz.

    Both ends continue by point reflection.
    """
    kernel = smoother(dt, bandwidth)
    reach = min(kernel.size // 2, x.shape[1] - 1)
    kernel = kernel[kernel.size // 2 - reach : kernel.size // 2 + reach + 1]
    return correlate(reflected(x, reach), kernel / kernel.sum())


def butterworth(x: FloatArray, dt: float, cutoff: float) -> FloatArray:
    """Signals (m, N) after a zero-phase Butterworth filter of third order: forwards, then back.

    `cutoff` is in Hz.

    The filter is the bilinear transform of the analogue one (Oppenheim & Schafer, Discrete-Time
    Signal Processing, sec. 6.3 and 7.1). Both ends continue by point reflection, over `_SETTLED`
    periods of the cutoff. It starts at rest around the first sample: constants are kept exactly. N
    must be above 1.
    """
    warped = np.tan(np.pi * cutoff * dt)
    scale = 1 + warped + warped**2
    numerator = warped**3 / (1 + warped) / scale * np.array([1.0, 3.0, 3.0, 1.0])
    denominator = np.convolve(
        [1.0, (warped - 1) / (1 + warped)],
        [1.0, 2 * (warped**2 - 1) / scale, (1 - warped + warped**2) / scale],
    )
    reach = min(math.ceil(_SETTLED / (cutoff * dt)), x.shape[1] - 1)
    y = reflected(x, reach)
    for _ in range(2):  # there, and back again
        start = y[:, :1].copy()
        y = recursion(numerator, denominator, y - start, np.zeros((len(y), 3)))[0] + start
        y = y[:, ::-1]
    return np.ascontiguousarray(y[:, reach : reach + x.shape[1]])


def reflected(x: FloatArray, reach: int) -> FloatArray:
    """Signals (..., N + 2 reach), continued by point reflection about first and last samples."""
    before = 2 * x[..., :1] - x[..., reach:0:-1]
    after = 2 * x[..., -1:] - x[..., -2 : -reach - 2 : -1]
    return np.concatenate([before, x, after], axis=-1)


def recursion(
    numerator: FloatArray, denominator: FloatArray, x: FloatArray, state: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signals x (m, n) after the filter Σ b_k z^-k / Σ a_k z^-k, and the states after it.

    b and a are (order + 1,), and a_0 = 1.

    The recursion Σ a_k y[i - k] = Σ b_k x[i - k] is one triangular banded system. `state` (m,
    order) is what the samples before add to its right side; zeros are a filter at rest.
    (`scipy.signal.lfilter` does the same; its package takes a second to import, which a short log
    does not take to identify.)
    """
    order, n = state.shape[1], x.shape[1]
    driven = np.stack([np.convolve(signal, numerator) for signal in x])
    driven[:, :order] += state
    # of an upper band transposed, which LAPACK solves by products of rows: a third faster
    band = np.empty((n, order + 1))
    band[:] = denominator[::-1]
    y, _ = lapack.dtbtrs(band.T, driven[:, :n].T, uplo="U", trans="T", diag="U")
    settled = np.stack([np.convolve(denominator, one[-order:])[-order:] for one in y.T])
    return y.T, driven[:, n:] - settled
