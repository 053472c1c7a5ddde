"""Bounds of physics by closed forms, the worth of terms by Schwarz's own sum, and what cannot be
told.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from scipy.stats import chi2, norm

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.combine import LogInformation
from algid.estimators.diagnostics import (
    constrained,
    payload_distance,
    term_worths,
)
from algid.estimators.fit import Fit, alone, finish
from algid.estimators.parametrisation import Shared
from algid.model import Model
from pipelines.cramer_rao import of_payload

from .conftest import Bench, problem_of

PLAIN = Model()
K = np.array([0.03, 1.4, 0.05, 1.9, 0.06, 0.1, 0.2])


def fit_of(values: FloatArray, model: Model = PLAIN, delay: bool = False) -> Fit:
    """A fit of one log whose information is dense, and that is most likely at `values`."""
    shared = Shared(model, delay)
    X = np.random.default_rng(0).standard_normal((50, values.size)) / (
        0.01 * np.maximum(np.abs(values), 1e-3)
    )
    log = LogInformation(False, values, X[:, :, None] * X[:, None, :], np.zeros((50, values.size)))
    return finish("refined", shared, [log], values, np.ones(2), coloured=False)


@pytest.mark.parametrize("broken", [5, 6])
def test_a_friction_held_at_nothing_moves_the_others_as_conditional_normals(broken: int) -> None:
    """E[b | k6 = 0] = b − C[:, 6] k6 / C66, the optimum of a quadratic likelihood under one bound
    that holds.
    """
    values = K.copy()
    values[broken] = -0.05
    fit = fit_of(values)
    expected = (
        fit.values - fit.covariance[:, broken] * fit.values[broken] / fit.covariance[broken, broken]
    )
    found = constrained(fit)
    np.testing.assert_allclose(found.values, expected, atol=1e-4 * np.abs(K).max())
    np.testing.assert_array_equal(found.std, fit.std)
    assert found.converged
    name = fit.names[broken]
    distance = 0.05 / fit.std[broken]
    (note,) = found.notes
    assert (note.code, note.text) == (
        "BROKEN_BOUND",
        (
            f"--set constrain enforces {name} >= 0 ({distance:.2g} standard deviations beyond), "
            "which the logs contradict"
        ),
    )


def test_a_terms_worth_is_schwarzs_price_less_walds_statistic() -> None:
    model = Model(("coulomb", "rotor"))
    fit = fit_of(np.array([*K, 0.3, 0.2, 0.004, 0.002]), model, delay=True)
    std = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.05, 0.1, 0.002, 0.004])
    fit = replace(fit, covariance=np.diag(std**2), freedom=400)
    assert fit.names[7:] == ("f1", "f2", "j2", "delay")
    worths = dict(term_worths(fit))
    assert set(worths) == {"coulomb", "rotor", "delay"}
    assert worths["coulomb"] == pytest.approx(2 * np.log(400) - (6**2 + 2**2), rel=1e-9)
    assert worths["rotor"] == pytest.approx(np.log(400) - 2**2, rel=1e-9)
    assert worths["delay"] == pytest.approx(np.log(400) - 0.5**2, rel=1e-9)


def test_the_distance_of_two_arms_is_that_of_what_no_payload_explains(bench: Bench) -> None:
    """χ² of the loaded constants less the arm's and the payload's of another solver."""
    logs = [bench.log(loaded, 1e-3, 27) for loaded in (False, True)]
    fit = weak.fit(problem_of(logs[0], loaded=logs[1:]))
    bare, burdened = (alone(fit.shared, [log]) for log in fit.logs)
    whitening = np.linalg.inv(np.linalg.cholesky(bare.covariance + burdened.covariance))

    def left(p: FloatArray) -> FloatArray:
        share = of_payload(p[0], p[1], p[2], 9.81)
        return np.asarray(whitening @ (burdened.values - bare.values - share))

    start = np.array([bench.payload, bench.arm.l1, bench.arm.l2])
    squares = 2 * scipy.optimize.least_squares(left, start, x_scale=start).cost
    assert payload_distance(fit) == pytest.approx(norm.isf(chi2.sf(squares, 4)), rel=1e-3)
