"""Torques that no driver logs: made of a desired angle and gains."""

from __future__ import annotations

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.profile import Profile, with_settings
from algid.readers import read_log

KP, KD = (50.0, 20.0), (2.0, 0.5)
LAWS = {
    f"tau{joint}": {"q_des": f"command{joint}", "kp": KP[joint - 1], "kd": KD[joint - 1]}
    for joint in (1, 2)
}


T = np.arange(200) * 0.01
THETA = np.stack([np.sin(T), np.cos(2 * T)])
OMEGA = np.stack([np.cos(T), -2 * np.sin(2 * T)])
COMMAND = THETA + 0.1 * np.stack([np.sin(3 * T), np.sin(5 * T)])
TAU = np.diag(KP) @ (COMMAND - THETA) - np.diag(KD) @ OMEGA
"""Torques (2, N) of the law in N m."""
DEGREES = dict(
    zip(("q1", "q2", "command1", "command2"), np.degrees([*THETA, *COMMAND]), strict=True)
)
STILL: dict[str, np.ndarray] = {"t": T, **DEGREES}
LOG = STILL | dict(zip(("dq1", "dq2"), np.degrees(OMEGA), strict=True))


def profile(**settings: object) -> Profile:
    unit = {"unit": "deg"}
    angles = dict.fromkeys(("theta1", "theta2", "omega1", "omega2"), unit)
    return with_settings(Profile(), {**angles, **LAWS, **settings})


def test_a_torque_is_made_of_a_desired_angle() -> None:
    assert np.allclose(read_log(LOG, profile()).tau, TAU, atol=1e-9)


def test_a_joint_that_counts_the_other_way_has_its_law_in_its_own_coordinates() -> None:
    turned = profile(signs=(-1, 1), offsets=(0.3, 0.0), zero="hanging")
    assert np.allclose(read_log(LOG, turned).tau, [[-1], [1]] * TAU, atol=1e-9)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"q_des": "command1"}, "a PD law of tau1 needs .*tau1.kp=VALUE"),
        ({"kp": 50.0}, "a PD law of tau1 needs .*tau1.q_des=NAME|no column for tau1"),
        ({"q_des": "nothing", "kp": 50.0}, "'nothing', which is not there"),
    ],
)
def test_a_law_that_lacks_something_has_one_line(law: dict[str, object], told: str) -> None:
    with pytest.raises(LogError, match=told) as raised:
        read_log(LOG, profile(tau1=law))
    assert "\n" not in str(raised.value)


def test_without_velocities_a_law_differentiates_the_angles() -> None:
    log = read_log(STILL, profile())
    assert log.omega is None
    # kd h² / 6 of the third derivative, 8 rad/s³ at most; first order at both ends
    np.testing.assert_allclose(log.tau[:, 1:-1], TAU[:, 1:-1], atol=2.0 * 0.01**2 / 6 * 8)
    np.testing.assert_allclose(log.tau, TAU, atol=2.0 * 0.01 / 2 * 4)
