"""The robust answer: closed forms, fixed points, least squares with the same prior, and scenes of
endogenous torque and of feedback, each with the estimate or the warning that it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import robust, weak
from algid.estimators.combine import LogInformation
from algid.estimators.fit import Fit
from algid.estimators.modulating_functions import OVERLAP
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.estimators.robust import (
    BESIDE,
    WINDOWS,
    Expected,
    RobustProblem,
    _crossed,
    _marginal,
    dispersion,
    shrink,
)
from algid.model import RIGID, Model
from algid.signals.segments import Segment
from pipelines.disturbed import DT, Scene, scene
from pipelines.race_peers import even
from pipelines.run_to_run import runs as runs_of

from .conftest import problem_of

SETTINGS = WeakSettings(bandwidth=60.0)
SHARED = Shared(Model(("offset",)))
EXPECTED = Expected(
    ("o1", "o2"), ("offset", "offset"), np.array([0.1, 0.0]), np.array([0.2, 0.4]), np.full(2, 0.5)
)
START = (np.zeros(9), np.ones(2))


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
    beta, share = shrink(SHARED, EXPECTED, None, [_log(information, estimate)], START)
    np.testing.assert_allclose(beta[:7], estimate[:7], rtol=1e-9)
    # offsets of 2 are far beyond what is expected: the largest spread stands
    assert np.all(share == 1.0)
    weight = information[7:] / (information[7:] + np.diag(prior.precision))
    np.testing.assert_allclose(
        beta[7:], weight * estimate[7:] + (1 - weight) * EXPECTED.mean, rtol=1e-9
    )


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


def least_squares(sources: Sequence[Source], settings: WeakSettings) -> Fit:
    return RobustProblem.of(Problem(sources, (), settings)).least_squares()


def coloured(rng: np.random.Generator, keep: float, count: int) -> FloatArray:
    """Two autoregressions (2, N) of unit variance."""
    made = rng.standard_normal((2, count))
    for place in range(1, count):
        made[:, place] = keep * made[:, place - 1] + np.sqrt(1 - keep**2) * made[:, place]
    return made


def test_the_variance_of_a_cross_correlation_is_that_of_independent_series() -> None:
    """Of 400 pairs of independent autoregressions of 0.8 and 0.9, each sum over its
    deviation.
    """
    rng = np.random.default_rng(7)
    found = []
    for _ in range(200):
        products, variance = _crossed(coloured(rng, 0.8, 400), coloured(rng, 0.9, 400))
        found.append(products[4:6] / np.sqrt(variance[4:6]))
    spread = float(np.sqrt(np.mean(np.square(found))))
    assert 0.8 < spread < 1.2  # 400 values of ± 4 %, and variances from 400 samples


def problem(made: Scene, *, reference: bool = False) -> Problem:
    asked = made.reference if reference and made.reference is not None else [None] * len(made.tau)
    logs = [
        Segment(0.0, DT, theta, tau, reference=one)
        for theta, tau, one in zip(made.theta, made.tau, asked, strict=True)
    ]
    return problem_of(*logs[:4], settings=SETTINGS)


def settled(made: Scene, *, reference: bool = False) -> tuple[Fit, Fit]:
    """By least squares, and what stands in the end."""
    robustly = RobustProblem.of(problem(made, reference=reference))
    least = robustly.least_squares()
    return least, robustly.instruments_if_endogenous(least)


def off(fit: Fit, made: Scene) -> FloatArray:
    """Errors of k1 … k5 in half widths of their intervals."""
    places = [fit.names.index(name) for name in RIGID]
    truth = made.arm.constants()[:5]
    return np.abs(fit.values[places] - truth) / (fit.quantile * fit.std[places])


@pytest.mark.slow
def test_instruments_stand_where_the_torque_is_endogenous_and_answers_nothing() -> None:
    made = scene(1, feedback=False)
    least, found = settled(made)
    assert off(least, made).max() > 1
    assert found.estimator == "instruments"
    assert off(found, made).max() < 1
    assert [note.code for note in found.notes] == ["INSTRUMENTS"]


@pytest.mark.slow
def test_feedback_is_said_and_leaves_least_squares() -> None:
    """The logged torque of a PD controller is no instrument."""
    made = scene(1, feedback=True)
    least, found = settled(made)
    assert found.values == pytest.approx(least.values)
    assert [note.code for note in found.notes] == ["FEEDBACK"]
    by_instruments = RobustProblem.of(problem(made)).by_instruments(least, least.values)
    watched = robust.with_feedback_noted(by_instruments, problem(made))
    assert [note.code for note in watched.notes] == ["FEEDBACK"]


@pytest.mark.slow
def test_a_reference_is_the_instrument_under_feedback() -> None:
    """The same logs with the reference that the controller follows: no warning, and closer."""
    made = scene(1, feedback=True)
    least, found = settled(made, reference=True)
    assert found.estimator == "instruments"
    assert [note.code for note in found.notes] == ["INSTRUMENTS"]
    assert off(found, made).max() < 1
    assert off(found, made)[0] < 0.5 * off(least, made)[0]  # k1 is attenuated most
    known = problem(made, reference=True)
    assert robust.with_feedback_noted(found, known).notes == found.notes


@pytest.mark.slow
def test_an_arm_without_unmodelled_torque_keeps_least_squares() -> None:
    made = scene(2, feedback=True, share=0.0)
    least, found = settled(made)
    assert found.notes == ()
    assert found.values == pytest.approx(least.values)
    assert found.endogeneity is not None


def test_a_likelihood_beside_shapes_is_that_of_least_squares_with_their_prior() -> None:
    rng = np.random.default_rng(4)
    X = rng.standard_normal((2, 6, 40)) * np.array([1.0, 2.0, 3.0, 20.0, 0.1, 1.0])[:, None]
    X[1, 3] = X[0, 4] = 0.0  # a shape is one joint's
    X[:, 5] /= np.sqrt(np.mean(X[:, 5] ** 2, axis=1, keepdims=True))  # so that rows weigh one
    rows = np.array([40.0, 40.0])
    power = np.sum(X[:, 5] ** 2, axis=1)
    normal = weak.Normal(list, False, weak.grams(X, 8), 0.01, rows, power, np.ones(2))
    found = _marginal(weak.evidence(normal.gram, normal.rows, np.zeros(5), False), normal, 3)
    rows = np.sqrt(2 / OVERLAP) * np.concatenate(list(X.swapaxes(1, 2)))
    size = np.sqrt([np.mean(X[0, 3] ** 2), np.mean(X[1, 4] ** 2)])
    known = np.pad(np.diag(size / BESIDE), ((0, 0), (3, 1)))
    rows = np.concatenate([rows, known])
    S = np.linalg.inv(rows[:, :5].T @ rows[:, :5])
    np.testing.assert_allclose(np.linalg.inv(found.total[0]), S[:3, :3], rtol=1e-9)
    estimate = np.linalg.solve(*found.total)
    np.testing.assert_allclose(estimate, (S @ rows[:, :5].T @ rows[:, 5])[:3], rtol=1e-9)


@pytest.mark.slow
def test_a_single_run_of_a_real_arm_agrees_with_the_others(shared_data: Path) -> None:
    """Run 7 of design A.0 was 3.9 standard deviations of the difference off."""
    runs = [even(log) for log in runs_of(shared_data, "A.0")]
    alone = RobustProblem.of(problem_of(runs[6]))
    least = alone.least_squares()
    rest = least_squares(problem_of(*runs[:6], *runs[7:]).unloaded, WeakSettings())
    found = alone.with_scatter(least, least, [{"window": window} for window in WINDOWS])
    places = [found.names.index(name) for name in RIGID]
    away = np.abs(found.values - rest.values)[places]
    assert np.max(away / np.hypot(least.std, rest.std)[places]) > 3
    assert np.max(away / np.hypot(found.std, rest.std)[places]) < 3
