"""Every term, in one loop: its partials, its moments over windows, its C source and its form,
against its columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.modulating_functions import Windows
from algid.model import EVERY_TERM, TERMS, Model, Motion, partials, regressor, torque
from algid.physics.effort import Effort, absent, without_terms
from algid.physics.signals import C12, S1, W2, Values, Widths
from algid.physics.terms import ALWAYS, OPTIONAL
from algid.signals.segments import Segment
from tests.estimators.test_model import VALUES
from tests.exports.test_peers import compiled, each, text_of

DT = 1e-3
IN_MODELS = [*(term.name for term in ALWAYS), *TERMS]


def model_with(term: str) -> Model:
    """The model with a term, and with what that needs."""
    needed = EVERY_TERM[term].needs
    wanted = [name for name in (needed, term) if name in TERMS]
    return Model(tuple(wanted), coulomb_speed=0.5, stribeck_speed=0.8)


def constants(model: Model) -> FloatArray:
    return np.array([VALUES[name] for name in model.names])


def moving(seconds: float = 2.0) -> Motion:
    """A closed-form motion at 1 kHz."""
    t = np.arange(round(seconds / DT)) * DT
    theta, omega, alpha = np.zeros((3, 2, t.size))
    for joint, waves in enumerate((((0.9, 2.1), (0.4, 5.3)), ((1.1, 1.3), (0.5, 6.1)))):
        for size, rate in waves:
            theta[joint] += size * np.sin(rate * t)
            omega[joint] += size * rate * np.cos(rate * t)
            alpha[joint] -= size * rate**2 * np.sin(rate * t)
    return Motion(theta, omega, alpha)


@pytest.mark.parametrize("term", IN_MODELS)
def test_partials_are_the_differences_of_the_torque(term: str) -> None:
    model, motion, step = model_with(term), moving(), 1e-6
    c = constants(model)
    P = partials(model, c, motion)
    signals = [motion.theta, motion.omega, motion.alpha]
    for order in range(3):
        for joint in range(2):
            both = []
            for sign in (1, -1):
                moved = [signal.copy() for signal in signals]
                moved[order][joint] += sign * step
                both.append(torque(model, c, Motion(moved[0], moved[1], moved[2])))
            slope = (both[0] - both[1]) / (2 * step)
            # rounding over the step
            np.testing.assert_allclose(P[order, :, joint], slope, atol=1e-7)


@pytest.mark.parametrize("term", [name for name in IN_MODELS if not EVERY_TERM[name].elastic])
def test_moments_over_windows_are_those_of_the_columns(term: str) -> None:
    """∫φ″ s - ∫φ′ p + ∫φ f against ∫φ times the column itself, which has accelerations."""
    model, motion = model_with(term), moving()
    at = None if model.linear else constants(model)
    windows = Windows(DT, 0.4, bandwidth=None)
    piece = Segment(0.0, DT, motion.theta, motion.theta, motion.omega)
    X = windows.equations(model, piece, at=at)
    Y = regressor(model, motion, at)
    for place, name in enumerate(model.names):
        if any(name == own for own, _ in EVERY_TERM[term].gains):
            continue  # a derivative, not a column: the estimators' own tests have it
        if name == model.lag_name:
            continue
        expected = windows.moments(Y[:, place])
        # the quadrature at 1 kHz
        np.testing.assert_allclose(X[:, place], expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("term", [name for name in IN_MODELS if EVERY_TERM[name].timing is None])
def test_the_c_source_is_the_torque(term: str, tmp_path: Path) -> None:
    model, motion = model_with(term), moving(0.3)
    value = {name: VALUES[name] for name in model.names}
    arm = compiled(text_of("c", value, model), tmp_path)
    found = each(arm.inverse_dynamics, motion.theta, motion.omega, motion.alpha)
    np.testing.assert_allclose(
        found, torque(model, constants(model), motion), rtol=1e-12, atol=1e-12
    )


def test_every_parameter_says_what_it_is() -> None:
    parameters = [one for term in (*ALWAYS, *OPTIONAL) for one in term.parameters]
    assert len({one.name for one in parameters}) == len(parameters)
    for one in parameters:
        assert one.meaning
        assert one.plausible[0] < one.plausible[1]
        assert one.sign == "±" or one.plausible[0] in (0.0, -np.inf)


@pytest.mark.parametrize("one", [0.5, 1, -1, -2.5])
@pytest.mark.parametrize("two", [0.5, 1, -1, -2.5])
def test_an_expression_its_sum_and_its_source_are_one_number(one: float, two: float) -> None:
    e, motion = one * S1 * W2 + two * C12 - two, moving(0.05)
    (q1, q2), (_, w2) = motion.theta, motion.omega
    expected = one * np.sin(q1) * w2 + two * np.cos(q1 + q2) - two
    value = Values(motion, Widths()).sum(e.products)
    known = {"s1": np.sin(q1), "w2": w2, "c12": np.cos(q1 + q2)}
    for found in (value, eval(e.source(), known)):
        np.testing.assert_allclose(found, expected, atol=1e-14)


RUBS = "k6 k7 f1 f2 s1 s2 a1 a2 e1 e2"


@pytest.mark.parametrize(
    ("effort", "gone", "terms"),
    [
        ("raw", "", ""),
        ("gravity-compensated", "k2 k4 k2s k4s", "elastic"),
        ("friction-compensated", RUBS, "coulomb stribeck asymmetry load"),
        (
            "external",
            f"k1 k2 k3 k4 k5 j2 gain2 k1s k2s k4s {RUBS}",
            "coulomb rotor stribeck asymmetry load gain elastic",
        ),
    ],
)
def test_what_a_driver_takes_off_is_none_of_the_arms(effort: Effort, gone: str, terms: str) -> None:
    names = [name for term in (*ALWAYS, *OPTIONAL) for name in term.names]
    assert set(absent(effort, names)) == set(gone.split())
    assert set(TERMS) - set(without_terms(effort, TERMS)) == set(terms.split())
