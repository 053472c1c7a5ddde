"""Physical bounds, worth of terms, payload of another arm, prediction."""

from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import combine as combine_module
from algid.estimators import weak
from algid.estimators.combine import (
    BlockSums,
    LogInformation,
)
from algid.estimators.diagnostics import (
    broken_bounds,
    repeatability,
)
from algid.estimators.fit import finish
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import WeakSettings
from algid.model import Model
from tests.identification.fits import CASE, fit_of, information, with_values
from tests.intervals import holds_95

from .conftest import Bench, problem_of


@pytest.mark.parametrize("seed", range(4))
def test_block_sums_are_of_stretches_one_after_the_other(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Odd counts and even, a few at a time and many: each sum is of as many stretches as the
    others, or the last.
    """
    monkeypatch.setattr(combine_module, "MOST_BLOCKS", 8)
    rng = np.random.default_rng(seed)
    sums, told = BlockSums(), rng.standard_normal((300, 1))
    for block in np.split(told, np.cumsum(rng.integers(1, 12, 50))):
        sums.add(block)
    found = sums.values()[:, 0]
    assert 8 <= found.size <= 17
    factor = 2 ** int(np.ceil(np.log2(300 / found.size)))
    expected = np.add.reduceat(told[:, 0], range(0, 300, factor))
    np.testing.assert_allclose(found, expected, atol=1e-12)


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


def test_each_loaded_run_tells_its_payload_and_how_well_that_repeats() -> None:
    """Three payloads in turn, 5 g apart: each is found by itself, and the standard deviation has
    the interval of χ².
    """
    fit = fit_of()
    masses = CASE.payload + np.array([-0.005, 0.0, 0.005])
    loaded = [fit.shared.coefficients(with_values(fit, m_p=mass).values, True) for mass in masses]
    logs = [fit.logs[0], *(information(c.size, loaded=True, c0=c) for c in loaded)]
    alone, std, (low, high) = repeatability(replace(fit, logs=tuple(logs)))
    np.testing.assert_allclose(alone, masses, rtol=1e-9)
    assert std == pytest.approx(0.005)
    # χ² with two degrees of freedom: 0.0506 and 7.378
    assert low / std == pytest.approx(np.sqrt(2 / 7.378), rel=1e-3)
    assert high / std == pytest.approx(np.sqrt(2 / 0.05064), rel=1e-3)
    assert repeatability(fit) is None


@pytest.mark.parametrize("rotor", [0.0, 0.02])
def test_a_mass_matrix_that_is_not_positive_definite_breaks_its_bound(
    bench: Bench, rotor: float
) -> None:
    """By the least eigenvalue of M(θ2), eq. (2), with the rotor in M22, over a turn."""
    settings = WeakSettings(Model(("rotor",) if rotor else ()))
    fit = weak.fit(problem_of(bench.log(sigma=1e-3), settings=settings))
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
