"""What sensors make of a motion: quantisation and noise against their statistics, with exact
bounds.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2

from algid.arm import FloatArray
from algid.log import Truth
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import SimulatedMotion

CASE = load_case("case1")
COUNT = 20_000
RARE = (
    1e-6  # how often a bound may be broken by chance: seeds are fixed, so it holds always or never
)


def motion(count: int = COUNT) -> SimulatedMotion:
    t = 1e-3 * np.arange(count)
    return SimulatedMotion(
        t,
        np.stack([np.sin(0.7 * t), 2 * np.cos(1.3 * t)]),
        np.stack([0.7 * np.cos(0.7 * t), -2.6 * np.sin(1.3 * t)]),
        np.stack([3 * np.sin(t), np.cos(2 * t)]),
    )


def recorded(**sensors: float | int | None) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    fitted = Sensors(**sensors)  # type: ignore[arg-type]
    log = record(motion(), fitted, Truth(CASE.arm, 0.0, "case1"), "it")
    return log.theta, log.tau, log.omega


@pytest.mark.parametrize(("position", "torque"), [(2e-3, 0.0), (0.0, 5e-2), (2e-3, 5e-2)])
def test_noise_has_the_standard_deviation_asked_for_and_no_memory(
    position: float, torque: float
) -> None:
    theta, tau, omega = recorded(position_noise=position, torque_noise=torque, seed=4)
    assert (omega is None) == (position > 0)
    for error, std in ((theta - motion().theta, position), (tau - motion().tau, torque)):
        if std == 0:
            np.testing.assert_array_equal(error, 0.0)
            continue
        low, high = chi2.ppf([RARE / 2, 1 - RARE / 2], COUNT)
        for row in error / std:
            assert low < row @ row < high
        # products of neighbours have mean 0 and variance 1
        product = error[:, 1:] * error[:, :-1]
        assert abs(product.sum()) < 5 * std**2 * np.sqrt(product.size)


@pytest.mark.parametrize("bits", [4, 12, 20])
def test_an_encoder_rounds_to_the_nearest_of_its_lines(bits: int) -> None:
    theta, tau, omega = recorded(encoder_bits=bits)
    step = 2 * np.pi / 2**bits
    lines = theta / step
    np.testing.assert_allclose(lines, np.round(lines), atol=1e-9)
    error = (theta - motion().theta) / step
    assert np.abs(error).max() <= 0.5 + 1e-9
    assert omega is None
    np.testing.assert_array_equal(tau, motion().tau)


def test_jitter_is_as_large_as_asked_and_keeps_the_order() -> None:
    rate, std = 1000.0, 1e-4
    t = sample_times(rate, 20.0, Sensors(jitter=std, seed=2))
    error = t - np.arange(t.size) / rate
    assert error[0] == 0
    low, high = chi2.ppf([RARE / 2, 1 - RARE / 2], t.size - 1)
    # clipped at 4.5 standard deviations, which takes 1e-4 of them away
    assert low < np.sum(error**2) / std**2 < high
    wild = sample_times(rate, 20.0, Sensors(jitter=1.0, seed=2))
    assert np.diff(wild).min() >= 0.1 / rate - 1e-9  # 0.45 to either side leave a tenth
    assert np.abs(wild - np.arange(wild.size) / rate).max() <= 0.45 / rate + 1e-9


@pytest.mark.parametrize("share", [0.05, 0.9])
def test_as_many_samples_are_lost_as_asked_but_not_the_ends(share: float) -> None:
    t = sample_times(1000.0, 20.0, Sensors(drop=share, seed=6))
    low, high = binom.ppf([RARE / 2, 1 - RARE / 2], 20_001, 1 - share)
    assert low <= t.size <= high + 2
    assert (t[0], t[-1]) == (0.0, 20.0)
    places = np.round(1000 * t).astype(int)
    np.testing.assert_allclose(t, places / 1000, atol=1e-9)
