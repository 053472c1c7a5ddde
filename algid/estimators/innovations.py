"""Spectrum and autocorrelation of a residual, and the scatter that white noise would have.

Sums over pieces of any length add up, so that a log is gone over in bounded memory. Each piece
gives its whole periodogram (Hann's window), added up in narrow bins of equal ratio, and its lag
products. Rows that overlap, as windows do, are correlated however white the noise: `stride` of
them apart they are not.

======  =================================================  ============  ==============
symbol  name                                               shape         unit
======  =================================================  ============  ==============
w       residual, and signals to compare its spectrum to   (s, n)        u
P       periodogram, 1 for white noise of unit variance    (s, n // 2)   u²
f       frequency                                          (F,)          cycles a row
r       autocorrelation                                    (2, L)        1
======  =================================================  ============  ==============

The error bars of the likelihood suppose innovations that are white and Gaussian: Ljung & Box's
test on those of each joint, as they are and summed over 16 and 64 samples, so that slow colour is
seen as well as fast. The smallest p-value counts three times over (Bonferroni), and a correlation
too faint to matter counts as none. Colour is no lack of the model: it decides what error bars rest
on. Tails decide nothing, as least squares has the same covariance with any.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from algid.arm import FloatArray, keep_arrays
from algid.base.compiled import chi2_exceeded, chi2_tail
from algid.base.significance import NORMAL, level

LAGS = 40
SCALES = (1, 16, 64)
_LAGS = 10
_FAINT = 0.02  # root mean square of the correlations that does not matter
ALIKE = 0.01  # relative difference of two periods that counts as none
_BINS = 112
_EDGES = np.geomspace(2.0**-14, 0.5, _BINS + 1)  # cycles a row
_FIRST = 2  # lines of a periodogram below that the mean leaks into
_NEIGHBOURS = (4 / 9, 1 / 36)  # squared correlation of Hann's lines one and two apart (Harris 1978)
_FREEDOM = 12.0
"""Of a point of the spectrum at least: its band then is a factor of two or so either way."""


@dataclass(frozen=True, eq=False)
class ResidualSums:
    """Sums over a residual whose rows are `dt` s apart, and over the signals beside it.

    Parameters
    ----------
    dt : float, s
    stride : rows after which white noise leaves nothing in common
    power : (s, bins), Σ P by bin
    lines, scatter : (bins,), lines in each bin, and their sum's variance for unit white noise
    products : (3, 2, lags + 1), Σ w_i w_(i+lag) of the rows' sums over each of `SCALES`
    pairs, counts : (lags + 1,) and (3,), pairs of rows by lag, and sums over each of `SCALES`
    """

    dt: float
    stride: int
    power: FloatArray
    lines: FloatArray
    scatter: FloatArray
    products: FloatArray
    pairs: FloatArray
    counts: FloatArray

    def __post_init__(self) -> None:
        keep_arrays(self)

    def __add__(self, other: ResidualSums) -> ResidualSums:
        added = {
            one.name: getattr(self, one.name) + getattr(other, one.name) for one in fields(self)
        }
        return ResidualSums(**added | {"dt": self.dt, "stride": self.stride})


def residual_sums(w: FloatArray, dt: float, stride: int = 1, lags: int = LAGS) -> ResidualSums:
    """Sums for one piece of residual: the first two rows of w (s, n), n at least 4.

    The others have a spectrum only.
    """
    n = w.shape[1]
    taper = np.hanning(n + 1)[:-1]
    centred = w - w.mean(axis=1, keepdims=True)
    periodogram = np.abs(np.fft.rfft(taper * centred)[:, _FIRST:]) ** 2 / np.sum(taper**2)
    frequency = np.fft.rfftfreq(n)[_FIRST:]
    place = np.clip(np.searchsorted(_EDGES, frequency, side="right") - 1, 0, _BINS - 1)
    lines = np.bincount(place, minlength=_BINS).astype(np.float64)
    power = np.stack([np.bincount(place, row, minlength=_BINS) for row in periodogram])
    scatter = lines + 2 * np.dot(_NEIGHBOURS, np.maximum(lines - [[1], [2]], 0.0))
    pairs = np.maximum(n - np.arange(lags + 1, dtype=np.float64), 0.0)
    counts, products = n // np.array(SCALES), []
    for scale, whole in zip(SCALES, counts.tolist(), strict=True):
        x = w[:2, : whole * scale].reshape(2, whole, scale).sum(axis=2) / np.sqrt(scale)
        later = sliding_window_view(np.pad(x, [(0, 0), (0, lags)]), whole, axis=1)
        products.append(np.einsum("jn,jln->jl", x, later))
    sums = power.astype(np.float64), lines, scatter, np.array(products), pairs
    return ResidualSums(dt, stride, *sums, counts.astype(np.float64))


def pooled(sums: Sequence[ResidualSums]) -> ResidualSums | None:
    """The sums of logs together.

    Those whose rows are spaced unlike the first one's are left out.
    """
    if not sums:
        return None
    total = sums[0]
    for one in sums[1:]:
        if abs(one.dt - total.dt) <= ALIKE * total.dt:
            total = total + one
    return total


class Curves(NamedTuple):
    """Values (s, n) at x (n,), and between which 95 % of white noise's are."""

    x: FloatArray
    values: FloatArray
    low: FloatArray
    high: FloatArray


def spectra(sums: ResidualSums) -> Curves:
    """One-sided densities of all signals in u²/Hz, by Hz, and the band as a share of white noise's.

    Bins are merged until each has `_FREEDOM` degrees of freedom.
    """
    begins, ends = list[int](), list[int]()
    count = spread = 0.0
    for place in np.flatnonzero(sums.lines).tolist():
        if not count:
            begins.append(place)
        count, spread = count + sums.lines[place], spread + sums.scatter[place]
        if 2 * count**2 / spread >= _FREEDOM:
            ends.append(place + 1)
            count = spread = 0.0
    starts, last = np.array(begins[: len(ends)], dtype=int), max(ends, default=0)
    lines = np.add.reduceat(sums.lines[:last], starts)
    scatter = np.add.reduceat(sums.scatter[:last], starts)
    density = np.add.reduceat(sums.power[:, :last], starts, axis=1) / lines
    freedom = 2 * lines**2 / scatter
    low = chi2_exceeded(freedom, 0.975) / freedom
    high = chi2_exceeded(freedom, 0.025) / freedom
    middle = np.sqrt(_EDGES[starts] * _EDGES[ends])
    return Curves(middle / sums.dt, 2 * sums.dt * density, low, high)


def autocorrelation(sums: ResidualSums) -> Curves:
    """Correlations of the residual by lags in s, at multiples of the stride.

    The band is Bartlett's for a moving average over one stride: its variance is Σ r_i² / n, over
    lags i within the stride, both ways (Bartlett 1946; Box & Jenkins, sec. 2.1.6).
    """
    mean = sums.products[0] / np.maximum(sums.pairs, 1.0)
    r = np.divide(mean, mean[:, :1], out=np.zeros_like(mean), where=mean[:, :1] > 0)
    known = np.flatnonzero(sums.pairs[:: sums.stride] > sums.pairs[0] / 4)[1:] * sums.stride
    variance = 1 + 2 * np.sum(r[:, 1 : sums.stride] ** 2, axis=1)
    half = NORMAL * np.sqrt(variance[:, None] / sums.pairs[known])
    return Curves(known * sums.dt, r[:, known], -half, half)


def whiteness_of(sums: ResidualSums) -> Curves:
    """Spectra of the residual alone in shares of white noise of the same variance: 1 is white."""
    raw = spectra(sums)
    variance = (sums.products[0, :, 0] / np.maximum(sums.pairs[0], 1.0))[:, None]
    level, density = 2 * sums.dt * variance, raw.values[:2]
    share = np.divide(density, level, out=np.zeros_like(density), where=level > 0)
    return raw._replace(values=share)


class Whiteness(NamedTuple):
    """The test's outcome by joint (2,): p-value, lag-one correlation, and the verdict."""

    p_value: FloatArray
    lag1: FloatArray
    joint_white: tuple[bool, ...]


def judge(residual: Sequence[ResidualSums]) -> Whiteness:
    """Test innovations for whiteness.

    Parameters
    ----------
    residual : ResidualSums of each log

    Returns
    -------
    Whiteness
        A joint is white with a p-value of its share at least.

    Notes
    -----
    Ljung & Box 1978: n (n + 2) Σ ρ_l² / (n − l) over the lags l is χ² with as many degrees of
    freedom.
    """
    sums = reduce(add, residual)
    power = np.maximum(sums.products[:, :, :1], 1e-300)
    rho = sums.products[:, :, 1 : 1 + _LAGS] / power
    n = sums.counts[:, None, None]
    lags = np.arange(1, _LAGS + 1)
    tested = lags < n / 4
    terms = n * (n + 2) * rho**2 / np.maximum(n - lags, 1)
    statistic = np.sum(np.where(tested, terms, 0.0), axis=2)
    p = chi2_tail(np.maximum(tested.sum(axis=2), 1), statistic)
    # In a long log the least colour is significant; one this faint does not move an error bar.
    faint = np.sqrt(np.mean(rho**2, axis=2)) < _FAINT
    p_value = np.minimum(1.0, len(SCALES) * np.where(faint, 1.0, p).min(axis=0))
    white = (p_value >= 0.5 * level("whiteness")).tolist()
    return Whiteness(p_value, rho[0, :, 0], tuple(white))
