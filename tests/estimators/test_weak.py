from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.problem import Problem, WeakSettings
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
    fit = weak.fit(Problem([lambda: [first, second]]))
    assert np.allclose(fit.values, bench.truth[:7], rtol=1e-3)
