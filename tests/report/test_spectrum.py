from __future__ import annotations

import numpy as np
from scipy.signal import welch

from algid.signals.filters import LAGS, Spectrum, stretch_length


def test_the_density_is_welchs_however_the_signal_is_cut() -> None:
    y = np.random.default_rng(0).normal(size=(2, 1024 + 77))
    spectrum = Spectrum(2, 128)
    for part in np.split(y, [13, 500, 501], axis=1):
        spectrum.feed(part)
    frequency, density = spectrum.density(1e-3)
    expected_frequency, expected = welch(y, 1e3, nperseg=128, noverlap=0, axis=-1)
    np.testing.assert_allclose(frequency, expected_frequency[1:], rtol=1e-14)
    # scipy halves the last one, which has no partner at negative frequencies
    np.testing.assert_allclose(density[:, :-1], expected[:, 1:-1], rtol=1e-9)


def test_the_autocorrelation_of_a_first_order_process_is_its_powers() -> None:
    rng = np.random.default_rng(1)
    y = np.zeros(400_000)
    noise = rng.normal(size=y.size)
    for i in range(1, y.size):
        y[i] = 0.8 * y[i - 1] + noise[i]
    spectrum = Spectrum(1, 2048)
    spectrum.feed(y[None])
    found = spectrum.autocorrelation()[0]
    # the mean of 2048 samples takes some 10/2048 away; the noise of 400,000 samples is about 0.003
    np.testing.assert_allclose(found[:10], 0.8 ** np.arange(10), atol=0.012)
    assert found.size == LAGS + 1


def test_stretches_with_a_gap_are_left_out() -> None:
    y = np.ones((1, 512))
    y[0, 200] = np.nan
    spectrum = Spectrum(1, 128)
    spectrum.feed(y)
    assert spectrum.stretches == 3
    spectrum.feed(np.ones((1, 100)))
    spectrum.cut()
    spectrum.feed(np.ones((1, 100)))
    assert spectrum.stretches == 3
    np.testing.assert_array_equal(spectrum.autocorrelation(), np.zeros((1, LAGS + 1)))  # no deviation from the mean


def test_a_short_log_gets_short_stretches() -> None:
    assert [stretch_length(n) for n in (0, 10_000, 3_600_000)] == [128, 1024, 2048]
