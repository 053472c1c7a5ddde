"""Units as people write them: one entry a unit, with its spellings and what it is in SI units.

Whatever must know the units reads this table: names of columns, profiles, flags, their completion,
and the guide. Adding one is an entry.
"""

from __future__ import annotations

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
    factor : float
        In rad, rad/s, N m, A or s; 0 where a profile says it, as of encoder counts.
    spellings : str
        Other names between blanks, in lower case.
    """

    name: str
    quantities: tuple[str, ...]
    factor: float
    spellings: str


# A weight of 1 kg is 9.80665 N, one of a pound 4.4482216152605 N; a foot is 0.3048 m.
_TABLE = """\
rad    | angle velocity | 1                     | rad radian radians rads rad/s rad.s-1 rads/s \
radians/s radian/s
mrad   | angle velocity | 0.001                 | mrad milliradian milliradians mrad/s
deg    | angle velocity | 0.017453292519943295  | deg degree degrees degs ° deg/s degrees/s \
degree/s °/s dps
rev    | angle velocity | 6.283185307179586     | rev revs revolution revolutions turn turns rev/s \
turns/s rps
counts | angle velocity | 0                     | counts count ticks tick inc increments counts/s \
ticks/s
rpm    | velocity       | 0.10471975511965977   | rpm rev/min
N m    | torque         | 1                     | nm n-m newtonmeter newtonmetre newtonmeters \
newtonmetres newton-meter newton-meters
mN m   | torque         | 0.001                 | mnm mn-m millinewtonmeter
N cm   | torque         | 0.01                  | ncm n-cm
kN m   | torque         | 1000                  | knm kn-m
kgf m  | torque         | 9.80665               | kgfm kgm kgf-m kg-m
kgf cm | torque         | 0.0980665             | kgfcm kgcm kgf-cm kg-cm
lbf ft | torque         | 1.3558179483314003    | lbfft lbft lb-ft lbf-ft ftlb ftlbf ft-lb ft-lbf
lbf in | torque         | 0.1129848290276167    | lbfin lbin lb-in lbf-in inlb inlbf in-lb in-lbf
ozf in | torque         | 0.0070615518142260435 | ozfin ozin oz-in ozf-in inoz in-oz
A      | current        | 1                     | a amp amps ampere amperes
mA     | current        | 0.001                 | ma milliamp milliamps milliampere milliamperes
s      | time           | 1                     | s sec secs second seconds
ms     | time           | 0.001                 | ms msec msecs milli millis millisecond \
milliseconds
us     | time           | 1e-06                 | us µs μs usec usecs micro micros microsecond \
microseconds
ns     | time           | 1e-09                 | ns nsec nsecs nano nanos nanosecond nanoseconds"""
UNITS = tuple(
    Unit(name.strip(), tuple(quantities.split()), float(factor), spellings.strip())
    for name, quantities, factor, spellings in (line.split("|") for line in _TABLE.splitlines())
)


def names_of(*quantities: str) -> tuple[str, ...]:
    """Names of the units in which these quantities are logged."""
    return tuple(unit.name for wanted in quantities for unit in UNITS if wanted in unit.quantities)


def _factors(quantity: str) -> dict[str, float]:
    return {unit.name: unit.factor for unit in UNITS if quantity in unit.quantities and unit.factor}


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
