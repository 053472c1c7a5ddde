import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from algid.signals.filters import butterworth, correlate, differentiator, half_length, recursion, smoothed


def test_a_ramp_has_its_slope() -> None:
    kernel = differentiator(1e-3, 30.0)
    ramp = 3.0 * np.arange(1000)[None] * 1e-3 + 2.0
    assert np.allclose(correlate(ramp, kernel), 3.0, atol=1e-11)  # rounding over some hundred taps


@pytest.mark.parametrize("hertz", [0.5, 5.0, 10.0])
def test_velocity_is_right_below_a_quarter_of_the_bandwidth(hertz: float) -> None:
    t = np.arange(4000) * 1e-3
    reach = half_length(1e-3, 40.0)
    velocity = correlate(np.sin(2 * np.pi * hertz * t)[None], differentiator(1e-3, 40.0))[0]
    truth = 2 * np.pi * hertz * np.cos(2 * np.pi * hertz * t[reach:-reach])
    assert np.abs(velocity - truth).max() < 1e-3 * 2 * np.pi * hertz  # the ripple at a quarter is 4e-4


def test_correlation_agrees_with_numpy() -> None:
    rng = np.random.default_rng(0)
    x, kernel = rng.standard_normal((2, 517)), rng.standard_normal(31)
    expected = np.stack([np.correlate(row, kernel, "valid") for row in x])
    assert np.allclose(correlate(x, kernel), expected, atol=1e-12)


def test_smoothing_keeps_a_slow_motion_and_the_length() -> None:
    t = np.arange(2000) * 1e-3
    slow = np.stack([np.sin(2 * np.pi * 2 * t), 0.3 * t])
    fast = 0.1 * np.sin(2 * np.pi * 200 * t)
    left = smoothed(slow + fast, 1e-3, 40.0) - slow
    assert left.shape == slow.shape
    assert np.abs(left[:, 200:-200]).max() < 1e-3  # stop band at -70 dB, pass band within it


@pytest.mark.parametrize(("order", "cutoff"), [(1, 3.0), (3, 5.0), (4, 20.0)])
def test_butterworth_agrees_with_scipy_away_from_the_ends(order: int, cutoff: float) -> None:
    x = np.cumsum(np.random.default_rng(0).standard_normal((2, 6000)), axis=1)
    sections = butter(order, cutoff, fs=250.0, output="sos")
    inner = slice(500, -500)
    expected = sosfiltfilt(sections, x, axis=-1)[:, inner]
    assert np.abs(butterworth(x, 1 / 250, cutoff, order)[:, inner] - expected).max() < 1e-6 * np.abs(x).max()


def test_every_third_correlation_is_every_third_correlation() -> None:
    x, kernel = np.random.default_rng(1).standard_normal((2, 1003)), np.arange(1.0, 12.0)
    np.testing.assert_allclose(correlate(x, kernel, 3), correlate(x, kernel)[:, ::3], atol=1e-12)


@pytest.mark.parametrize("rate", [1.0, 5.0, 33.0, 80.0])
def test_slow_sampling_keeps_what_the_kernel_promises(rate: float) -> None:
    kernel = differentiator(1 / rate, 60.0)
    n = np.arange(kernel.size) - kernel.size // 2
    moments = [float(kernel @ (n / rate) ** power) for power in range(7)]
    scale = (kernel.size / rate) ** np.arange(7) * rate
    assert np.allclose(np.array(moments) / scale, np.eye(7)[1] / scale[1], atol=1e-12)  # rounding


@pytest.mark.parametrize("n", [1, 2, 3, 500])
def test_a_recursion_is_scipys_and_leaves_its_state(n: int) -> None:
    rng = np.random.default_rng(4)
    x, state = rng.normal(size=n), rng.normal(size=3)
    numerator, denominator = np.array([0.3, -0.1, 0.4, 0.2]), np.poly([0.9, 0.5 + 0.4j, 0.5 - 0.4j]).real
    y, left = recursion(numerator, denominator, x, state)
    expected, expected_left = lfilter(numerator, denominator, x, zi=state)
    np.testing.assert_allclose(y, expected, atol=1e-12)
    np.testing.assert_allclose(left, expected_left, atol=1e-12)
