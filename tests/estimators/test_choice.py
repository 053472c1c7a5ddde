"""The terms of the torque that logs choose, and how late they show it to act."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import algid
from algid.arm import CONSTANT_NAMES
from algid.base.names import named_values
from algid.estimators.log_likelihood import opened
from algid.estimators.misfit import Products
from algid.estimators.problem import WeakSettings
from algid.estimators.terms import CHOICE, Selection, select
from algid.identification.identify import identify
from algid.model import RIGID, Model
from algid.signals.segments import Segment
from algid.synth.sensors import Sensors
from pipelines import elastic
from tests.estimators.conftest import Bench, problem_of
from tests.estimators.test_terms import term_log, term_values
from tests.intervals import distances

SETTINGS = WeakSettings(bandwidth=60.0)


def _of(log: Segment, **asked: object) -> Selection:
    return select(problem_of(log, settings=SETTINGS), **asked)  # type: ignore[arg-type]


def _chosen(bench: Bench, terms: tuple[str, ...], **asked: object) -> Selection:
    model = Model(terms, coulomb_speed=0.05)
    values = term_values(bench, terms)
    bare, burdened = (term_log(bench, model, values, loaded) for loaded in (False, True))
    known = problem_of(bare, loaded=[burdened], settings=SETTINGS)
    return select(known, **asked)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "terms",
    [(), ("coulomb",), ("offset", "rotor"), ("load",), ("gain",), ("phases",), ("lag",)],
    ids="+".join,
)
def test_the_terms_that_are_there_are_chosen_and_no_other(
    bench: Bench, terms: tuple[str, ...]
) -> None:
    chosen = _chosen(bench, terms)
    assert chosen.model.terms == terms
    assert (chosen.delay, chosen.refuted, chosen.chosen_by) == (False, False, "logs")
    assert {trial.term for trial in chosen.trials if trial.kept} == set(terms)
    assert len(chosen.trials) == len(CHOICE)


def test_terms_that_physics_does_not_allow_or_that_need_another_are_left_out(bench: Bench) -> None:
    """Drives that push with the motion are as evident as friction is."""
    log = bench.log(sigma=1e-4)
    pushed = replace(log, tau=log.tau - 0.1 * np.tanh(bench.bare.omega / 0.05))
    chosen = _of(pushed, candidates=("coulomb", "stribeck"))
    trials = {trial.term: trial for trial in chosen.trials}
    assert trials["coulomb"].reason == "left out: its value would contradict physics"
    assert trials["coulomb"].evidence > 0
    assert trials["stribeck"].reason == "left out: no meaning without coulomb"
    assert chosen.model.terms == ()
    asked = _of(pushed, candidates=("coulomb",), kept=("coulomb",))
    assert asked.model.terms == ("coulomb",)
    assert asked.trials[0].reason == "asked for"


def test_what_sampling_makes_of_a_log_without_noise_is_no_term() -> None:
    """Six terms are evident in it, a delay first."""
    exact, _ = algid.synthesise("case1", duration=4.0, torque="wide", sensors=Sensors())
    chosen = _of(Segment(0.0, 1e-3, exact.theta, exact.tau))
    assert (chosen.model.terms, chosen.delay, chosen.refuted) == ((), False, False)
    reasons = {trial.term: trial.reason for trial in chosen.trials}
    assert reasons["delay"] == "left out: explains less than sampling leaves open"


@pytest.mark.parametrize("samples", [6, -6], ids=["late", "early"])
def test_a_torque_that_acts_late_or_early_is_a_delay_and_no_lag(bench: Bench, samples: int) -> None:
    """A lag would lag the more the faster the torque."""
    log = bench.log(sigma=1e-4)
    count = len(log) - abs(samples)
    theta, tau = max(-samples, 0), max(samples, 0)
    shifted = replace(
        log,
        theta=log.theta[:, theta : theta + count],
        tau=log.tau[:, tau : tau + count],
        omega=None,
    )
    chosen = _of(shifted, candidates=("delay",))
    assert (chosen.delay, chosen.model.terms) == (True, ())
    late = chosen.late
    assert late.half == 0.5 * log.dt
    assert late.late == pytest.approx(samples * log.dt, abs=5e-2 * log.dt)


def test_rounding_that_is_left_of_a_log_without_noise_is_no_evidence(bench: Bench) -> None:
    """The mean square of what any term leaves is one, as of noise that is what it is taken for."""
    at = {False: named_values(CONSTANT_NAMES, bench.arm.constants())}
    products = Products(opened(problem_of(bench.log())), Model(), at, 0.0)
    assert {products.mean_square(products.columns([term])) for term in CHOICE} == {1.0}


def test_a_rotor_that_is_hardly_significant_stays_where_the_constants_would_take_it_up() -> None:
    """k1, k3 and k5 were 5 to 12 of their deviations off without it, in a result that was Good."""
    ((truth, _, logs),) = elastic.scenes(0.0, "digital PD", range(1072, 1073), 1)
    result = identify(logs, report=False)
    (trial,) = (one for one in result.fit.terms if one.term == "rotor")
    assert trial.kept
    assert trial.evidence < 0
    assert np.abs(distances(result, truth, RIGID)).max() < 4
