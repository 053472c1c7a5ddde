"""What the refined estimator does where it cannot: no convergence, no factor, pieces too short, a
callback's tale.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators import refined, weak
from algid.estimators.problem import Problem
from algid.signals.segments import Segment

from .conftest import DT, Bench, problem_of


def _fails(*_: object) -> None:
    raise np.linalg.LinAlgError("not positive definite")


@pytest.mark.parametrize(
    ("name", "value", "steps"), [("_STEPS", 1, 1), ("_train", _fails, 0)], ids=["steps", "factor"]
)
def test_a_likelihood_that_does_not_settle_leaves_the_weak_estimate(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, name: str, value: object, steps: int
) -> None:
    known = problem_of(bench.log(sigma=1e-3))
    monkeypatch.setattr(refined, name, value)
    fit, before = refined.fit(known), weak.fit(known)
    assert (fit.estimator, fit.refuted, fit.iterations) == ("weak", True, steps)
    assert fit.status == before.status == ("OK",) * 7
    assert [note.code for note in fit.notes] == ["REFUTED"]
    np.testing.assert_array_equal(fit.values, before.values)
    np.testing.assert_array_equal(fit.covariance, before.covariance)


def test_stretches_too_short_to_tell_are_left_out_and_each_step_is_told(bench: Bench) -> None:
    log = bench.log(sigma=1e-3).part(0, 2000)
    crumb = Segment(3.0, DT, log.theta[:, :30], log.tau[:, :30])
    told: list[tuple[str, int, int]] = []
    fit = refined.fit(Problem([lambda: [log, crumb]], progress=lambda *what: told.append(what)))
    np.testing.assert_array_equal(fit.values, refined.fit(problem_of(log)).values)
    assert [stage for stage, _, _ in told] == [
        f"fitting, step {step}" for step in range(1, fit.iterations + 1)
    ]
    assert {(done, total) for _, done, total in told} == {(2000, 2000)}
    crumbs = refined.fit(problem_of(log, crumb))
    np.testing.assert_array_equal(crumbs.values, fit.values)
    assert len(crumbs.logs) == 1


def test_a_short_log_does_not_hide_its_torques_noise_in_its_angles(bench: Bench) -> None:
    """Of 0.3 s neighbouring torques tell the noise of 1e-2 N m to a tenth.

    The likelihood had a twentieth of it.
    """
    levels = []
    for seed in range(4):
        log = bench.log(sigma=1e-3, seed=seed).part(100 * seed, 100 * seed + 300)
        fit = refined.fit(problem_of(log))
        levels.append(fit.noise[0].tau)
    assert np.min(levels) > 0.7e-2
