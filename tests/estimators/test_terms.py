"""Each term of the torque, found again by both estimators on exact motions with a little noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.signal import lfilter

from algid.arm import CONSTANT_NAMES, FloatArray, forward_dynamics
from algid.estimators import instruments, refined, weak
from algid.estimators.fit import Fit
from algid.estimators.problem import WeakSettings
from algid.model import TERMS, UNITS, Model, Motion
from algid.signals.segments import Segment
from tests.estimators.by_hand import evaluated, torque_by_hand
from tests.estimators.conftest import DT, Bench, problem_of

SIGMA = 1e-4  # rad, and ten times as many N m
VALUES = {
    "coulomb": (0.3, 0.1),
    "offset": (0.1, -0.05),
    "rotor": (0.004,),
    "stribeck": (0.3, 0.1),
    "asymmetry": (0.05, -0.03),
    "load": (0.05, 0.08),
    "gain": (-0.04,),
    # k1s / k2s = l1 / g: centres of mass off their lines, zeros right
    "phases": (
        0.1626e-3,
        9.81e-3,
        0.03,
    ),
    "elastic": (2e-3, 8e-3, 0.3),
    "lag": (5e-3,),
}


def term_values(bench: Bench, terms: tuple[str, ...]) -> dict[str, float]:
    found = dict(zip(CONSTANT_NAMES, bench.arm.constants().tolist(), strict=True))
    for term in terms:
        found |= dict(zip(TERMS[term].names, VALUES[term], strict=True))
    return found


def term_log(
    bench: Bench,
    model: Model,
    values: dict[str, float],
    loaded: bool = False,
    noise: float = SIGMA,
) -> Segment:
    """A log with SymPy's torque along an exact motion, with `noise` of the angles in rad."""
    moved = bench.burdened if loaded else bench.bare
    k = bench.arm.constants(bench.payload if loaded else 0.0)
    alpha = forward_dynamics(k, moved.theta, moved.omega, moved.tau)
    here = {**values, **dict(zip(CONSTANT_NAMES, k.tolist(), strict=True))}
    tau = evaluated(torque_by_hand(), model, here, Motion(moved.theta, moved.omega, alpha))[:, 0]
    theta = moved.theta
    if "lag" in values:
        tau = _behind(tau, values["lag"])
    if "h1" in values:
        theta, tau = _behind_springs(here, model, Motion(moved.theta, moved.omega, alpha))
    rng = np.random.default_rng(loaded)
    drawn = noise * rng.standard_normal((2, *tau.shape))
    return Segment(0.0, DT, theta + drawn[0], tau + 10 * drawn[1])


def _behind_springs(
    values: dict[str, float], model: Model, links: Motion
) -> tuple[FloatArray, FloatArray]:
    """Angles and torques of the motors of links with an exact motion, by Spong's equations."""
    rotor = values["r1"] * values["k5"]
    own = {**values, "k5": values["k5"] - rotor, "k6": 0.0, "k7": 0.0}
    load = evaluated(torque_by_hand(), model, own, links)[:, 0]
    theta = links.theta + np.array([[values["h1"]], [values["h2"]]]) * load
    t = np.arange(theta.shape[1]) * DT
    spline = make_interp_spline(t, theta.T, k=7)
    omega, alpha = (spline.derivative(order)(t).T for order in (1, 2))
    viscous = np.array([[values["k6"]], [values["k7"]]]) * omega
    return theta, load + viscous + np.array([[rotor], [0.0]]) * alpha


def _behind(tau: FloatArray, lag: float) -> FloatArray:
    """What a first-order low-pass shows of a torque that is straight between its samples."""
    decay = np.exp(-DT / lag)
    mean = (1 - decay) * lag / DT
    shown, _ = lfilter([1 - mean, mean - decay], [1, -decay], tau, axis=1, zi=mean * tau[:, :1])
    return np.asarray(shown)


FITS = {"weak": weak.fit, "refined": refined.fit, "instruments": instruments.fit}


def _fit(
    estimator: str, model: Model, log: Segment, loaded: Sequence[Segment] = (), **more: Any
) -> Fit:
    settings = WeakSettings(model=model, **more)
    return FITS[estimator](problem_of(log, loaded=loaded, settings=settings))


@pytest.mark.parametrize("estimator", ["weak", "refined"])
@pytest.mark.parametrize("samples", [20, 50])
def test_long_delays_are_found(bench: Bench, estimator: str, samples: int) -> None:
    log = bench.log(sigma=SIGMA)
    late = replace(log, theta=log.theta[:, :-samples], tau=log.tau[:, samples:], omega=None)
    fit = _fit(estimator, Model(), late, estimate_delay=True)
    assert (fit.estimator, fit.names[-1]) == (estimator, "delay")
    assert abs(fit.values[-1] - samples * DT) < 5 * fit.std[-1] < 0.05 * samples * DT


@pytest.mark.parametrize(
    ("estimator", "term"),
    [
        *product(("weak", "refined"), TERMS),
        *product(["instruments"], ("coulomb", "offset", "rotor")),
    ],
)
def test_each_term_is_found(bench: Bench, estimator: str, term: str) -> None:
    needed = TERMS[term].needs
    terms = (term,) if needed is None else (needed, term)
    model, values = Model(terms), term_values(bench, terms)
    fit = _fit(estimator, model, term_log(bench, model, values))
    assert fit.estimator == estimator
    assert fit.converged
    assert set(fit.status) == {"OK"}
    truth = np.array([values[name] for name in fit.names])
    own = [fit.names.index(name) for name in TERMS[term].names]
    assert np.all(np.abs(fit.values - truth)[own] < 0.1 * np.abs(truth[own]))
    # nine values at most: 5 σ is one in a million
    assert np.all(np.abs(fit.values - truth) < 5 * fit.std)


@pytest.mark.parametrize("estimator", ["weak", "refined"])
def test_terms_that_are_not_linear_are_found_under_a_payload_too(
    bench: Bench, estimator: str
) -> None:
    model = Model(("load", "gain", "phases"))
    values = term_values(bench, model.terms)
    fit = _fit(
        estimator,
        model,
        term_log(bench, model, values),
        [term_log(bench, model, values, loaded=True)],
    )
    assert fit.estimator == estimator
    known = {**values, "m_p": bench.payload, "l1": bench.arm.l1, "l2": bench.arm.l2}
    truth = np.array([known[name] for name in fit.names])
    assert np.all(np.abs(fit.values - truth) < 5 * fit.std)
    assert np.all(
        fit.std
        < 0.05 * np.array([1.0 if UNITS[n] in ("1", "rad") else known[n] for n in fit.names])
    )
