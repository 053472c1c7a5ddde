"""Units beside scipy's constants, and the spellings that people log."""

from __future__ import annotations

import math

import pytest
from scipy import constants

from algid.base.units import ANGLE, CURRENT, NANOSECONDS, TORQUE, VELOCITY, is_foreign, unit_of

INCH_POUND = constants.inch * constants.pound_force


def test_units_are_what_the_standards_say() -> None:
    assert (
        pytest.approx(
            {"rad": 1, "mrad": 1e-3, "deg": constants.degree, "rev": 2 * math.pi}, rel=1e-15
        )
        == ANGLE
    )
    assert pytest.approx({**ANGLE, "rpm": 2 * math.pi / constants.minute}, rel=1e-15) == VELOCITY
    assert {
        "N m": 1,
        "mN m": constants.milli,
        "N cm": constants.centi,
        "kN m": constants.kilo,
        "kgf m": constants.kilogram_force,
        "kgf cm": constants.kilogram_force * constants.centi,
        "lbf ft": constants.foot * constants.pound_force,
        "lbf in": INCH_POUND,
        "ozf in": INCH_POUND / 16,
    } == pytest.approx(TORQUE, rel=1e-14)
    assert CURRENT == {"A": 1.0, "mA": 1e-3}
    assert NANOSECONDS == {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Nm", "N m"),
        (" N·m ", "N m"),
        ("N*m", "N m"),
        ("N⋅m.", "N m"),
        ("mNm", "mN m"),
        ("Newton metres", "N m"),
        ("lb ft", "lbf ft"),
        ("kgf.cm", "kgf cm"),
        ("rad / s", "rad"),
        ("°/s", "deg"),
        ("rev / min", "rpm"),
        ("RPM", "rpm"),
        ("µs", "us"),
        ("mA", "mA"),
        ("furlong", None),
        ("", None),
        ("m", None),
    ],
)
def test_a_unit_is_known_by_its_spellings(text: str, unit: str | None) -> None:
    assert unit_of(text) == unit


def test_what_is_a_unit_of_something_else_is_foreign() -> None:
    assert all(is_foreign(text) for text in (" Volts ", "m / s", "%", "ADC"))
    assert not any(is_foreign(text) for text in ("Nm", "rad", "", "elbow"))
