"""Cumulative integrals against closed forms, and the order at which they converge."""

from __future__ import annotations

import numpy as np
import pytest

from algid.signals.differences import integral


def largest_error(dt: float, order: int) -> float:
    """Error of the integrals of cos(3 t) over two seconds, at any sample."""
    t = dt * np.arange(round(2.0 / dt) + 1)
    exact = {1: np.sin(3 * t) / 3, 2: (1 - np.cos(3 * t)) / 9, 3: t / 9 - np.sin(3 * t) / 27}[order]
    found = np.cos(3 * t)
    for _ in range(order):
        found = integral(found, dt)
    return float(np.abs(found - exact).max())


@pytest.mark.parametrize("order", [1, 2, 3])
def test_error_falls_with_the_fourth_power_of_the_sample_time(order: int) -> None:
    steps = 0.01 / 2.0 ** np.arange(4)
    errors = [largest_error(dt, order) for dt in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.1)


def test_cubics_are_integrated_exactly() -> None:
    t = 0.1 * np.arange(12)
    np.testing.assert_allclose(integral(4 * t**3 - 2 * t, 0.1), t**4 - t**2, atol=1e-14)
