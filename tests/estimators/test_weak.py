from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.innovations import pooled
from algid.estimators.modulating_functions import row_weights
from algid.estimators.problem import Problem, WeakSettings
from algid.model import Model
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from tests.intervals import holds_95, in_axes

from .conftest import Bench, problem_of


def test_recorded_velocities_serve_as_well(bench: Bench) -> None:
    fit = weak.fit(problem_of(bench.log(), settings=WeakSettings(bandwidth=None)))
    assert np.allclose(fit.values, bench.truth[:7], rtol=1e-6)  # quadrature alone
    without = replace(bench.log(), omega=None)
    with pytest.raises(ValueError, match="no velocities"):
        weak.fit(problem_of(without, settings=WeakSettings(bandwidth=None)))


def test_no_window_is_lost_between_pieces(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    log = bench.log(sigma=1e-3)
    problem = problem_of(log, settings=WeakSettings(window=0.2))
    (whole,) = weak.normals_of(problem)
    monkeypatch.setattr(weak, "PIECE_SAMPLES", 1111)
    (cut,) = weak.normals_of(problem)
    assert np.array_equal(whole.rows, cut.rows)
    assert np.allclose(whole.total, cut.total, rtol=1e-11)


@pytest.mark.slow
def test_intervals_of_a_long_log_hold() -> None:
    """A minute has blocks enough for the sandwich.

    Windows that overlap make its residuals coloured.
    """
    case, dt = load_case("case1"), 4e-3
    k = case.arm.constants()
    motion = simulate(k, wide_multi_sine(case.arm, 3), np.arange(15_000) * dt)

    def ratios(seed: int) -> FloatArray:
        noise = np.random.default_rng(seed).standard_normal((2, *motion.theta.shape))
        log = Segment(0.0, dt, motion.theta + 1e-4 * noise[0], motion.tau + 1e-2 * noise[1])
        fit = weak.fit(problem_of(log))
        assert fit.intervals == "sandwich"
        return in_axes(fit.values - k, fit.covariance, fit.quantile)

    holds_95(np.array([ratios(seed) for seed in range(120)]))


def test_a_gap_starts_new_windows(bench: Bench) -> None:
    log = bench.log()
    first, second = log.part(0, 1800), replace(log.part(2300, 4001), continues=False)
    log_with_gap = Problem([lambda: [first, second]])
    fit = weak.fit(log_with_gap)
    assert np.allclose(fit.values, bench.truth[:7], rtol=1e-3)
    # the residual is that of two logs, of 4.5 windows and 4.25: no pair lies on both sides
    whole, *parts = (
        weak.residuals(source, WeakSettings(), fit.values)
        for source in (*log_with_gap.unloaded, *problem_of(first, second).unloaded)
    )
    np.testing.assert_allclose(whole.products, pooled(parts).products, rtol=1e-9)


def test_what_is_kept_of_a_log_serves_any_model_and_windows(bench: Bench) -> None:
    problem, memory = problem_of(bench.log()), weak.Memory()
    for settings in (
        WeakSettings(),
        WeakSettings(window=0.2),
        WeakSettings(bandwidth=20.0),
        WeakSettings(Model(("coulomb",))),
        WeakSettings(Model(("coulomb",), coulomb_speed=0.2), estimate_delay=True),
    ):
        asked = replace(problem, settings=settings)
        (kept,), (anew,) = weak.normals_of(asked, memory=memory), weak.normals_of(asked)
        np.testing.assert_array_equal(kept.gram, anew.gram)


def test_a_joint_without_a_motor_weighs_as_if_it_were_missed_by_a_tenth_of_the_driven_one() -> None:
    """However well its equation is solved: 10 rows leave squares of 1, so of 5 it leaves 1/200."""
    gram = np.array([np.eye(2), np.diag([1.0, 0.0])])
    weights = row_weights(gram, np.array([0.0, 1.0]), np.array([10.0, 5.0]))
    np.testing.assert_allclose(weights, [10, 1000])
