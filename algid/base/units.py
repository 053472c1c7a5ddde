"""Units as people write them: one entry a unit, with its spellings and what it is in SI units.

Whatever must know the units reads this table: names of columns, profiles, flags, their completion,
and the guide. Adding one is an entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit.

    Parameters
    ----------
    name : str
        As algid writes it.
    quantities : of "angle", "velocity", "torque", "current" and "time"
        What is logged in it. A velocity's is the angle's unit a second.
    factor : float or None
        In rad, rad/s, N m, A or s; None where a profile says it, as of encoder counts.
    spellings : str
        Other names between blanks, in lower case.
    """

    name: str
    quantities: tuple[str, ...]
    factor: float | None
    spellings: str


_TURN = 2 * math.pi
_TURNING = ("angle", "velocity")
_KILOGRAM = 9.80665  # N, its weight under standard gravity
_POUND = 4.4482216152605  # N
_FOOT = 0.3048  # m

UNITS = (
    Unit("rad", _TURNING, 1.0, "rad radian radians rads rad/s rad.s-1 rads/s radians/s radian/s"),
    Unit("mrad", _TURNING, 1e-3, "mrad milliradian milliradians mrad/s"),
    Unit(
        "deg",
        _TURNING,
        math.pi / 180,
        "deg degree degrees degs ° deg/s degrees/s degree/s °/s dps",
    ),
    Unit("rev", _TURNING, _TURN, "rev revs revolution revolutions turn turns rev/s turns/s rps"),
    Unit("counts", _TURNING, None, "counts count ticks tick inc increments counts/s ticks/s"),
    Unit("rpm", ("velocity",), _TURN / 60, "rpm rev/min"),
    Unit(
        "N m",
        ("torque",),
        1.0,
        "nm n-m newtonmeter newtonmetre newtonmeters newtonmetres newton-meter newton-meters",
    ),
    Unit("mN m", ("torque",), 1e-3, "mnm mn-m millinewtonmeter"),
    Unit("N cm", ("torque",), 1e-2, "ncm n-cm"),
    Unit("kN m", ("torque",), 1e3, "knm kn-m"),
    Unit("kgf m", ("torque",), _KILOGRAM, "kgfm kgm kgf-m kg-m"),
    Unit("kgf cm", ("torque",), _KILOGRAM / 100, "kgfcm kgcm kgf-cm kg-cm"),
    Unit(
        "lbf ft",
        ("torque",),
        _POUND * _FOOT,
        "lbfft lbft lb-ft lbf-ft ftlb ftlbf ft-lb ft-lbf",
    ),
    Unit(
        "lbf in",
        ("torque",),
        _POUND * _FOOT / 12,
        "lbfin lbin lb-in lbf-in inlb inlbf in-lb in-lbf",
    ),
    Unit("ozf in", ("torque",), _POUND * _FOOT / 192, "ozfin ozin oz-in ozf-in inoz in-oz"),
    Unit("A", ("current",), 1.0, "a amp amps ampere amperes"),
    Unit("mA", ("current",), 1e-3, "ma milliamp milliamps milliampere milliamperes"),
    Unit("s", ("time",), 1.0, "s sec secs second seconds"),
    Unit("ms", ("time",), 1e-3, "ms msec msecs milli millis millisecond milliseconds"),
    Unit("us", ("time",), 1e-6, "us µs μs usec usecs micro micros microsecond microseconds"),
    Unit("ns", ("time",), 1e-9, "ns nsec nsecs nano nanos nanosecond nanoseconds"),
)


def names_of(*quantities: str) -> tuple[str, ...]:
    """Names of the units in which these quantities are logged."""
    return tuple(unit.name for wanted in quantities for unit in UNITS if wanted in unit.quantities)


def _factors(quantity: str) -> dict[str, float]:
    return {
        unit.name: unit.factor
        for unit in UNITS
        if quantity in unit.quantities and unit.factor is not None
    }


ANGLE = _factors("angle")
"""By unit of angle, rad."""
VELOCITY = _factors("velocity")
"""By unit of velocity (a second, but rpm), rad/s."""
TORQUE = _factors("torque")
"""By unit of torque, N m."""
CURRENT = _factors("current")
"""By unit of current, A."""
NANOSECONDS = {name: round(1e9 * seconds) for name, seconds in _factors("time").items()}
"""By unit of time, ns."""

_BY_SPELLING = {spelling: unit.name for unit in UNITS for spelling in unit.spellings.split()}
_FOREIGN_NAMES = (
    "in inch inches ft foot feet mm cm m km mil mils lb lbs lbf pound pounds oz ozf n newton "
    "newtons kn kg kgf gf v volt volts mv % percent pu grad gon arcmin arcsec counts/rev hz khz w "
    "kw watt watts raw adc lsb bit bits digit digits m/s mm/s in/s"
)
_FOREIGN = frozenset(_FOREIGN_NAMES.split())


def unit_of(text: str) -> str | None:
    """The unit that `text` names, in algid's writing of it (``Nm`` → ``N m``).

    None where it names none.
    """
    plain = text.strip().lower().strip(".")
    for spelling in (
        plain,
        plain.replace(" ", ""),
        "".join(one for one in plain if one not in " .*·⋅"),
    ):
        if spelling in _BY_SPELLING:
            return _BY_SPELLING[spelling]
    return None


def is_foreign(text: str) -> bool:
    """Whether `text` names a unit of none of the quantities that algid reads."""
    return text.strip().lower().replace(" ", "") in _FOREIGN
