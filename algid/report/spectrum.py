"""Spectrum and autocorrelation of a long signal, block by block.

=======  =====================================  ===========  =======
symbol   name                                   shape        unit
=======  =====================================  ===========  =======
y        signals, NaN where there is no sample  (s, N)       u
f        frequencies                            (n // 2 + 1) Hz
S        one-sided power spectral densities     (s, n//2+1)  u^2/Hz
r        autocorrelations, one at lag 0         (s, lags+1)  1
=======  =====================================  ===========  =======

Welch's method: stretches of n samples side by side, mean removed, Hann's window, averaged.
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray

LAGS = 40


class Spectrum:
    """Averages over stretches of `length` samples without a gap; a stretch with a NaN is left out."""

    def __init__(self, signals: int, length: int) -> None:
        self._length = length
        self._rest: FloatArray = np.empty((signals, 0))
        self._power = np.zeros((signals, length // 2 + 1))
        self._products = np.zeros((signals, LAGS + 1))
        self.stretches = 0

    def feed(self, y: FloatArray) -> None:
        """Take the next block of the signals (s, n)."""
        y = np.concatenate([self._rest, y], axis=1)
        whole = y.shape[1] - y.shape[1] % self._length
        self._rest = y[:, whole:].copy()
        stretches = y[:, :whole].reshape(y.shape[0], -1, self._length)
        stretches = stretches[:, ~np.isnan(stretches).any(axis=(0, 2))]
        self.stretches += stretches.shape[1]
        window = np.hanning(self._length + 1)[:-1]
        centred = stretches - stretches.mean(axis=-1, keepdims=True)
        self._power += (np.abs(np.fft.rfft(window * centred)) ** 2).sum(axis=1)
        self._products += _lag_products(centred)

    def cut(self) -> None:
        """Forget the unfinished stretch: the next block does not follow the last one."""
        self._rest = self._rest[:, :0]

    def density(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Frequencies f and densities S, without the frequency 0, for samples `dt` s apart."""
        window = np.hanning(self._length + 1)[:-1]
        scale = 2 * dt / (np.sum(window**2) * max(self.stretches, 1))
        return np.fft.rfftfreq(self._length, dt)[1:], self._power[:, 1:] * scale

    def autocorrelation(self) -> FloatArray:
        """r at lags 0 to `LAGS`; zero where the signal is."""
        pairs = self._products / (self._length - np.arange(LAGS + 1))
        return np.divide(pairs, pairs[:, :1], out=np.zeros_like(pairs), where=pairs[:, :1] > 0)


def _lag_products(y: FloatArray) -> FloatArray:
    """Σ y_i y_(i+lag) within the stretches (s, m, n), for each lag: by the power spectrum, zero-padded."""
    padded = y.shape[-1] + LAGS
    power = (np.abs(np.fft.rfft(y, padded)) ** 2).sum(axis=1)
    return np.fft.irfft(power, padded)[:, : LAGS + 1]


def stretch_length(samples: int) -> int:
    """A power of two from 128 to 2048 that leaves eight stretches of a log of so many samples."""
    return int(2 ** np.clip(np.floor(np.log2(max(samples, 1) / 8)), 7, 11))
