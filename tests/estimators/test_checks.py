"""Physical bounds, worth of terms, payload of another arm, prediction."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from algid.arm import inverse_dynamics
from algid.estimators import combine as combine_module
from algid.estimators import weak
from algid.estimators.combine import (
    MOST_BLOCKS,
    BlockSums,
    LogInformation,
    long_run_variance,
)
from algid.estimators.diagnostics import (
    broken_bounds,
    repeatability,
)
from algid.estimators.fit import finish
from algid.estimators.identifiability import examine, sizes
from algid.estimators.parametrisation import Shared
from algid.estimators.prediction import motion_of, score
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.identification.by_likelihood import Fitted
from algid.identification.checks import remarks
from algid.model import Model
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.synth.cases import load_case
from tests.intervals import holds_95

from .conftest import DT, Bench


def test_a_perfect_fit_of_an_arm_that_turns_round_explains_all_torque() -> None:
    k = load_case("case1").arm.constants()
    t = 1e-3 * np.arange(6001)
    # six turns a second, swings of 2 Hz
    theta = np.stack([40 * t + np.sin(9 * t), 3 * np.sin(14 * t)])
    omega = np.stack([40 + 9 * np.cos(9 * t), 42 * np.cos(14 * t)])
    alpha = np.stack([-81 * np.sin(9 * t), -588 * np.sin(14 * t)])
    log = Segment(0.0, 1e-3, theta, inverse_dynamics(k, theta, omega, alpha))
    assert np.all(score(Model(), k, [log]).r2 > 0.9999)
    # a torque acts 20 ms after its stamp
    late = replace(log, theta=log.theta[:, :-20], tau=log.tau[:, 20:])
    assert np.all(score(Model(), k, [late], TorqueShift(delay=0.02)).r2 > 0.9999)
    assert np.all(score(Model(), k, [late]).r2 < 0.99)


def test_a_parameters_size_is_the_largest_of_its_class() -> None:
    """Of friction a tenth of √(inertia × gravity) at least, of a payload what loads the arm as it
    loads itself.
    """
    names = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "f1", "j2", "delay")
    values = np.array([-0.02, 3.0, 0.05, -4.0, 0.03, 0.001, 0.002, 0.5, 1e-3, 1e-5])
    inertia, gravity, damping = 0.05, 4.0, 0.1 * np.sqrt(0.05 * 4.0)
    expected = [
        inertia,
        gravity,
        inertia,
        gravity,
        inertia,
        damping,
        damping,
        gravity,
        inertia,
        1e-3,
    ]
    np.testing.assert_allclose(sizes(names, values), expected, rtol=1e-12)
    rubbing = values.copy()
    rubbing[6] = -7.0
    assert sizes(names, rubbing)[[5, 6]].tolist() == [7.0, 7.0]
    turned = values[[2, 1, 4, 3, 0, *range(5, 10)]]  # whichever of its class is the largest
    np.testing.assert_allclose(sizes(names, turned), expected, rtol=1e-12)
    np.testing.assert_allclose(
        sizes(("k1", "k4", "m_p"), np.array([0.3, 9.81, 0.01])), [0.3, 9.81, 1.0]
    )
    np.testing.assert_allclose(
        sizes(("k1", "k4", "m_p", "l1"), np.array([0.3, 9.81, 0.01, 0.2]))[2:], [0.01, 0.2]
    )


def test_what_is_hardly_told_widens_what_it_mixes_with() -> None:
    """Friction with a Coulomb column where there is none: its variance is that of the inverse,
    nothing dropped.
    """
    S = np.array([[4e4, 3.8e4], [3.8e4, 4e4]])
    known = examine(("k6", "f1"), np.array([0.1, 1e-5]), S, np.array([1.0, 1.0]))
    assert np.allclose(known.covariance, np.linalg.inv(S), rtol=1e-10)


def test_block_sums_stay_bounded_and_lose_nothing() -> None:
    sums, total = BlockSums(), 0.0
    rng = np.random.default_rng(0)
    for _ in range(60):
        block = rng.standard_normal((701, 2))
        sums.add(block)
        total = total + block.sum(axis=0)
    assert sums.values().shape[0] <= 2 * MOST_BLOCKS + 1
    assert np.allclose(sums.values().sum(axis=0), total)


@pytest.mark.parametrize("seed", range(4))
def test_block_sums_are_of_stretches_one_after_the_other(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Odd counts and even, a few at a time and many: each sum is of as many stretches as the
    others, or the last.
    """
    monkeypatch.setattr(combine_module, "MOST_BLOCKS", 8)
    rng = np.random.default_rng(seed)
    sums, told = BlockSums(), []
    for size in rng.integers(1, 12, 50):
        block = rng.standard_normal((size, 1))
        sums.add(block)
        told += block[:, 0].tolist()
    found = sums.values()[:, 0]
    factor = next(f for f in (1, 2, 4, 8, 16, 32, 64) if len(told) <= f * found.size)
    assert 8 < found.size <= 17
    expected = [sum(told[first : first + factor]) for first in range(0, len(told), factor)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_long_run_variance_of_an_autoregression() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((20000, 1))
    scores = np.zeros_like(noise)
    for step in range(1, noise.size):
        scores[step] = 0.6 * scores[step - 1] + noise[step]
    variance, lags = long_run_variance(scores)
    assert lags > 5
    # spectrum at zero
    assert variance[0, 0] / noise.size == pytest.approx(1 / (1 - 0.6) ** 2, rel=0.15)


def test_intervals_of_a_few_logs_hold_where_runs_differ() -> None:
    """Five logs of an arm that differs from run to run, of independent parameters.

    The jackknife itself is exact for logs alike; with the normal quantile 88 % of the intervals
    held the truth.
    """
    rng = np.random.default_rng(0)
    shared = Shared(Model(gravity=0.0))
    size = len(shared.log_names)
    ratios = []
    for _ in range(200):
        logs = []
        for _ in range(5):
            own = rng.standard_normal(size)  # the truth is 0
            S = np.repeat(4.0 * np.eye(size)[None], 40, axis=0)
            g = rng.standard_normal((40, size)) * 2.0 + S @ own
            logs.append(LogInformation(False, np.zeros(size), S, g))
        fit = finish("weak", shared, logs, np.zeros(size), np.ones(2), coloured=True)
        assert fit.intervals == "jackknife"
        ratios.append(fit.values / (fit.quantile * np.sqrt(np.diag(fit.covariance))))
    holds_95(np.array(ratios))


def test_each_loaded_run_tells_its_payload_and_how_well_that_repeats(bench: Bench) -> None:
    """Three payloads in turn, 5 g apart: each is found by itself, and the standard deviation has
    the interval of χ².
    """
    masses = bench.payload + np.array([-0.005, 0.0, 0.005])
    z = bench.arm.payload_constants(1.0)
    bare: list[Source] = [partial(list, [bench.log(sigma=1e-4, seed=seed)]) for seed in range(3)]
    added = np.zeros(7)
    added[[4, 2, 0, 3, 1]] = z  # k5, k3, k1, k4, k2
    motion = bench.burdened
    share = inverse_dynamics(
        added, motion.theta, motion.omega, np.gradient(motion.omega, DT, axis=1, edge_order=2)
    )
    burdened: list[Source] = []
    for seed, mass in enumerate(masses):
        log = bench.log(loaded=True, sigma=1e-4, seed=seed)
        burdened.append(partial(list, [replace(log, tau=log.tau + (mass - bench.payload) * share)]))
    fit = weak.fit(Problem(bare, burdened, lengths={"l1": bench.arm.l1, "l2": bench.arm.l2}))
    found = repeatability(fit)
    assert found is not None
    np.testing.assert_allclose(found.masses, masses, atol=6e-4)
    assert found.std == pytest.approx(0.005, rel=0.15)
    low, high = found.ci95  # χ² with two degrees of freedom: 0.0506 and 7.378
    assert low / found.std == pytest.approx(np.sqrt(2 / 7.378), rel=1e-3)
    assert high / found.std == pytest.approx(np.sqrt(2 / 0.05064), rel=1e-3)
    assert (
        repeatability(
            weak.fit(Problem(bare, burdened[:1], lengths={"l1": bench.arm.l1, "l2": bench.arm.l2}))
        )
        is None
    )


def test_constants_of_no_length_and_exchanged_logs_break_bounds(bench: Bench) -> None:
    """k1 k2 = m2² g l1 lc2² (Table 1); logs in each other's place make a payload below nothing."""
    fit = weak.fit(Problem([lambda: [bench.log(sigma=1e-3)]]))
    turned = replace(fit, values=fit.values * np.array([1, -1, 1, 1, 1, 1, 1]))
    (broken,) = [bound for bound in broken_bounds(turned) if bound.bound == "k1 k2 >= 0"]
    assert broken.distance is not None
    assert broken.distance > 20
    assert not [bound for bound in broken_bounds(fit) if bound.bound == "k1 k2 >= 0"]
    # det M is positive again
    inside_out = replace(fit, values=fit.values * np.array([1, 1, -1, 1, -1, 1, 1]))
    (broken,) = [bound for bound in broken_bounds(inside_out) if bound.bound == "k5 >= 0"]
    assert broken.distance == pytest.approx(fit.values[4] / fit.std[4])
    both = weak.fit(
        Problem([lambda: [bench.log(loaded=True, sigma=1e-3)]], [lambda: [bench.log(sigma=1e-3)]])
    )
    assert any(warning.code == "LOGS_APART" for warning in remarks(Fitted(both)))
    right = weak.fit(
        Problem([lambda: [bench.log(sigma=1e-3)]], [lambda: [bench.log(loaded=True, sigma=1e-3)]])
    )
    assert not any(warning.code == "LOGS_APART" for warning in remarks(Fitted(right)))


@pytest.mark.parametrize("rotor", [0.0, 0.02])
def test_a_mass_matrix_that_is_not_positive_definite_breaks_its_bound(
    bench: Bench, rotor: float
) -> None:
    """By the least eigenvalue of M(θ2), eq. (2), with the rotor in M22, over a turn."""
    settings = WeakSettings(Model(("rotor",) if rotor else ()))
    fit = weak.fit(Problem([partial(list, [bench.log(sigma=1e-3)])], settings=settings))
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(200):
        k1, k3, k5 = rng.uniform(-0.1, 0.1), rng.uniform(-0.05, 0.1), rng.uniform(-0.02, 0.1)
        values = fit.values.copy()
        values[[fit.names.index(name) for name in ("k1", "k3", "k5")]] = k1, k3, k5
        if rotor:
            values[fit.names.index("j2")] = rotor
        inertial = [
            bound
            for bound in broken_bounds(replace(fit, values=values))
            if " M" in f" {bound.bound}"
        ]
        # the least lies at an end: it may not fall between two of these
        c = np.cos(np.linspace(0, np.pi, 181))
        M = np.array(
            [[k5 + k3 + 2 * k1 * c, k3 + k1 * c], [k3 + k1 * c, np.full_like(c, k3 + rotor)]]
        )
        least = np.linalg.eigvalsh(np.moveaxis(M, 2, 0))[:, 0]
        assert bool(inertial) == bool(least.min() < 0)
        by_name = {bound.bound: bound.value for bound in inertial}
        ends = {"det M > 0 at theta2 = 0": 0, "det M > 0 at theta2 = pi": -1}
        for name, place in ends.items():
            determinant = float(np.linalg.det(M[:, :, place]))
            assert (name in by_name) == (determinant < 0)
            if name in by_name:
                assert by_name[name] == pytest.approx(determinant, rel=1e-9)
        if "M22 > 0" in by_name:
            assert by_name["M22 > 0"] == pytest.approx(k3 + rotor)
        seen |= set(by_name)
    assert seen == {*ends, "M22 > 0"}


def test_motion_by_five_points_is_exact_for_a_cubic_and_repeats_itself_at_the_ends() -> None:
    dt = 0.1
    t = dt * np.arange(12)
    motion = motion_of(np.stack([t**3 - t, 2 * t**2]), dt)
    inner, ends = slice(2, -2), [0, 1, -2, -1]
    np.testing.assert_allclose(
        motion.omega[:, inner], np.stack([3 * t**2 - 1, 4 * t])[:, inner], atol=1e-12
    )
    np.testing.assert_allclose(
        motion.alpha[:, inner], np.stack([6 * t, np.full_like(t, 4)])[:, inner], atol=1e-10
    )
    np.testing.assert_array_equal(motion.omega[:, ends], motion.omega[:, [2, 2, -3, -3]])
    np.testing.assert_array_equal(motion.alpha[:, ends], motion.alpha[:, [2, 2, -3, -3]])
