"""Terms shrunk by an empirical-Bayes prior: closed forms, fixed points, and least squares with the
same prior.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from algid.base.criteria import AT_REST
from algid.estimators import shrunk, weak
from algid.estimators.combine import LogInformation, Prior
from algid.estimators.parametrisation import Shared
from algid.estimators.shrinkage import Expected, dispersion, divided, joined, shrink, spread
from algid.estimators.weak import WeakSettings
from algid.model import DELAYS, EVERY_TERM, TERMS, Model
from algid.signals.segments import Segment

from .conftest import Bench

SHARED = Shared(Model(("offset",)))
EXPECTED = Expected(
    ("o1", "o2"), ("offset", "offset"), np.array([0.1, 0.0]), np.array([0.2, 0.4]), np.full(2, 0.5)
)


def _log(information: np.ndarray, estimate: np.ndarray, stretches: int = 4) -> LogInformation:
    """A log whose likelihood has its maximum at `estimate`, with a diagonal information in equal
    stretches.
    """
    S = np.diag(information) / stretches
    return LogInformation(
        False,
        np.zeros(estimate.size),
        np.stack([S] * stretches),
        np.stack([S @ estimate] * stretches),
    )


def test_terms_are_drawn_to_what_is_expected_and_constants_are_not() -> None:
    """With a diagonal information each estimate is the mean of log and prior, weighed by their
    precisions.
    """
    information, estimate = np.linspace(50, 90, 9), np.linspace(1.0, 2.0, 9)
    prior = EXPECTED.prior(np.ones(2))
    beta, share = shrink(SHARED, [_log(information, estimate)], np.zeros(9), EXPECTED, np.ones(2))
    np.testing.assert_allclose(beta[:7], estimate[:7], rtol=1e-9)
    # offsets of 2 are far beyond what is expected: the largest spread stands
    assert np.all(share == 1.0)
    weight = information[7:] / (information[7:] + np.diag(prior.precision))
    np.testing.assert_allclose(
        beta[7:], weight * estimate[7:] + (1 - weight) * EXPECTED.mean, rtol=1e-9
    )


def test_the_spread_is_a_fixed_point_of_expectation_and_maximisation() -> None:
    information = np.full(9, 400.0)
    estimate = np.array([*np.ones(7), 0.13, 0.02])
    beta, share = shrink(SHARED, [_log(information, estimate)], np.zeros(9), EXPECTED, np.ones(2))
    variance = 1 / (information[7:] + 1 / (share * EXPECTED.spread) ** 2)
    squares = ((beta[7:] - EXPECTED.mean) ** 2 + variance) / EXPECTED.spread**2
    np.testing.assert_allclose(share**2, (squares.sum() + 0.25) / 3, rtol=5e-3)
    assert share[0] == share[1] < 0.5  # one spread a term


def test_what_is_expected_of_a_term_has_the_scale_of_the_arm() -> None:
    """Of torques of 2 and 3 N m (RMS): shares of a joint's torque, of k3, of a moment, or of 1."""
    shared = Shared(Model(tuple(name for name, term in TERMS.items() if term.spread)))
    gram = np.zeros((1, 2, 1, 1))
    gram[0, :, 0, 0] = 10 * np.array([2.0, 3.0]) ** 2
    normal = weak.Normal(gram, 1e-3, 1000, np.array([10.0, 10.0]), np.ones(2))
    beta = np.zeros(len(shared.names))
    for name, value in (("k1", 0.1), ("k2", 0.5), ("k3", 0.02), ("k4", 4.0)):
        beta[shared.names.index(name)] = value
    expected = shrunk.expectation(shared, [normal], WeakSettings(shared.model), beta)
    spreads = dict(zip(expected.names, expected.spread.tolist(), strict=True))
    assert spreads["f1"] == pytest.approx(0.3 * 2)
    assert spreads["f2"] == pytest.approx(0.3 * 3)
    assert spreads["o2"] == pytest.approx(0.02 * 3)
    assert spreads["j2"] == pytest.approx(0.02)
    assert spreads["e1"] == spreads["e2"] == spreads["gain2"] == pytest.approx(0.03)
    assert spreads["k2s"] == pytest.approx(0.5 * 0.5)
    assert spreads["k4s"] == pytest.approx(0.5 * 4)


def test_dispersion_is_the_variance_of_scores_over_the_information() -> None:
    rng = np.random.default_rng(3)
    logs = []
    for _ in range(40):
        S = np.stack([np.eye(9)] * 25)
        logs.append(
            LogInformation(False, np.zeros(9), S, np.sqrt(6.0) * rng.standard_normal((25, 9)))
        )
    # 9 · 39 squares: ± 7.6 %
    assert dispersion(SHARED, logs, np.zeros(9)) == pytest.approx(6.0, rel=0.15)
    quiet = [LogInformation(False, log.c0, log.S, log.g / 10) for log in logs]
    assert dispersion(SHARED, quiet, np.zeros(9)) == 1.0
    apart = [LogInformation(False, log.c0, log.S, log.g + rng.standard_normal(9)) for log in quiet]
    # what differs from log to log alone
    assert dispersion(SHARED, apart, np.zeros(9)) == pytest.approx(25.0, rel=0.2)


def test_covariances_of_one_log_and_of_many() -> None:
    """Of white scores all three are the inverse information, the prior's part beside it.

    Of one log two are left.
    """
    rng = np.random.default_rng(4)
    prior = Prior(("o1", "o2"), np.zeros(2), np.diag([1e-9, 1e6]))
    S = np.stack([np.eye(9)] * 30)
    logs = [LogInformation(False, np.zeros(9), S, rng.standard_normal((30, 9))) for _ in range(60)]
    beta = np.mean([log.total[1] for log in logs], axis=0) / 30
    beta[8] = 0.0
    without = np.array([(60 * 30 * beta - log.total[1]) / (59 * 30) for log in logs])
    without[:, 8] = 0.0
    found = spread(SHARED, logs, beta, prior, without)
    assert found.jackknife is not None
    for covariance in (found.jackknife, found.scores, found.stretches):
        # 60 squares a parameter: ± 18 %
        np.testing.assert_allclose(np.diag(covariance)[:8], 1 / 1800, rtol=0.7)
        assert np.mean(np.diag(covariance)[:8]) == pytest.approx(1 / 1800, rel=0.25)
        assert covariance[8, 8] == pytest.approx(1e-6, rel=0.01)  # held by the prior, as wide as it
    alone = spread(SHARED, logs[:1], beta, prior, beta[None])
    assert alone.jackknife is None
    np.testing.assert_allclose(np.diag(alone.scores)[:8], 1 / 30)


def test_two_priors_know_what_each_knows() -> None:
    first = Prior(("k1", "k2"), np.array([1.0, 2.0]), np.array([[4.0, 1.0], [1.0, 3.0]]))
    both = joined(first, EXPECTED.prior(np.ones(2)))
    assert both.names == ("k1", "k2", "o1", "o2")
    np.testing.assert_array_equal(both.precision[:2, :2], first.precision)
    np.testing.assert_allclose(np.diag(both.precision)[2:], [25.0, 6.25])
    assert not both.precision[:2, 2:].any()
    assert joined(None, first) is first


def _rubbing(bench: Bench, part: slice) -> Segment:
    """A log of white noise and of Coulomb friction that only the torque feels."""
    log = bench.log(sigma=1e-4).part(part.start, part.stop)
    omega = np.gradient(log.theta, log.dt, axis=1)
    return Segment(
        log.start, log.dt, log.theta, log.tau + np.array([[0.05], [0.02]]) * np.tanh(omega / 0.2)
    )


def test_least_squares_with_the_same_prior_gives_the_same(bench: Bench) -> None:
    logs = [_rubbing(bench, slice(start, start + 1300)) for start in (0, 1300, 2600)]
    sources = [lambda log=log: [log] for log in logs]
    settings = WeakSettings(bandwidth=60.0)
    found = shrunk.fit(sources, settings=settings)
    assert found.shrinkage is not None
    still = AT_REST * weak.speeds(sources, settings)
    same = WeakSettings(
        found.shared.model, bandwidth=60.0, estimate_delay=True, rest=(still[0], still[1])
    )
    free = weak.fit(sources, settings=same)
    phi = np.trace(free.logs[0].total[0]) / np.trace(found.logs[0].total[0])
    prior = Prior(found.shrinkage.names, found.shrinkage.mean, phi * found.shrinkage.precision)
    every = weak.fit(sources, settings=same, prior=prior)
    assert every.names == found.names
    # weights rest on another residual
    np.testing.assert_allclose(every.values[:7], found.values[:7], rtol=6e-3)
    np.testing.assert_allclose(found.values[:7], bench.truth[:7], rtol=5e-3)
    friction = [found.values[found.names.index(name)] for name in ("f1", "f2")]
    np.testing.assert_allclose(friction, [0.05, 0.02], rtol=0.1)


def test_a_joint_that_stands_says_nothing(bench: Bench) -> None:
    """Joint 2 is held by friction for a while: its torque is then what it happens to be, and moves
    no estimate.
    """
    log = bench.log(sigma=1e-5)
    held = log.theta.copy()
    held[1, 2000:] = held[1, 2000]
    torques = log.tau.copy()
    found = []
    for held_by in (0.0, 0.3):
        torques[1, 2000:] = held_by
        piece = Segment(0.0, log.dt, held, torques.copy())
        normal = weak.normal_equations(partial(list, [piece]), WeakSettings(rest=(0.0, 0.5)))
        assert normal is not None
        assert 0.3 * normal.rows[0] < normal.rows[1] < 0.6 * normal.rows[0]
        found.append(normal.gram[-len(normal.gram) // 4 :, 1])
    np.testing.assert_array_equal(found[0], found[1])


def test_every_term_has_a_scale_save_the_lag_which_is_a_delay() -> None:
    shrunken = {name for name, term in EVERY_TERM.items() if term.spread is not None}
    assert shrunken == {*TERMS, *DELAYS} - {"lag"}


def test_dividing_leaves_the_maximum() -> None:
    log = _log(np.full(9, 3.0), np.ones(9))
    (less,) = divided([log], 4.0)
    np.testing.assert_allclose(less.total[0] * 4, log.total[0])
    np.testing.assert_allclose(np.linalg.solve(less.total[0], less.total[1]), np.ones(9))
