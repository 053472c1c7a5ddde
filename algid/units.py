"""Units as people write them: the same unit under all its names, and what it is in SI units."""

from __future__ import annotations

import math

_TURN = 2 * math.pi
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": _TURN}
"""By unit of angle, rad."""
VELOCITY = {**ANGLE, "rpm": _TURN / 60}
"""By unit of velocity (a second, but rpm), rad/s."""
TORQUE = {
    "N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "kN m": 1e3,
    "kgf m": 9.80665, "kgf cm": 0.0980665, "lbf ft": 1.3558179483314004,
    "lbf in": 0.1129848290276167, "ozf in": 0.007061551814226044,
}  # fmt: skip
"""By unit of torque, N m; those of pounds and ounces by the international foot and pound."""
CURRENT = {"A": 1.0, "mA": 1e-3}
"""By unit of current, A."""
NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""By unit of time, ns."""

_NAMES = {
    "rad": "rad radian radians rads rad/s rad.s-1 rads/s radians/s radian/s",
    "mrad": "mrad milliradian milliradians mrad/s",
    "deg": "deg degree degrees degs ° deg/s degrees/s degree/s °/s dps",
    "rev": "rev revs revolution revolutions turn turns rev/s turns/s rps",
    "rpm": "rpm rev/min",
    "counts": "counts count ticks tick inc increments counts/s ticks/s",
    "N m": "nm n-m newtonmeter newtonmetre newtonmeters newtonmetres newton-meter newton-meters",
    "mN m": "mnm mn-m millinewtonmeter",
    "N cm": "ncm n-cm",
    "kN m": "knm kn-m",
    "kgf m": "kgfm kgm kgf-m kg-m",
    "kgf cm": "kgfcm kgcm kgf-cm kg-cm",
    "lbf ft": "lbfft lbft lb-ft lbf-ft ftlb ftlbf ft-lb ft-lbf",
    "lbf in": "lbfin lbin lb-in lbf-in inlb inlbf in-lb in-lbf",
    "ozf in": "ozfin ozin oz-in ozf-in inoz in-oz",
    "A": "a amp amps ampere amperes",
    "mA": "ma milliamp milliamps milliampere milliamperes",
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs milli millis millisecond milliseconds",
    "us": "us µs μs usec usecs micro micros microsecond microseconds",
    "ns": "ns nsec nsecs nano nanos nanosecond nanoseconds",
}
_BY_NAME = {name: unit for unit, names in _NAMES.items() for name in names.split()}
_FOREIGN_NAMES = (
    "in inch inches ft foot feet mm cm m km mil mils lb lbs lbf pound pounds oz ozf n newton newtons kn kg kgf gf "
    "v volt volts mv % percent pu grad gon arcmin arcsec counts/rev hz khz w kw watt watts raw adc lsb bit bits digit "
    "digits m/s mm/s in/s"
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
        if spelling in _BY_NAME:
            return _BY_NAME[spelling]
    return None


def is_foreign(text: str) -> bool:
    """Whether `text` names a unit that is none of an angle, a velocity, a torque, a current or a time."""
    return text.strip().lower().replace(" ", "") in _FOREIGN
