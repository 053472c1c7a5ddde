"""What the logs tell of a payload that is a body: how often by chance, and what intervals hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.body import FALSE, averaged_over_bodies, with_body, with_body_of
from algid.estimators.fit import Fit, finish
from algid.model import Model
from pipelines.planar import Row, _fitted, _segment, motions

DRAWS = 120


@pytest.fixture(scope="module")
def bench() -> Fit:
    """A fit with every parameter, whose quadratic likelihoods stand for those of the logs."""
    rng = np.random.default_rng(0)
    logs = [_segment(motion, rng) for motion in motions("arm21", Row())]
    return with_body_of(_fitted(logs, Model(("phases",))), ("y_p", "J_p"))


def drawn(bench: Fit, sizes: dict[str, float]) -> Iterator[tuple[FloatArray, Fit]]:
    """The truth, and fits of a point payload to Gaussian draws of the logs.

    Parameters of the body are so many of their own standard deviations.
    """
    true = bench.values.copy()
    for name in ("y_p", "J_p"):
        place = bench.names.index(name)
        true[place] = sizes.get(name, 0.0) * bench.std[place]
    rng = np.random.default_rng(1)
    roots = [np.linalg.pinv(np.linalg.cholesky(log.total[0]).T) for log in bench.logs]
    for _ in range(DRAWS):
        logs = []
        for log, root in zip(bench.logs, roots, strict=True):
            c = bench.shared.coefficients(true, log.loaded)
            c0 = c + root @ rng.standard_normal(c.size)
            logs.append(replace(log, c0=c0, g=np.zeros_like(log.g)))
        shared = replace(bench.shared, body=())
        start = np.array([true[bench.names.index(name)] for name in shared.names])
        yield true, finish("refined", shared, logs, start, bench.moved, coloured=False)


def test_a_point_is_called_a_body_once_in_twenty_at_most(bench: Fit) -> None:
    assert len(bench.residual) == len(bench.noise) == 2  # more parameters leave what was seen
    false = sum(bool(with_body(fit).shared.body) for _, fit in drawn(bench, {}))
    # binomial: four standard deviations of so many draws
    assert false / DRAWS <= FALSE + 4 * (FALSE * (1 - FALSE) / DRAWS) ** 0.5


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 1.0, 2.0, 3.0])
def test_intervals_hold_where_the_logs_hardly_tell_a_body(bench: Fit, size: float) -> None:
    """Offset and inertia of up to three of their own errors: chosen or not, all others hold."""
    held: dict[str, list[bool]] = {name: [] for name in ("m_p", "l1", "l2", "k1", "k3")}
    for true, fit in drawn(bench, {"y_p": size, "J_p": size}):
        found = averaged_over_bodies(with_body(fit))
        for name, each in held.items():
            low, high = found.ci95[found.names.index(name)]
            each.append(bool(low <= true[bench.names.index(name)] <= high))
    # 92 % less three standard deviations of so many draws: 84.6 %; choosing alone holds 81 %
    least = 0.92 - 3 * (0.92 * 0.08 / DRAWS) ** 0.5
    assert {name: np.mean(each) for name, each in held.items() if np.mean(each) < least} == {}
