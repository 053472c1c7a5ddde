"""Torques that drive a simulated arm: closed forms, holds, and what is refused.

Cases and their files.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.arm import Arm, inverse_dynamics
from algid.base.errors import SettingError
from algid.synth.cases import load_case
from algid.synth.excitation import Hold, SampledTorque, wide_multi_sine


@pytest.mark.parametrize(
    ("hold", "between", "just_before"),
    [("zoh", [1.0, -2.0], [1.0, -2.0]), ("foh", [2.0, 0.0], [3.0, 2.0])],
)
def test_a_sampled_torque_is_held_or_joined(
    hold: Hold, between: list[float], just_before: list[float]
) -> None:
    torque = SampledTorque(
        np.array([0.0, 1.0, 3.0]), np.array([[1.0, 3.0, 5.0], [-2.0, 2.0, 4.0]]), hold
    )
    found = torque(np.array([-1.0, 0.0, 0.5, 1.0 - 1e-12, 1.0, 3.0, 9.0]))
    expected = np.array([[1, -2], [1, -2], between, just_before, [3, 2], [5, 4], [5, 4]]).T
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_a_file_of_lengths_and_masses_is_an_arm_of_uniform_links(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    text = "[arm]\nm1 = 3.0\nm2 = 1.2\nl1 = 0.5\nl2 = 0.4\n"
    file.write_text(text, encoding="utf-8")
    case = load_case(str(file))
    assert case.name == "mine"
    assert case.arm == Arm(
        3.0, 1.2, 0.25, 0.2, 0.5, 0.4, 3.0 * 0.5**2 / 12, 1.2 * 0.4**2 / 12, 0.0, 0.0, 9.81
    )
    assert (case.payload, case.torque, case.paper_error_percent) == (0.0, None, {})
    file.write_text(
        text + "lc2 = -0.1\nI1 = 0.0\nb2 = 0.3\ng = 0.0\n[payload]\nm_p = 0.7\n", encoding="utf-8"
    )
    case = load_case(str(file))
    assert (case.arm.lc2, case.arm.I1, case.arm.b2, case.arm.g, case.payload) == (
        -0.1,
        0.0,
        0.3,
        0.0,
        0.7,
    )
    np.testing.assert_allclose([case.arm.lc1, case.arm.I2], [0.25, 1.2 * 0.4**2 / 12])


JOINT = "[torque.joint{}]\namplitude = {}\nfrequency = [1.0]\nphase = [0.0]\n"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("m3 = 1.0\n", "arm.m3: "),
        ("g = -1.0\n", "arm.g: "),
        ("b1 = inf\n", "arm.b1: "),
        ("lc1 = nan\n", "arm.lc1: "),
        ("[payload]\nm_p = -0.1\n", "payload.m_p: "),
        ("[payload]\nmass = 0.1\n", "payload.m"),
        (
            "[torque.joint1]\namplitude = []\nfrequency = []\nphase = []\n",
            "torque.joint1.amplitude: ",
        ),
        (
            JOINT.format(1, "[1.0, 2.0]") + JOINT.format(2, "[1.0]"),
            "need the same number of harmonics",
        ),
        (JOINT.format(1, "[1.0]"), "torque.joint2: "),
        ("[paper_error_percent]\nk1 = 0.0\n", "paper_error_percent.k1: "),
        ("m1 = 1.0\n", "not TOML ("),
    ],
)
def test_a_file_that_describes_no_arm_is_refused_with_its_line(
    more: str, message: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[arm]\nm1 = 3.0\nm2 = 1.2\nl1 = 0.5\nl2 = 0.4\n" + more, encoding="utf-8")
    with pytest.raises(SettingError) as refused:
        load_case(str(file))
    assert str(refused.value).startswith(f"{file}: ")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("joint", [0, 1])
def test_the_wide_torque_is_six_waves_of_what_a_joint_needs(joint: int) -> None:
    """Stretched out, at 4 rad/s and 40 rad/s²."""
    arm, t = load_case("case1").arm, np.linspace(0.0, 1.0, 7)
    wave, push = wide_multi_sine(arm, 3), np.eye(2)[:, joint : joint + 1]
    need = inverse_dynamics(arm.constants(), 0 * push, 4 * push, 40 * push)[joint, 0]
    np.testing.assert_allclose(wave.amplitude[joint], 6 * [0.6 * need])
    f, phase = np.array(wave.frequency[joint]), np.array(wave.phase[joint])
    np.testing.assert_allclose(f, 0.3 * (8 / 0.3) ** (np.arange(6) / 5))
    assert 0 < phase.min() < phase.max() < 2 * np.pi
    expected = 0.6 * need * np.sin(2 * np.pi * np.outer(t, f) + phase).sum(axis=1)
    np.testing.assert_allclose(wave(t)[joint], expected)
    assert wide_multi_sine(arm, 4).phase != wave.phase == wide_multi_sine(arm, 3).phase
