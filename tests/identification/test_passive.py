"""Arms with a joint that has no motor: an acrobot's first, a pendubot's second."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from algid.arm import CONSTANT_NAMES
from algid.base.errors import LogError
from algid.estimators import instruments, refined, robust, weak
from algid.estimators.problem import Problem
from algid.identification.identify import identify
from algid.log import Log
from algid.signals.segments import Segment, segments
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines import passive as scenes
from pipelines.accuracy_scenes import case_of
from tests.cli.commands import app
from tests.estimators.conftest import problem_of
from tests.intervals import distances, holding, holds_at_least_95, in_axes

DT = 2e-3
SIGMA = 1e-3  # rad; ten times as much in N m


@cache
def moved(case: str, passive: int, duration: float = 5.0) -> SimulatedMotion:
    arm = load_case(case).arm
    wide = wide_multi_sine(arm, 3)
    driven = np.array([[float(passive != 1)], [float(passive != 2)]])
    return simulate(
        arm.constants(), lambda t: wide(t) * driven, np.arange(round(duration / DT) + 1) * DT
    )


def logged(motion: SimulatedMotion, seed: int, sigma: float = SIGMA) -> Segment:
    rng = np.random.default_rng(seed)
    noise = sigma * rng.standard_normal((2, *motion.theta.shape))
    return Segment(
        0.0, DT, motion.theta + noise[0], np.where(motion.tau != 0, motion.tau + 10 * noise[1], 0.0)
    )


@cache
def log_of(name: str, passive: int, seed: int) -> Log:
    """One draw of `make passive`."""
    return scenes.log_of(name, passive, seed)


@pytest.mark.parametrize("estimator", [weak.fit, instruments.fit, refined.fit])
@pytest.mark.parametrize("passive", [1, 2])
def test_exact_logs_give_exact_constants(estimator: object, passive: int) -> None:
    """Without noise both residuals are rounding: neither may drown the other joint's equation,
    which sets the scale.
    """
    fit = estimator(problem_of(logged(moved("case1", passive), 0, 0.0)))  # type: ignore[operator]
    # the bound is the weak form's quadrature at 500 Hz
    np.testing.assert_allclose(fit.values, load_case("case1").arm.constants(), rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("passive", [1, 2])
def test_intervals_hold_where_a_joint_has_no_motor(passive: int) -> None:
    motion, k = moved("case1", passive), load_case("case1").arm.constants()
    fits = [refined.fit(problem_of(logged(motion, seed))) for seed in range(80)]
    # The motorless row has a noise of its own, a thousandth of the other joint's torque; here it
    # has none.
    holds_at_least_95(
        np.array([in_axes(fit.values - k, fit.covariance, fit.quantile) for fit in fits])
    )


def test_a_torque_that_is_zero_is_refused_until_the_joint_is_called_passive(tmp_path: Path) -> None:
    log = logged(moved("case1", 2), 0)
    columns = np.column_stack([np.arange(len(log)) * DT, *log.theta, *log.tau])
    file = tmp_path / "log.csv"
    np.savetxt(file, columns, delimiter=",", header="t,theta1,theta2,tau1,tau2", comments="")
    with pytest.raises(LogError, match=r"EFFORT_ZERO.*--set passive=2"):
        identify(file)
    done = CliRunner().invoke(
        app, ["identify", str(file), "--set", "passive=2", "-o", str(tmp_path), "--no-report"]
    )
    assert done.exit_code == 0, done.output
    assert "EFFORT_ZERO" not in done.output


def test_instruments_tell_what_least_squares_takes_for_nothing() -> None:
    """Cables pull as hard as the weight of the passive joint: constants near nothing solve its
    equation all but exactly, and draw least squares. The other joint's sensor is 0.05 N m off.
    """
    log = log_of("case1", 1, 0)
    result = identify(replace(log, tau=log.tau + [[0.0], [0.05]]), report=False)
    assert result.estimator == "instruments"
    assert result.fit.model.terms == ["offset"]
    assert "delay" not in result.parameters
    assert result.verdict.grade == "reservations"
    assert "INSTRUMENTS" in [notice.code for notice in result.notices]
    k = case_of("case1").arm.constants()
    assert holding(result, k) == len(k)
    found = np.array([result.parameters[name].estimate for name in CONSTANT_NAMES])
    assert np.all(np.abs(found - k) < 0.5 * k)  # nearer to them than to nothing


def test_instruments_that_forbidden_constants_come_of_do_not_stand() -> None:
    """A torque of the other sign turns the whole arm round, which no instrument makes physical."""
    segments_of = list(segments([log_of("case1", 2, 0)]))
    turned = [replace(segment, tau=-segment.tau) for segment in segments_of]
    assert robust.of_passive_joint(Problem([lambda: segments_of])) is not None
    assert robust.of_passive_joint(Problem([lambda: turned])) is None


def test_cables_of_two_percent_leave_the_constants_told() -> None:
    result = identify(log_of("arm22", 2, 0), report=False)
    assert {"HARDLY_DRIVEN", "JOINTS_CONTRADICT"}.isdisjoint(
        notice.code for notice in result.notices
    )
    k = case_of("arm22").arm.constants()
    assert np.abs(distances(result, k)).max() < 4.5
    found = np.array([result.parameters[name].estimate for name in CONSTANT_NAMES])
    assert np.all(np.abs(found - k) < 0.1 * k)
