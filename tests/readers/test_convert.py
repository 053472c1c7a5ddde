"""Units, gears, zeros and references: by the definitions of the units, by power, and against
numpy's unwrap.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import constants

from algid.base.units import CURRENT, TORQUE, VELOCITY
from algid.log import ChannelReading, Log
from algid.profile import Profile, with_settings
from algid.readers import read_log
from algid.readers.log_reader import unwrap
from algid.readers.table import CHANNELS
from tests.readers.headers import opened

TURN = 2 * np.pi
TORQUES = {
    "N m": 1, "mN m": constants.milli, "N cm": constants.centi, "kN m": constants.kilo,
    "kgf m": constants.kgf, "kgf cm": constants.kgf * constants.centi,
    "lbf ft": constants.lbf * constants.foot, "lbf in": constants.lbf * constants.inch,
    "ozf in": constants.ounce * constants.g * constants.inch,
}  # fmt: skip
ANGLES = {"rad": 1, "mrad": constants.milli, "deg": constants.degree, "rev": TURN}
VELOCITIES = {**ANGLES, "rpm": TURN / constants.minute}


def readings(
    settings: dict[str, Any], stated: dict[str, str] | None = None
) -> dict[str, ChannelReading]:
    return dict(opened(["t", *CHANNELS], settings, stated).origin.reading.channels)


def test_the_units_are_those_known_here() -> None:
    assert (set(TORQUES), set(VELOCITIES), set(CURRENT)) == (
        set(TORQUE),
        set(VELOCITY),
        {"A", "mA"},
    )


@pytest.mark.parametrize("gear", [1.0, 100.0])
def test_every_unit_on_either_side_of_a_gear(gear: float) -> None:
    """A motor turns `gear` times as far as its joint, and its torque is that much smaller."""
    for name, units, turns in (
        ("tau1", TORQUES, gear), ("theta2", ANGLES, 1 / gear), ("omega2", VELOCITIES, 1 / gear),
    ):  # fmt: skip
        for unit, size in units.items():
            found = readings({name: {"unit": unit, "gear_ratio": gear}})[name]
            assert found.factor == pytest.approx(size * turns, rel=1e-12)
    drive = {"torque_constant": 0.05, "gear_ratio": gear}
    for unit, size in (("A", 1), ("mA", 1e-3)):
        found = readings({"tau2": drive}, {"tau2": unit})["tau2"]
        assert (found.unit, found.told) == (unit, "names")
        assert found.factor == pytest.approx(0.05 * gear * size, rel=1e-12)
    counts = readings({"theta1": {"unit": "counts", "counts": 4096, "gear_ratio": gear}})["theta1"]
    assert counts.factor == pytest.approx(TURN / 4096 / gear, rel=1e-12)


def test_signs_and_offsets_of_channels_and_joints_add_up() -> None:
    found = readings(
        {
            "signs": [1, -1],
            "offsets": [0.25, 0.5],
            "theta2": {"sign": -1, "offset": 1.0},
            "tau2": {"offset": 2.0},
            "tau1": {"sign": -1},
        }
    )
    assert {name: (one.factor, one.offset, one.sign) for name, one in found.items()} == {
        "theta1": (1, 0.25, 1),
        "theta2": (1, 1.5, 1),
        "tau1": (-1, 0, -1),
        "tau2": (-1, 2, -1),
        "omega1": (1, 0, 1),
        "omega2": (-1, 0, -1),
        "q_des1": (1, 0.25, 1),
        "q_des2": (1, 1.5, 1),
    }


SIGNALS = np.random.default_rng(7).normal(size=(8, 50))


def converted(**settings: Any) -> Log:
    columns = {"t": np.arange(50) * 1e-3, **dict(zip(CHANNELS, SIGNALS, strict=True))}
    return read_log(columns, with_settings(Profile(), settings))


def test_a_second_motor_at_the_base_does_the_same_work() -> None:
    """τ_m1 θ̇1 + τ_m2 (θ̇1 + θ̇2), the power of both motors, is that of the joints' torques."""
    log = converted(drive="base")
    (first, second), (one, two) = SIGNALS[2:4], SIGNALS[4:6]
    assert np.allclose(
        (log.tau * log.omega).sum(axis=0),
        first * one + second * (one + two),
        rtol=1e-13,
        atol=1e-13,
    )


def test_zero_and_reference_of_the_angles() -> None:
    """The tip of an arm of two links of 1 m is where it was, whatever the angles are
    counted from.
    """
    hanging, absolute = converted(zero="hanging"), converted(second_angle="absolute")
    first, second = SIGNALS[:2]
    assert np.allclose(np.exp(1j * hanging.theta[0]) * 1j, np.exp(1j * first), atol=1e-14)
    assert np.allclose(np.exp(1j * absolute.theta.sum(axis=0)), np.exp(1j * second), atol=1e-14)
    assert np.allclose(absolute.omega.sum(axis=0), SIGNALS[5], atol=1e-14)
    assert hanging.reference - SIGNALS[6:] == pytest.approx(hanging.theta - SIGNALS[:2])
    assert np.allclose(absolute.reference.sum(axis=0), SIGNALS[7], atol=1e-14)
    assert np.all(converted(passive=1).tau[0] == 0)
    assert np.all(converted(passive=1, drive="base").tau == SIGNALS[3])


@settings(max_examples=40, deadline=None)
@given(
    steps=st.lists(st.floats(-3, 3), min_size=2, max_size=60),
    cuts=st.sets(st.integers(0, 59), max_size=4),
)
def test_unwrapping_is_that_of_numpy_in_any_blocks(steps: list[float], cuts: set[int]) -> None:
    turning = np.cumsum(steps)
    wrapped = np.angle(np.exp(1j * turning))
    theta, last = wrapped.copy(), float("nan")
    for part in np.split(theta, sorted(cuts)):
        last = unwrap(part, last)
    # twenty turns at most, each good to a unit in the last place
    assert np.allclose(theta, np.unwrap(wrapped), rtol=0, atol=1e-12)
