"""What a finding says of a wrong convention reads the log as it was recorded, whatever it was read
by before.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.inspection.conventions import judged, mend
from algid.log import Log
from algid.notices import Notice
from algid.profile import Profile, with_settings
from algid.readers import read_log
from algid.writers import write_log
from tests.inspection.test_checks import moving_log

RIGHT = moving_log()


def mended(log: Log) -> Notice | None:
    """What sets a log right, by every convention tried on it."""
    return mend(log.origin, judged(log))


def written(path: Path, theta: FloatArray, tau: FloatArray) -> Path:
    write_log(path, replace(RIGHT, theta=theta, tau=tau, omega=None))
    return path


def recorded(name: str) -> tuple[FloatArray, FloatArray]:
    (a, b), (p, q) = RIGHT.theta, RIGHT.tau
    match name:
        case "all signs":
            return -RIGHT.theta, -RIGHT.tau
        case "joint 1 from behind, hanging":
            return np.stack([-a - np.pi / 2, b]), np.stack([-p, q])
        case "absolute, hanging":
            return np.stack([a + np.pi / 2, a + b + np.pi / 2]), RIGHT.tau
        case "right":
            return RIGHT.theta, RIGHT.tau
        case "swapped":
            return RIGHT.theta[::-1], RIGHT.tau[::-1]
        case "torques swapped":
            return RIGHT.theta, RIGHT.tau[::-1]
        case "base, tau2 reversed":
            return RIGHT.theta, np.stack([p - q, -q])
        case "motor":
            return np.stack([9.6 * a, b]), RIGHT.tau
        case "zero of joint 2, absolute, reversed":
            return np.stack([a, -(a + b) - 0.5]), np.stack([p, -q])
        case _:
            return np.degrees(RIGHT.theta) / 20, RIGHT.tau  # within what reads as rad


ROWS = (
    "all signs",
    "joint 1 from behind, hanging",
    "absolute, hanging",
    "swapped",
    "torques swapped",
    "base, tau2 reversed",
    "motor",
    "zero of joint 2, absolute, reversed",
    "degrees",
)


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        *((row, "csv") for row in ROWS),
        ("swapped", "mcap"),
        ("torques swapped", "mcap"),
    ],
)
def test_the_settings_named_mend_the_log(row: str, kind: str, tmp_path: Path) -> None:
    path = written(tmp_path / f"arm.{kind}", *recorded(row))
    found = mended(read_log(path))
    assert found is not None
    log = read_log(path, with_settings(Profile(), found.remedies[0].settings))
    assert mended(log) is None
    turned = log.tau[1] @ RIGHT.tau[1] < 0  # from behind
    right = np.stack([np.pi - RIGHT.theta[0], -RIGHT.theta[1]]) if turned else RIGHT.theta
    # the settings have six digits, zeros and free scales are fitted to a thousandth
    assert np.allclose(np.exp(1j * log.theta), np.exp(1j * right), atol=0.01)
    assert np.allclose(log.tau, -RIGHT.tau if turned else RIGHT.tau)


@pytest.mark.parametrize(
    ("row", "wrong"),
    [
        (
            "right",
            {"signs": [-1, 1], "tau1": {"sign": -1}, "zero": "hanging", "offsets": [0.0, 3.0]},
        ),
        ("absolute, hanging", {"second_angle": "absolute", "offsets": [-0.4, -0.4]}),
        ("right", {"second_angle": "absolute", "zero": "hanging"}),
        ("right", {"drive": "base"}),
        ("right", {"angle_unit": "rev"}),
        ("right", {"angle_unit": "deg"}),
        ("motor", {"theta1": {"gear_ratio": 50}}),
    ],
)
def test_settings_change_what_a_profile_said(
    row: str, wrong: dict[str, Any], tmp_path: Path
) -> None:
    path = written(tmp_path / "arm.csv", *recorded(row))
    profile = with_settings(Profile(), wrong)
    found = mended(read_log(path, profile))
    assert found is not None
    log = read_log(path, with_settings(profile, found.remedies[0].settings))
    assert mended(log) is None
