"""What the integration of a log without noise leaves in its estimates, and that intervals hold it.

The simulators here are none of algid's: the equation of motion is written out, and integrated by
the rules of Euler or by SciPy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import algid
from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.results import Result
from pipelines import noiseless

DT, DURATION = 1e-3, 3.0
T = np.arange(round(DURATION / DT) + 1) * DT
ARM = Arm(
    m1=2.1, m2=1.4, lc1=0.17, lc2=0.14, l1=0.38, l2=0.31, I1=0.025, I2=0.011, b1=0.8, b2=0.5, g=9.81
)
K = ARM.constants()
LOADS = np.array([K[3], K[1]])
HANGING = np.array([-np.pi / 2, 0.0])


def reference(t: float) -> FloatArray:
    """Angles (2,) that the joints are to follow."""
    first = 0.5 * np.sin(2.4 * t) + 0.3 * np.sin(9.1 * t + 1)
    second = 0.6 * np.sin(3.3 * t + 2) + 0.25 * np.sin(11.7 * t)
    return HANGING + np.array([first, second])


def torque(t: float, q: FloatArray, w: FloatArray) -> FloatArray:
    """A PD controller's."""
    return 8 * LOADS * (reference(t) - q) - 0.8 * LOADS * w


def mass(q: FloatArray) -> FloatArray:
    coupled = K[2] + K[0] * np.cos(q[1])
    return np.array([[K[4] + K[2] + 2 * K[0] * np.cos(q[1]), coupled], [coupled, K[2]]])


def acceleration(
    q: FloatArray, w: FloatArray, tau: FloatArray, implicit: float = 0.0
) -> FloatArray:
    """Eq. (1) by hand; viscous friction acts on the velocity `implicit` seconds later."""
    sine = K[0] * np.sin(q[1])
    coriolis = np.array([-sine * (2 * w[0] * w[1] + w[1] ** 2), sine * w[0] ** 2])
    outer = K[1] * np.cos(q[0] + q[1])
    gravity = np.array([K[3] * np.cos(q[0]) + outer, outer])
    force = tau - coriolis - gravity - K[5:7] * w
    return np.linalg.solve(mass(q) + implicit * np.diag(K[5:7]), force)


def by_semi_implicit_euler(dt: float, implicit: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Angles and torques (2, N) at `T`, integrated at steps of `dt`."""
    every = round(DT / dt)
    q, w = reference(0.0), np.zeros(2)
    angles, torques = [], []
    for step in range(every * (T.size - 1) + 1):
        tau = torque(step * dt, q, w)
        if step % every == 0:
            angles.append(q)
            torques.append(tau)
        w = w + dt * acceleration(q, w, tau, implicit)
        q = q + dt * w
    return np.array(angles).T, np.array(torques).T


def exactly() -> tuple[FloatArray, FloatArray]:
    """The same, solved to rounding."""

    def slope(t: float, x: FloatArray) -> FloatArray:
        return np.concatenate([x[2:], acceleration(x[:2], x[2:], torque(t, x[:2], x[2:]))])

    start = np.concatenate([reference(0.0), np.zeros(2)])
    solved = solve_ivp(
        slope, (0, T[-1]), start, t_eval=T, rtol=1e-11, atol=1e-12, method="DOP853"
    ).y
    logged = [torque(t, x[:2], x[2:]) for t, x in zip(T, solved.T, strict=True)]
    return solved[:2], np.array(logged).T


def identified(angles: FloatArray, torques: FloatArray) -> Result:
    return algid.identify(algid.Log.from_arrays(T, angles, torques))


def distances(result: Result) -> FloatArray:
    """How far each constant is from the truth, in half widths of its interval."""
    found = [result.parameters[name] for name in CONSTANT_NAMES]
    assert all(one.ci95 is not None for one in found)
    bounds = np.array([one.ci95 for one in found], dtype=np.float64)
    return np.asarray((bounds.mean(axis=1) - K) / (0.5 * np.diff(bounds)[:, 0]))


RULES = {
    "explicit damping": lambda: by_semi_implicit_euler(DT),
    "implicit damping": lambda: by_semi_implicit_euler(DT, implicit=DT),
    "a finer step": lambda: by_semi_implicit_euler(DT / 2),
}


@pytest.mark.parametrize("simulated", RULES.values(), ids=list(RULES))
def test_intervals_hold_what_an_integrator_of_first_order_makes_of_an_arm(
    simulated: Callable[[], tuple[FloatArray, FloatArray]],
) -> None:
    result = identified(*simulated())
    assert np.all(np.abs(distances(result)) < 1)
    assert "SLOW_SAMPLING" in [note.code for note in result.verdict.notes]
    # no wider than what the step makes: b h / 2 of the inertia that it acts on
    k5 = result.parameters["k5"]
    assert k5.std is not None
    assert k5.std < DT * K[5]


def test_a_log_that_is_solved_exactly_keeps_its_small_intervals() -> None:
    result = identified(*exactly())
    assert np.all(np.abs(distances(result)) < 1)
    assert not [note for note in result.verdict.notes if note.code == "SLOW_SAMPLING"]
    errors = [result.parameters[name].std for name in CONSTANT_NAMES]
    assert np.max(np.array(errors) / K) < 1e-6


def test_noise_that_hides_the_integrator_leaves_the_intervals_as_they_are() -> None:
    angles, torques = by_semi_implicit_euler(DT)
    rng = np.random.default_rng(1)
    angles = angles + 1e-3 * rng.standard_normal(angles.shape)
    torques = torques + 2e-2 * rng.standard_normal(torques.shape)
    result = identified(angles, torques)
    assert not [note for note in result.verdict.notes if note.code == "SLOW_SAMPLING"]


@pytest.mark.parametrize("seed", [3, 5])
def test_a_log_in_open_loop_ends_in_an_answer(seed: int) -> None:
    """Its noise is so small that the last steps trembled by their deviations for ever."""
    log, constants = noiseless.logged(seed, "Euler", 1e-3, 1, open_loop=True)
    result = algid.identify(log)
    assert result.estimator == "refined"
    for name, true in zip(CONSTANT_NAMES, constants, strict=True):
        low, high = result.parameters[name].ci95 or (None, None)
        assert low is not None
        assert high is not None
        assert low <= true <= high
