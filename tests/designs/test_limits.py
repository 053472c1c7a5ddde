"""Limits by hand: what a motion uses of each, and the posture it rests in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.designs.belief import Load
from algid.designs.information import Sensitivities
from algid.designs.limits import Limits, resting, usage
from algid.model import Model, Motion

ALLOWED = {
    "range": np.array([1.0, 2.0]),
    "speed": np.array([2.0, 4.0]),
    "acceleration": np.array([10.0, 20.0]),
    "torque": np.array([5.0, 2.5]),
}
TIGHT = Limits(np.array([-1.0, 1.0]), ALLOWED, height=-0.3, lengths=np.array([0.4, 0.3]))


K = np.array([0.05, 1.0, 0.03, 4.0, 0.2, 0.3, 0.2])


def at(
    theta: tuple[float, float],
    omega: tuple[float, float] = (0, 0),
    alpha: tuple[float, float] = (0, 0),
) -> Sensitivities:
    return Sensitivities(
        Model(),
        Motion(*(np.array(pair, dtype=float)[:, None] for pair in (theta, omega, alpha))),
        1.0,
    )


def load(spread: FloatArray, *, box: bool, loaded: bool = False) -> Load:
    return Load(loaded, K, spread, box)


def test_usages_by_hand() -> None:
    used = usage(TIGHT, at((-0.5, 2.0), (1.0, -3.0), (-5.0, 4.0)), (), derivatives=False)
    found = {
        (row.limit, row.joint, row.allowed > row.still): float(most)
        for row, most in zip(used.rows, used.most, strict=True)
    }
    height = 0.4 * np.sin(-0.5) + 0.3 * np.sin(1.5)
    expected = {
        ("range", 0): 0.5,  # half way from the middle, -1, to the upper end, 0
        ("range", 1): 0.5,  # from 1 to 3
        ("speed", 0): 0.5,
        ("speed", 1): -0.75,
        ("acceleration", 0): -0.5,
        ("acceleration", 1): 0.2,
    }
    for (limit, joint), share in expected.items():
        assert found.pop((limit, joint, True)) == pytest.approx(share, rel=1e-12)
        assert found.pop((limit, joint, False)) == pytest.approx(-share, rel=1e-12)
    assert found == {
        ("tip-height", None, False): pytest.approx((0.7 - height) / (0.7 + 0.3), rel=1e-12)
    }


def test_a_weak_arm_rests_where_it_needs_least() -> None:
    loads = [load(0.05 * np.diag(K), box=True)]
    weak = replace(TIGHT, allowed=ALLOWED | {"torque": np.array([3.0, 2.5])}, height=-np.inf)
    rest = resting(weak, Model(), loads)
    grid = np.stack(
        np.meshgrid(np.linspace(-2, 0, 41), np.linspace(-1, 3, 41), indexing="ij")
    ).reshape(2, -1)
    weight2 = 1.05 * np.abs(np.cos(grid.sum(axis=0))) * K[1]
    mean1 = K[3] * np.cos(grid[0]) + K[1] * np.cos(grid.sum(axis=0))
    weight1 = np.abs(mean1) + 0.05 * (
        K[3] * np.abs(np.cos(grid[0])) + K[1] * np.abs(np.cos(grid.sum(axis=0)))
    )
    worst = np.max(
        [weight1 / 3.0, weight2 / 2.5, np.abs(grid[0] + 1), np.abs(grid[1] - 1) / 2], axis=0
    )
    np.testing.assert_allclose(rest, grid[:, np.argmin(worst)])
    assert worst.min() < 1 < worst[grid.shape[1] // 2] / 0.7  # the middle would not have done
