"""Open directions in words: information whose null space is known, and what of a sum
stays known.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation
from algid.estimators.fit import alone, finish
from algid.estimators.identifiability import examine, open_directions, sizes
from algid.estimators.parametrisation import Shared
from algid.model import Model
from pipelines.cramer_rao import of_payload

MOVED = np.ones(2)
NAMES = ("k1", "k2", "k3", "k4", "k5", "k6", "k7")
# k1, k3, k5; k2, k4; k6, k7 have one size each
SIZES = np.array([0.05, 2.0, 0.05, 2.0, 0.05, 0.3, 0.3])
VALUES = SIZES * np.array([0.8, 1.0, 1.0, -0.7, 0.9, 1.0, 0.5])


def information(*null: FloatArray) -> FloatArray:
    """Of 1000 standard deviations a size in every direction, but nothing along those given, in
    units of the sizes.
    """
    along, _ = np.linalg.qr(np.array(null).T) if null else (np.zeros((7, 0)), None)
    return 1e6 * (np.eye(7) - along @ along.T) / np.outer(SIZES, SIZES)


def axis(**share: float) -> FloatArray:
    return np.array([share.get(name, 0.0) for name in NAMES])


@pytest.mark.parametrize(
    ("null", "sentences"),
    [
        ((), ()),
        ((axis(k7=1),), ("k7 is not determined",)),
        ((axis(k3=1, k5=-1),), ("k3 and k5 only as a sum",)),
        ((axis(k3=1, k5=1),), ("k3 and k5 only as a difference",)),
        ((axis(k1=1, k5=2),), ("k1 and k5 only as -2 times the first plus the second",)),
        ((axis(k1=1, k5=-2),), ("k1 and k5 only as 2 times the first plus the second",)),
        ((axis(k1=1, k6=-1),), ("k1 and k6 only as 6 times the first plus the second",)),
        ((axis(k1=1, k3=1, k5=1),), ("k1, k3 and k5 only in 2 combinations",)),
        ((axis(k1=1, k3=1), axis(k3=1, k5=1)), ("k1, k3 and k5 only in 1 combination",)),
        ((axis(k3=1), axis(k5=1)), ("k3 is not determined", "k5 is not determined")),
        ((axis(k2=1, k4=-1), axis(k6=1)), ("k2 and k4 only as a sum", "k6 is not determined")),
    ],
)
def test_what_is_open_is_said_in_words(
    null: tuple[FloatArray, ...], sentences: tuple[str, ...]
) -> None:
    S = information(*null)
    left_open, _, lacking = examine(NAMES, VALUES, S, MOVED)
    assert tuple(one.text for one in left_open) == sentences
    np.testing.assert_array_equal(lacking, np.sum(np.abs(null), axis=0) * np.ones(7) > 0)
    directions, size = open_directions(NAMES, VALUES, S)
    np.testing.assert_allclose(size, SIZES, rtol=1e-12)
    assert directions.shape == (7, len(null))
    np.testing.assert_allclose(directions.T @ directions, np.eye(len(null)), atol=1e-12)
    np.testing.assert_allclose(
        S @ (directions * size[:, None]), 0, atol=1e-6 * np.abs(S).max() * SIZES.min()
    )


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        (0.011, 0.011, ""),
        (0.009, 1.0, ": joint 1 never moved"),
        (1.0, 0.009, ": joint 2 never moved"),
        (0.0, 0.0, ": neither joint moved"),
    ],
)
def test_a_joint_that_never_moved_is_why(first: float, second: float, reason: str) -> None:
    (found,), *_ = examine(NAMES, VALUES, information(axis(k6=1)), np.array([first, second]))
    assert found.text == f"k6 is not determined{reason}"


def test_a_sum_is_known_whose_terms_are_not() -> None:
    """Of k3 + k5 the standard deviation is that of a model whose parameter is the sum.

    k5 alone has none.
    """
    shared = Shared(Model())
    rng = np.random.default_rng(0)
    X = rng.standard_normal((60, 7)) / SIZES
    X[:, 4] = X[:, 2]  # k3 and k5 move the torque alike
    y = X @ VALUES + 0.02 * rng.standard_normal(60)
    g, S = X * y[:, None] / 4e-4, X[:, :, None] * X[:, None, :] / 4e-4
    log = LogInformation(False, np.zeros(7), S, g)
    fit = finish("refined", shared, [log], VALUES, MOVED, coloured=False)
    opened = np.isin(NAMES, ("k3", "k5"))
    np.testing.assert_array_equal(np.array(fit.status) != "OK", opened)
    merged = np.delete(X, 4, axis=1) / 0.02
    covariance = np.linalg.inv(merged.T @ merged)
    # the variance of the difference, 1e14 times as large in floating point, leaves two digits of
    # the sum's
    for share in (axis(k3=1, k5=1), axis(k3=1, k5=1, k1=-2), axis(k1=1)):
        of_merged = np.delete(share, 4)
        expected = np.sqrt(of_merged @ covariance @ of_merged)
        assert fit.spread(share) == pytest.approx(expected, rel=0.02)
    assert fit.spread(axis(k5=1)) == np.inf
    assert np.isinf(fit.ci95[4]).all()
    own = alone(shared, [log])
    np.testing.assert_array_equal(np.isinf(own.std), opened)
    np.testing.assert_allclose(own.values[~opened], fit.values[~opened], rtol=1e-6)


def test_a_payload_of_nothing_has_the_size_of_one_that_loads_the_arm_as_much_as_itself() -> None:
    """At 1 m, in inertia and in weight, whichever takes more."""
    *_, mass = sizes((*NAMES, "m_p"), np.append(VALUES, 0.0))
    loads = of_payload(mass, 1.0, 1.0, 9.81) / SIZES
    assert loads[:5].min() == pytest.approx(1.0)
