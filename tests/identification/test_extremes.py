"""Logs that are too short or too slow for an estimator or lack what it needs, and values that no
arm has: one line that says so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import AlgidError, LogError
from algid.estimators.convention_search import Recorded, judge_together
from algid.identification.identify import identify
from algid.identification.recordings import Recordings, open_source
from algid.log import Log, Origin
from algid.profile import Profile
from algid.settings import Settings
from algid.signals.observers import observed
from algid.signals.segments import segments
from algid.writers import write_log
from pipelines import false_alarms


def moving(rate: float, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (N,), angles and torques (2, N) of two sines."""
    t = np.arange(0.0, seconds, 1 / rate)
    return t, np.stack([np.sin(2 * t), np.cos(3 * t)]), np.stack([3 * np.cos(t), np.sin(2 * t)])


def log_of(t: FloatArray, theta: FloatArray, tau: FloatArray) -> Log:
    return Log(np.rint(t * 1e9).astype(np.int64), theta, tau, Origin("log", "", {}))


@pytest.mark.parametrize(("rate", "seconds"), [(20, 1), (5, 10), (1, 30)])
def test_a_log_too_short_for_the_likelihood_is_refused_with_what_it_takes(
    rate: float, seconds: float
) -> None:
    log = log_of(*moving(rate, seconds))
    said = (
        "no unloaded log is long enough for the likelihood: expected at least 72 samples "
        "without a gap"
    )
    with pytest.raises(LogError, match=f"{said}; record longer"):
        identify(log, report=False)
    assert identify(log, settings=Settings(estimator="paper"), report=False).parameters


def test_a_loaded_log_too_short_for_the_likelihood_is_refused() -> None:
    with pytest.raises(LogError, match="no loaded log is long enough for the likelihood"):
        identify(log_of(*moving(100, 10)), log_of(*moving(10, 5)), report=False)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            {"estimator": "paper", "observer": "zero-phase"},
            (
                "--set observer zero-phase: the paper's method observes as the paper does; leave "
                "it out, say --set velocity=measured, or use --estimator refined or weak"
            ),
        ),
        (
            {"estimator": "weak", "velocity": "measured"},
            (
                "log: expected velocities omega1, omega2 for --set velocity=measured, found none; "
                "they are observed by --set velocity=observer"
            ),
        ),
    ],
)
def test_velocities_that_an_estimator_cannot_have_are_refused(
    settings: dict[str, str], said: str
) -> None:
    with pytest.raises(AlgidError) as refused:
        identify(log_of(*moving(100, 10)), settings=Settings().but(**settings), report=False)
    assert str(refused.value) == said


def test_the_observer_has_the_poles_that_are_asked_for() -> None:
    log, poles = log_of(*moving(100, 2)), (-9.0, -9.5, -10.0, -20.0, -21.0, -22.0)
    source = open_source(log, "unloaded")
    settings = Settings(estimator="paper", poles=poles)
    seen = Recordings([source]).with_velocities(source, settings)
    for one, alone in zip(seen, observed(segments([log]), poles), strict=True):
        np.testing.assert_array_equal(one.omega, alone.omega)


@pytest.mark.parametrize("spike", [1e6, 1e29])
def test_a_spike_in_an_angle_is_no_convention(spike: float, tmp_path: Path) -> None:
    t, theta, tau = moving(100, 10)
    assert judge_together([Recorded(theta, tau, 0.01)]) is not None
    theta[0, 500] += spike
    assert judge_together([Recorded(theta, tau, 0.01)]) is None
    path = tmp_path / "log.parquet"
    write_log(path, log_of(t, theta, tau))
    with pytest.raises(LogError, match="DEGREES: angles reach"):
        identify(path, report=False)
    profile = Profile(accept=("DEGREES",))
    assert identify(
        path, settings=Settings(estimator="weak"), profile=profile, report=False
    ).parameters


def test_turns_that_gaps_leave_open_are_no_degrees_where_the_likelihood_stands() -> None:
    log = false_alarms.log_of(72398)[0]
    assert np.ptp(log.theta) > 12 * np.pi
    assert {one.code for one in identify(log, report=False).verdict.reasons} == {"GAPS"}
    t, theta, tau = moving(500, 2)
    wrong = identify(log_of(t, np.degrees(theta), tau), report=False)
    assert "DEGREES:reach" in {one.key for one in wrong.verdict.reasons}


def test_a_spike_in_a_torque_overflows_nothing() -> None:
    t, theta, tau = moving(100, 10)
    tau[1, 333] += 1e29
    assert identify(log_of(t, theta, tau), report=False).parameters


@pytest.mark.parametrize("place", [(0.0, None), (0.0, 0.0)])
def test_joints_that_never_move_are_no_fault(place: tuple[float, float | None]) -> None:
    t, theta, tau = moving(200, 4)
    tau += np.random.default_rng(1).normal(scale=5e-3, size=tau.shape)
    for joint, angle in enumerate(place):
        theta[joint] = theta[joint] if angle is None else angle
    assert identify(log_of(t, theta, tau), report=False).verdict.grade == "failed"
