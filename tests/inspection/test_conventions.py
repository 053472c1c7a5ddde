"""What a finding says of a wrong convention reads the log as it was recorded, whatever it was read
by before.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.inspection.conventions import judged, mend
from algid.log import Log
from algid.notices import Notice
from algid.profile import Profile, with_settings
from algid.readers import read_log
from algid.writers import write_log
from pipelines.conventions import SPOILS, Spoil
from tests.inspection.test_checks import moving_log

RIGHT = moving_log()


def mended(log: Log) -> Notice | None:
    """What sets a log right, by every convention tried on it."""
    return mend(log.origin, judged(log))


WRONG: dict[str, Spoil] = {
    "all signs": SPOILS["all signs"],
    "joints swapped": SPOILS["joints swapped"],
    "torques swapped": SPOILS["torques swapped"],
    "joint 1 from behind, hanging": lambda a, b, s, t: (-a - np.pi / 2, b, -s, t),
    "absolute, hanging": lambda a, b, s, t: (a + np.pi / 2, a + b + np.pi / 2, s, t),
    "base, tau2 reversed": lambda a, b, s, t: (a, b, s - t, -t),
    "motor": lambda a, b, s, t: (9.6 * a, b, s, t),
    "zero of joint 2, absolute, reversed": lambda a, b, s, t: (a, -(a + b) - 0.5, s, -t),
    # within what reads as rad
    "degrees": lambda a, b, s, t: (np.degrees(a) / 20, np.degrees(b) / 20, s, t),
}


def recorded(path: Path, name: str) -> Path:
    """The log with that mistake."""
    spoil = WRONG.get(name, SPOILS["nothing"])
    signals = np.stack(spoil(*RIGHT.theta, *RIGHT.tau))
    write_log(path, replace(RIGHT, theta=signals[:2], tau=signals[2:], omega=None))
    return path


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        *((row, "csv") for row in WRONG),
        ("joints swapped", "mcap"),
        ("torques swapped", "mcap"),
    ],
)
def test_the_settings_named_mend_the_log(row: str, kind: str, tmp_path: Path) -> None:
    path = recorded(tmp_path / f"arm.{kind}", row)
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
    path = recorded(tmp_path / "arm.csv", row)
    profile = with_settings(Profile(), wrong)
    found = mended(read_log(path, profile))
    assert found is not None
    log = read_log(path, with_settings(profile, found.remedies[0].settings))
    assert mended(log) is None
