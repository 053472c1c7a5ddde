from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from algid.arm import Arm, FloatArray, with_payload
from algid.estimators import weak
from algid.estimators import weak as normal
from algid.estimators.combine import LogInformation, Prior
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.model import Model
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from tests.intervals import holds_95, in_axes

from .conftest import Bench


def _cut(log: Segment, *edges: int) -> list[Segment]:
    ends = [0, *edges, len(log)]
    return [log.part(first, last) for first, last in pairwise(ends)]


def test_recorded_velocities_serve_as_well(bench: Bench) -> None:
    fit = weak.fit(Problem([lambda: [bench.log()]], settings=WeakSettings(bandwidth=None)))
    assert np.allclose(fit.values, bench.truth[:7], rtol=1e-6)  # quadrature alone
    without = replace(bench.log(), omega=None)
    with pytest.raises(ValueError, match="no velocities"):
        weak.fit(Problem([lambda: [without]], settings=WeakSettings(bandwidth=None)))


def test_blocks_of_any_size_give_the_same_normal_equations(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(normal, "PIECE_SAMPLES", 1111)
    log = bench.log(sigma=1e-3)
    whole = normal.normal_equations(lambda: [log], WeakSettings(window=0.2))
    cut = normal.normal_equations(lambda: _cut(log, 17, 1200, 1201, 3500), WeakSettings(window=0.2))
    assert whole is not None
    assert cut is not None
    assert np.array_equal(whole.gram, cut.gram)
    monkeypatch.setattr(normal, "PIECE_SAMPLES", 16384)
    single = normal.normal_equations(lambda: [log], WeakSettings(window=0.2))
    assert single is not None
    assert np.array_equal(single.rows, whole.rows)  # no window is lost between pieces
    assert np.allclose(single.gram.sum(axis=0), whole.gram.sum(axis=0), rtol=1e-11)


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
        fit = weak.fit(Problem([lambda: [log]]))
        assert fit.intervals == "sandwich"
        return in_axes(fit.values - k, fit.covariance, fit.quantile)

    holds_95(np.array([ratios(seed) for seed in range(300)]))


def test_a_gap_starts_new_windows(bench: Bench) -> None:
    log = bench.log()
    first, second = log.part(0, 1800), replace(log.part(2300, 4001), continues=False)
    fit = weak.fit(Problem([lambda: [first, second]]))
    assert np.allclose(fit.values, bench.truth[:7], rtol=1e-3)


@pytest.mark.parametrize("delay", [False, True])
@pytest.mark.parametrize("known", [False, True])
def test_what_is_told_without_a_log_is_what_the_others_tell(
    bench: Bench, known: bool, delay: bool
) -> None:
    """The jackknife's estimates against fits of the other logs, with unloaded logs or an earlier
    result beside them.
    """
    settings = WeakSettings(estimate_delay=delay)
    cut = [0, 1300, 2600, 4001]
    bare: list[Source] = [
        partial(list, [bench.log(False, 1e-4).part(*ends)]) for ends in pairwise(cut)
    ]
    burdened: list[Source] = [
        partial(list, [bench.log(True, 1e-4, seed).part(*cut[:3:2])]) for seed in range(4)
    ]
    prior = None
    if known:
        before = weak.fit(Problem(bare))
        prior, bare = Prior.of(before.names, before.values, before.covariance), []
    fit = weak.fit(Problem(bare, burdened, settings, prior=prior))
    assert fit.intervals == "jackknife"
    assert fit.without is not None
    assert len(fit.without) == len(bare) + len(burdened)
    for place, told in enumerate(fit.without):
        rest = [source for number, source in enumerate(bare) if number != place]
        rest_loaded = [
            source for number, source in enumerate(burdened) if len(bare) + number != place
        ]
        alone = weak.fit(Problem(rest, rest_loaded, settings, prior=prior))
        # a delay found anew is linearised anew
        assert np.all(np.abs(told - alone.values) < (0.02 if delay else 1e-4) * fit.std)


@pytest.mark.parametrize("lengths", [{}, {"l1": None}, {"l1": None, "l2": None}], ids=len)
def test_a_first_payload_is_the_one_that_the_loaded_constants_hold(
    lengths: dict[str, None],
) -> None:
    """Arms drawn at random, each with its payload: all its constants from the bare ones by Table
    2.
    """
    rng = np.random.default_rng(7)
    for _ in range(40):
        m1, m2, l1, l2, i1, i2 = rng.uniform(0.1, 1.0, 6)
        arm = Arm(4 * m1, 4 * m2, l1 / 2, l2 / 2, l1, l2, i1 / 10, i2 / 10, 0.1, 0.1)
        mass = float(10 ** rng.uniform(-1.5, 0.7))
        known = {name: {"l1": l1, "l2": l2}[name] for name in lengths}
        shared = Shared(Model(), False, True, known)
        bare = arm.constants()
        X = rng.standard_normal((40, 7)) / bare
        S = X.T @ X * 1e6
        loaded = LogInformation(
            True, with_payload(bare, arm.payload_constants(mass)), S[None], np.zeros((1, 7))
        )
        truth = np.concatenate(
            [bare, [{"m_p": mass, "l1": l1, "l2": l2}[name] for name in shared.names[7:]]]
        )
        np.testing.assert_allclose(weak.first_payload(shared, bare, loaded), truth, rtol=1e-3)
