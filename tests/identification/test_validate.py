"""Predictions of logs that a result has not seen, against SciPy's filters on the simulator's own
motion.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from algid.arm import FloatArray, forward_dynamics, inverse_dynamics
from algid.identification.identify import identify
from algid.identification.recordings import Recordings, Role, open_source
from algid.identification.series import Predictor
from algid.identification.validate import validate
from algid.log import Log, Origin
from algid.model import Model
from algid.settings import Settings
from algid.signals.differences import TorqueShift
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion
from algid.synth.simulator import simulate as move

CASE = load_case("case1")
K = CASE.arm.constants()
DT = 4e-3
SIGMA = 0.02  # N m
EDGE = round(0.3 / DT)  # that the score leaves out


@cache
def moved(seed: int) -> SimulatedMotion:
    return move(K, wide_multi_sine(CASE.arm, seed), DT * np.arange(1001))


def logged(motion: SimulatedMotion, seed: int, *, lead: int = 0) -> Log:
    """Exact angles, torques with noise and logged `lead` samples early."""
    noise = SIGMA * np.random.default_rng(seed).standard_normal(motion.tau.shape)
    rows = motion.t.size - lead
    stamps = np.rint(motion.t[:rows] * 1e9).astype(np.int64)
    return Log(
        stamps,
        motion.theta[:, :rows],
        (motion.tau + noise)[:, lead:],
        Origin(f"log{seed}", "csv", {}),
    )


def low(x: FloatArray) -> FloatArray:
    return np.asarray(
        sosfiltfilt(butter(3, 5.0, fs=1 / DT, output="sos"), x, axis=-1)[..., EDGE:-EDGE]
    )


def columns(motion: SimulatedMotion, k: FloatArray = K) -> FloatArray:
    """The paper's regressor (7, 2, N) on the true motion, below 5 Hz."""
    alpha = forward_dynamics(k, motion.theta, motion.omega, motion.tau)
    return low(
        np.stack([inverse_dynamics(k, motion.theta, motion.omega, alpha) for k in np.eye(7)])
    )


def known(k: FloatArray, shift: float = 0.0) -> Predictor:
    return Predictor(Model(), lambda _: k, TorqueShift(delay=shift))


def survey(*logs: tuple[Log, Role]) -> Recordings:
    return Recordings([open_source(log, role) for log, role in logs])


@pytest.fixture(scope="module")
def motions() -> list[SimulatedMotion]:
    return [moved(seed) for seed in (3, 5, 7)]


@pytest.mark.parametrize("wrong", [False, True])
def test_a_hold_out_score_is_that_of_scipys_filters_on_the_true_motion(
    motions: list[SimulatedMotion], wrong: bool
) -> None:
    k = K * (1 + 0.1 * np.array([1, -1, 1, 1, -1, 1, -1])) if wrong else K
    log = logged(motions[0], 1)
    found = validate(known(k), survey((log, "unloaded"))).logs["log1"]
    Y, tau = columns(motions[0]), low(log.tau)
    residual = tau - np.einsum("p,pjn->jn", k, Y)
    rms = np.sqrt(np.mean(residual**2, axis=1))
    # the score's own filter differs at the ends, and it differentiates angles that pass 20 Hz
    np.testing.assert_allclose(found.rmse, rms, rtol=0.05, atol=0.1 * SIGMA)
    np.testing.assert_allclose(
        found.nrmse, rms / np.sqrt(np.mean(tau**2, axis=1)), rtol=0.1, atol=2e-3
    )
    np.testing.assert_allclose(
        found.r2, 1 - rms**2 / np.var(tau, axis=1), atol=2e-3 if not wrong else 0.02
    )


def test_a_torque_that_acts_late_is_predicted_where_it_acts(motions: list[SimulatedMotion]) -> None:
    early = logged(motions[0], 1, lead=6)
    right, wrong = (
        validate(known(K, shift), survey((early, "unloaded"))).total for shift in (6 * DT, 0.0)
    )
    exact = validate(known(K), survey((logged(motions[0], 1), "unloaded"))).total
    np.testing.assert_allclose(right.rmse, exact.rmse, rtol=0.05)
    assert wrong.rmse[0] > 5 * right.rmse[0]


def test_an_arm_simulated_with_its_own_constants_follows_its_log(
    motions: list[SimulatedMotion],
) -> None:
    logs = survey((logged(motions[0], 1), "unloaded"))
    arm = Predictor(Model(), {"unloaded": K}.__getitem__)
    found = validate(arm, logs, simulate=True).simulation
    assert found["log1"] == found["all logs"]
    assert [row["horizon"] for row in found["log1"]] == [0.1, 0.5, 2.0]
    assert all(max(row["rmse"]) < 0.05 * min(row["moved"]) for row in found["log1"])


def test_cross_validation_is_the_prediction_of_each_log_by_a_fit_of_the_others(
    motions: list[SimulatedMotion],
) -> None:
    """By hand: least squares on the true motion of two logs, scored on the third, for each in
    turn.
    """
    logs = [logged(motion, seed) for seed, motion in enumerate(motions)]
    settings = Settings(estimator="weak", model="plain", cross_validate=True)
    result = identify(logs, None, settings, report=False)
    Y, tau = [columns(motion) for motion in motions], [low(log.tau) for log in logs]
    squares, count = np.zeros(2), 0
    for out in range(3):
        kept = [place for place in range(3) if place != out]
        A = np.concatenate([Y[place].reshape(7, -1).T for place in kept])
        b = np.concatenate([tau[place].ravel() for place in kept])
        k = np.linalg.lstsq(A, b, rcond=None)[0]
        left = tau[out] - np.einsum("p,pjn->jn", k, Y[out])
        squares, count = squares + np.sum(left**2, axis=1), count + left.shape[1]
    np.testing.assert_allclose(result.fit.cross_validation.rmse, np.sqrt(squares / count), rtol=0.1)
    assert np.all(np.array(result.fit.cross_validation.rmse) > np.array(result.fit.residual.rmse))
