"""Profiles: units, signs, zero, references, clocks, several topics; and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.base.errors import SettingError
from algid.base.ros2 import HEADER
from algid.log import Log
from algid.profile import Profile, load_profile
from algid.readers import read_log
from algid.writers import write_log
from tests.readers.logs import EPOCH_NS, noise_log
from tests.readers.mcaps import Cdr, joint_state, write_mcap

WRENCH = (
    "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n"
    + "=" * 80
    + "\nMSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"
    + "=" * 80
    + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + HEADER
)


def read_with(tmp_path: Path, **settings: Any) -> tuple[Log, Log]:
    log = noise_log(100)
    write_log(tmp_path / "log.csv", log)
    return log, read_log(tmp_path / "log.csv", Profile.model_validate(settings))


def test_units_signs_and_offsets(tmp_path: Path) -> None:
    log, found = read_with(
        tmp_path,
        theta1={"unit": "deg"},
        theta2={"unit": "counts", "counts": 4096, "offset": 0.5},
        tau1={"unit": "mN m", "sign": -1},
        tau2={"unit": "A", "torque_constant": 0.05, "gear_ratio": 9, "offset": 0.1},
        omega1={"unit": "rpm"},
        signs=[-1, 1],
    )
    assert log.omega is not None
    assert found.omega is not None
    assert np.allclose(found.theta[0], -np.radians(log.theta[0]), rtol=1e-15)
    assert np.allclose(found.theta[1], log.theta[1] * 2 * math.pi / 4096 + 0.5, rtol=1e-15)
    assert np.allclose(found.tau[0], log.tau[0] * 1e-3, rtol=1e-15)
    assert np.allclose(found.tau[1], log.tau[1] * 0.45 + 0.1, rtol=1e-14)
    assert np.allclose(found.omega[0], -log.omega[0] * 2 * math.pi / 60, rtol=1e-15)


def test_signals_on_several_topics_are_aligned(tmp_path: Path) -> None:
    messages = []
    for step in range(2000):
        stamp = EPOCH_NS + step * 1_000_000
        t = step * 1e-3
        if step % 2 == 0:
            state = joint_state(stamp, ["a", "b"], [math.sin(t), math.cos(t)], (), [0.0, 0.0])
            messages.append(("/joints", stamp, state.done()))
        for joint in (1, 2):
            if step % 3 == 0 and not 900 < step < 1000:
                wrench = Cdr().put("i", stamp // 10**9).put("I", stamp % 10**9).text("")
                wrench.put("d", 0, 0, 0, 0, 0, joint * math.sin(3 * t))
                messages.append((f"/torque{joint}", stamp, wrench.done()))
    schema = ("geometry_msgs/msg/WrenchStamped", "ros2msg", WRENCH.encode())
    write_mcap(tmp_path / "log.mcap", messages, {f"/torque{joint}": schema for joint in (1, 2)})
    settings: dict[str, Any] = {
        f"tau{joint}": {"topic": f"/torque{joint}", "source": "wrench.torque.z"} for joint in (1, 2)
    }
    found = read_log(
        tmp_path / "log.mcap", Profile.model_validate({"joints": ["a", "b"], **settings})
    )
    times = (found.stamp_ns - EPOCH_NS) * 1e-9
    # linear interpolation over 3 ms of sin 3t: at most 9 (3e-3)^2 / 8
    assert (
        np.abs(found.tau - np.stack([np.sin(3 * times), 2 * np.sin(3 * times)])).max() < 2 * 1.02e-5
    )
    assert np.abs(found.theta[0] - np.sin(times)).max() < 1e-15  # not interpolated
    assert not np.any((times > 0.9) & (times < 0.998))
    cases = [notice.key for notice in found.notices]
    assert cases.count("ALIGNED:interpolated") == 2
    assert "ALIGNED:not covered" in cases


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("topics = 1", "topics.*not permitted"),
        ('[theta1]\nunit = "grad"', "theta1.unit"),
        ("[tau1]\ntorque_constant = -1", "torque_constant"),
        ("signs = [2, 1]", "signs"),
        ("gravity = nan", "gravity"),
        ("= 3", "not TOML"),
    ],
)
def test_profiles_are_strict(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "algid.toml").write_text(text)
    with pytest.raises(SettingError, match=told):
        load_profile(tmp_path / "algid.toml")
    with pytest.raises(SettingError, match="cannot read it"):
        load_profile(tmp_path / "none.toml")
