"""A controller makes torque of its encoders' noise: no delay is seen in that, and others are.

The simulator shares no equation with algid. Noise and torque correlate by the controller's delay,
which the score test took for one of the arm's.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from algid.estimators import refined
from algid.estimators.fit import Fit
from algid.estimators.problem import WeakSettings
from algid.notices import has_code
from algid.signals.differences import TorqueShift
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from pipelines.accuracy_scenes import waves
from pipelines.simulator import Controller, Plan, controlled, inertias
from tests.estimators.conftest import problem_of

RATE, SECONDS, NOISE = 1000.0, 8.0, 2e-3


@cache
def follower() -> Segment:
    """Case 1's arm behind a digital PD controller whose encoders are noisy."""
    k = load_case("case1").arm.constants()
    stiffness, inertia = 2 * np.pi * 4.0, inertias(k)
    gains = inertia * stiffness**2, 1.4 * inertia * stiffness
    count = round(SECONDS * RATE)
    t = np.arange(2 * count - 1) / (2 * RATE)
    turns = np.array([[0.4, 1.1, 1.9], [0.6, 1.3, 2.3]])
    theta, omega, _ = waves(t, turns, np.full((2, 3), 0.4), np.zeros((2, 3)))
    theta[0] -= np.pi / 2
    weight = np.stack([k[3] * np.cos(theta[0]), 0 * t]) + k[1] * np.cos(theta.sum(axis=0))
    rng = np.random.default_rng(3)
    controller = Controller(*gains, digital=True, seen=NOISE)
    plan = Plan(theta, omega, weight)
    _, torques, seen = controlled(k, plan, controller, np.zeros(2), RATE, rng)
    tau = torques + 1e-2 * rng.standard_normal((2, count))
    return Segment(0.0, 1 / RATE, seen, tau)


def fitted(log: Segment) -> Fit:
    return refined.fit(problem_of(log, settings=WeakSettings(shift=TorqueShift(held=True))))


def test_noise_that_is_fed_back_is_no_delay() -> None:
    fit = fitted(follower())
    assert not fit.refuted
    truth = load_case("case1").arm.constants()
    assert np.all(np.abs(fit.values - truth) < 4 * fit.std)


def test_a_delay_is_seen_behind_noise_that_is_fed_back() -> None:
    """The torque is logged two samples before it acts."""
    log = follower()
    late = replace(log, theta=log.theta[:, :-2], tau=log.tau[:, 2:])
    fit = fitted(late)
    assert has_code(fit.notes, "REFUTED:motion")
    plain, delay = (fit.products.columns(terms) for terms in ((), ("delay",)))
    assert fit.products.solve(plain)[1] - fit.products.solve(delay)[1] > 25
