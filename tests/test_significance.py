"""One budget of false alarms: limits against SciPy's distributions and against drawn noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from algid.base.significance import (
    BUDGET,
    CERTAIN,
    LEVEL,
    NORMAL,
    SHARES,
    SURE,
    chance,
    sigmas,
)


def test_limits_are_those_of_the_normal_distribution() -> None:
    assert norm.ppf(0.975) == pytest.approx(NORMAL, rel=1e-15)
    for level in (LEVEL, CERTAIN):
        assert sigmas(level) == pytest.approx(norm.isf(level / 2), rel=1e-12)
        assert sigmas(level, sides=1) == pytest.approx(norm.isf(level), rel=1e-12)
        assert chance(sigmas(level)) == pytest.approx(level, rel=1e-9)
    assert pytest.approx(norm.isf(LEVEL / 32), rel=1e-12) == SURE
    assert chance(0.1, 12) == 1.0


def test_a_log_without_fault_keeps_to_the_budget() -> None:
    """All tests at once on independent noise: the worst case, in which their shares add up."""
    draw = np.random.default_rng(8)
    assert sum(SHARES.values()) == pytest.approx(1)
    count = round(sum(SHARES.values()) * BUDGET / LEVEL)
    largest = np.abs(draw.standard_normal((20_000, count, 12))).max(axis=2)
    warned = np.any(largest > sigmas(comparisons=12), axis=1)
    assert 0.7 * BUDGET < warned.mean() < 1.2 * BUDGET  # ± 2.6 standard errors
