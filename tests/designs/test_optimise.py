"""The search on problems whose optimum is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from algid.arm import FloatArray
from algid.designs.campaign import Campaign
from algid.designs.search import (
    FIRST,
    LATER,
    STARTS,
    Evaluation,
    Stage,
    kept,
    optimise,
    soft_maximum,
)


class Ball(Campaign):
    """The point of the box |x| ≤ 1 nearest to `target`: the target with its coordinates clipped."""

    def __init__(self, target: FloatArray) -> None:
        object.__setattr__(self, "target", target)

    target: FloatArray

    @property
    def rest(self) -> FloatArray:
        return np.zeros(self.target.size)

    def random(self, rng: np.random.Generator) -> FloatArray:
        return 3 * rng.standard_normal(self.target.size)

    # the search passes a stage
    def evaluate(self, x: FloatArray, stage: Stage) -> Evaluation:  # noqa: ARG002
        eye = np.eye(x.size)
        return Evaluation(
            self.score(x),
            2 * (x - self.target),
            np.concatenate([1 - x, 1 + x]),
            np.vstack([-eye, eye]),
        )

    def excess(self, x: FloatArray, rate: float) -> float:  # noqa: ARG002 - the search passes it
        return float(np.abs(x).max())

    def score(self, x: FloatArray) -> float:
        return float(np.sum((x - self.target) ** 2))


TARGET = np.array([2.0, -0.3, 0.5, -4.0])


def test_the_search_finds_the_nearest_point_within_limits() -> None:
    calls: list[tuple[str, int, int]] = []
    x = optimise(Ball(TARGET), 100.0, 0, lambda *call: calls.append(call))
    np.testing.assert_allclose(x, np.clip(TARGET, -1, 1), atol=1e-5)
    assert np.abs(x).max() <= 1.0
    total = STARTS * FIRST.iterations + sum(stage.iterations for stage in LATER)
    assert {stage for stage, _, _ in calls} == {"searching"}
    assert {of for _, _, of in calls} == {total}
    done = [count for _, count, _ in calls]
    assert done == sorted(done)
    assert done[-1] <= total


def test_a_motion_is_drawn_back_to_exactly_what_it_may_use() -> None:
    problem = Ball(TARGET)
    x = np.array([4.0, 1.0, 0.0, -2.0])
    np.testing.assert_allclose(kept(problem, x, 100.0), x / 4, rtol=1e-6)
    assert problem.excess(kept(problem, x, 100.0), 100.0) <= 1.0
    np.testing.assert_array_equal(kept(problem, x / 10, 100.0), x / 10)  # within already
    # enlarged to that
    np.testing.assert_allclose(kept(problem, x / 10, 100.0, 0.9), 0.9 * x / 4, rtol=1e-6)
    # what cannot be enlarged stays
    np.testing.assert_array_equal(kept(problem, np.zeros(4), 100.0, 0.9), 0.0)


@pytest.mark.parametrize("hardness", [1.0, 50.0, 600.0])
def test_the_soft_maximum_is_the_logarithm_of_a_sum_and_never_below_the_largest(
    hardness: float,
) -> None:
    u = np.random.default_rng(0).normal(0, 2, (3, 40))
    most, share = soft_maximum(u, hardness)
    np.testing.assert_allclose(most, logsumexp(hardness * u, axis=1) / hardness, rtol=1e-12)
    assert np.all(most >= u.max(axis=1))
    assert np.all(most <= u.max(axis=1) + np.log(40) / hardness + 1e-12)
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    h = 1e-6
    for place in (0, int(np.argmax(u[0]))):
        step = np.zeros_like(u)
        step[0, place] = h
        slope = (soft_maximum(u + step, hardness)[0] - soft_maximum(u - step, hardness)[0]) / (
            2 * h
        )
        np.testing.assert_allclose(slope, [share[0, place], 0, 0], rtol=1e-4, atol=1e-8)
