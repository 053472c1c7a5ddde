"""The derivative observer against the transfer function of eq. (6) and a brute-force
integration.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from algid.signals.observers import (
    PAPER_POLES,
    A,
    C,
    observed,
    observer_gain,
)
from algid.signals.segments import Segment

DT = 1e-3


@pytest.mark.parametrize("poles", [PAPER_POLES, (-50 + 20j, -50 - 20j, -60, -80, -90, -100)])
def test_velocities_are_those_of_the_differential_equation(poles: tuple[complex, ...]) -> None:
    t = DT * np.arange(61)
    theta = np.stack([np.sin(8 * t), np.cos(5 * t)])
    gain = observer_gain(poles)

    def rate(now: float, x: np.ndarray) -> np.ndarray:
        # linear between samples, as assumed
        y = np.array([np.interp(now, t, angle) for angle in theta])
        return (A - gain @ C) @ x + gain @ y

    start = np.array([theta[0, 0], 0, 0, theta[1, 0], 0, 0])
    exact = solve_ivp(rate, (0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-9, max_step=DT).y
    halves = [
        Segment(0.0, DT, part, part, continues=bool(place))
        for place, part in enumerate(np.split(theta, [25], axis=1))
    ]
    found = np.hstack([piece.omega for piece in observed(halves, poles)])
    # solve_ivp's own tolerance, on velocities up to 8 rad/s, across the corners of y
    np.testing.assert_allclose(found, exact[[1, 4]], atol=2e-5)


def test_after_a_gap_the_observer_starts_at_rest_where_it_is() -> None:
    rng = np.random.default_rng(3)
    first, second = np.cumsum(rng.normal(size=(2, 2, 200)), axis=2)
    whole = [Segment(0.0, DT, theta, theta) for theta in (second, first, second + 5.0)]
    alone, _, found = (piece.omega for piece in observed(whole))
    np.testing.assert_allclose(found, alone, rtol=1e-9, atol=1e-6)
    assert np.all(np.abs(found[:, 0]) < 1e-6)


@pytest.mark.parametrize(
    "poles",
    [(-1.0, -2, -3, -4, -5, 0.0), (-1.0,) * 5, (-1.0,) * 7, (-1 + 1j, -2, -3, -1 - 1j, -4, -5)],
)
def test_poles_on_the_axis_too_many_or_not_conjugate_are_refused(
    poles: tuple[complex, ...],
) -> None:
    with pytest.raises(ValueError, match=r"poles.*got \("):
        observer_gain(poles)
