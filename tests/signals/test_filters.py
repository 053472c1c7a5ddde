import math

import numpy as np
import pytest
from scipy.signal import butter, freqz, lfilter, sosfiltfilt

from algid.signals.filters import (
    butterworth,
    correlate,
    differentiator,
    recursion,
    smoothed,
    smoother,
)


@pytest.mark.parametrize("n", [1, 2, 3, 500])
def test_a_recursion_is_scipys_and_leaves_its_state(n: int) -> None:
    rng = np.random.default_rng(4)
    x, state = rng.normal(size=(2, n)), rng.normal(size=(2, 3))
    numerator, denominator = (
        np.array([0.3, -0.1, 0.4, 0.2]),
        np.poly([0.9, 0.5 + 0.4j, 0.5 - 0.4j]).real,
    )
    y, left = recursion(numerator, denominator, x, state)
    expected, expected_left = lfilter(numerator, denominator, x, zi=state)
    np.testing.assert_allclose(y, expected, atol=1e-12)
    np.testing.assert_allclose(left, expected_left, atol=1e-12)


def test_the_differentiators_response_is_that_of_a_derivative_and_falls_off() -> None:
    """Against SciPy's frequency response: i ω up to half the bandwidth, next to nothing from twice
    of it.
    """
    dt, bandwidth = 1e-3, 40.0
    kernel = differentiator(dt, bandwidth)
    np.testing.assert_allclose(kernel, -kernel[::-1], atol=1e-9 * np.abs(kernel).max())  # no phase
    hertz = np.array([0.1, 2.0, 8.0, 20.0, 80.0, 200.0, 450.0])
    _, response = freqz(kernel[::-1], worN=hertz, fs=1 / dt)
    response = (
        response * np.exp(2j * np.pi * hertz * dt * (kernel.size // 2)) / (2j * np.pi * hertz)
    )
    assert np.abs(response.imag).max() < 1e-9
    np.testing.assert_allclose(response.real[:3], 1, atol=1e-3)
    assert response.real[3] == pytest.approx(1, abs=0.03)
    assert np.abs(response[4:]).max() < 2e-3


@pytest.mark.parametrize("length", [2, 5, 40, 126])
def test_a_log_shorter_than_the_kernel_keeps_its_line(length: int) -> None:
    line = np.stack([3.0 * np.arange(length) + 1, -np.arange(length, dtype=np.float64)])
    found = smoothed(line, 1e-3, 40.0)
    assert found.shape == line.shape
    np.testing.assert_allclose(found, line, atol=1e-10)
    x = np.random.default_rng(length).standard_normal((2, length))
    reach = min(62, length - 1)  # as much of the kernel as there are samples beside the first one
    own = smoother(1e-3, 40.0)[62 - reach : 63 + reach]
    extended = np.pad(x, ((0, 0), (reach, reach)), mode="reflect", reflect_type="odd")
    expected = [np.convolve(row, own / own.sum(), "valid") for row in extended]
    np.testing.assert_allclose(smoothed(x, 1e-3, 40.0), expected, atol=1e-10)


@pytest.mark.parametrize("step", [1, 2, 5, 40])
@pytest.mark.parametrize("length", [31, 32, 70, 517])
def test_every_so_many_values_of_a_correlation_are_numpys(step: int, length: int) -> None:
    rng = np.random.default_rng(3)
    x, kernel = rng.standard_normal((3, length)), rng.standard_normal(31)
    expected = np.stack([np.correlate(row, kernel, "valid")[::step] for row in x])
    np.testing.assert_allclose(correlate(x, kernel, step), expected, atol=1e-12)


@pytest.mark.parametrize("cutoff", [0.5, 5.0, 100.0, 225.0])
def test_butterworth_is_scipys_ends_included(cutoff: float) -> None:
    x = np.cumsum(np.random.default_rng(5).standard_normal((2, 4000)), axis=1)
    sections = butter(3, cutoff, fs=500.0, output="sos")
    reach = min(math.ceil(3 * 500 / cutoff), x.shape[1] - 1)
    expected = sosfiltfilt(sections, x, axis=-1, padtype="odd", padlen=reach)
    # the same arithmetic in another order: rounding, grown by sections that remember 1e3 samples
    np.testing.assert_allclose(
        butterworth(x, 1 / 500, cutoff), expected, atol=1e-8 * np.abs(x).max()
    )
