"""Two links that move by k1 … k7: what the constants leave free is nearest to uniform links.

======  ========================================================  ==========  ======
symbol  name                                                      shape       unit
======  ========================================================  ==========  ======
m       mass of a link                                            scalar      kg
s       its first moment m (lc + i e) about its joint, complex    scalar      kg m
ε       zero of joint 1's angle against gravity                   scalar      rad
h       its second moment I + m lc² about its joint               scalar      kg m^2
l       its length                                                scalar      m
J1      rotor of joint 1, as the joint feels it                   scalar      kg m^2
======  ========================================================  ==========  ======

A centre of mass stands e beside its link's line, and the moments are phasors, K = k + i k_s. With
ε = arg K2 - arg K1 the links are turned into gravity's frame: s2 = |K2| K1 / (g |K1|), h2 = k3 and
l1 = g |K1| / |K2|, and Table 1 leaves

    s1 = K4 exp(-i ε) / g - m2 l1,   h1 = k5 - J1 - m2 l1²

A link is possible where h m > |s|² (Wensing et al. 2018). How far it is from a uniform one is the
Bregman divergence of its pseudo-inertia P = [[h, s], [s, m]] from that of a uniform link of the
same length and the nearest mass (Lee and Park 2018):

    D = log(3 (h - l Re s + m l² / 3)² / (l² (h m - |s|²)))

zero for uniform links only. Of a single link it is least at m = 3 h / l² - 3 Re s / l + 2 |s|² / h,
at l = √(3 h / m), and at s = l h m / (h + m l² / 3).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

from scipy.optimize import minimize_scalar
from scipy.special import expit

from algid.base.errors import SettingError
from algid.model import K3, K5, moments_of
from algid.options import flag

ALONG = 0.05  # of a link's inertia across: that about its own line, as of a stout bar
_ENDS = 25.0  # how near the ends of the masses' range the search goes, in logits


@dataclass(frozen=True)
class Knowns:
    """What the user knows: lengths in m, masses in kg, the rotor of joint 1 in kg m^2.

    None where not known.
    """

    l1: float | None = None
    l2: float | None = None
    m1: float | None = None
    m2: float | None = None
    rotor1: float | None = None

    @property
    def given(self) -> dict[str, float]:
        """What is known, by name."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class Link:
    """A link along x from its joint: length m, mass kg, inertia about its centre kg m^2.

    Its centre lies `centre` along its line and `aside` to the left of it, in m.
    """

    length: float
    mass: float
    centre: float
    inertia: float
    aside: float = 0.0

    @property
    def tensor(self) -> tuple[float, float, float]:
        """Principal inertias about x, y, z at the centre, of an axially symmetric bar."""
        return ALONG * self.inertia, self.inertia, self.inertia


def turn_of(k: Mapping[str, float], gravity: float) -> float:
    """ε in rad: what is to be added to θ1 so that it counts from the horizontal.

    0 without gravity, or where the moments have no sine parts.
    """
    first, second, _ = moments_of(k)
    if gravity == 0 or not (first.imag or second.imag):
        return 0.0
    return cmath.phase(second / first)


def links_of(
    k: Mapping[str, float], gravity: float, l1: float, knowns: Knowns, file: str
) -> tuple[Link, Link]:
    """Two links with the motion of the constants `k` under `gravity` in m/s^2, link 1 of `l1` m.

    Raises
    ------
    SettingError
        If what is known leaves no positive mass or inertia.
    """
    first, second, fourth = moments_of(k)
    level = cmath.exp(-1j * turn_of(k, gravity))
    s2, h2 = second * level / gravity if gravity else first / l1, k[K3]
    h = k[K5] - (knowns.rotor1 or 0.0)
    arm = _Free(s2, h2, h, fourth * level / gravity if gravity else None, l1, knowns)
    low, high = abs(s2) ** 2 / h2, h / l1**2
    if not low < high:
        why = f"the rotor leaves link 1 no inertia: k5 - rotor1 is {h:.4g} kg m²"
        raise SettingError(_refusal(file, knowns, why, "rotor1"))
    if knowns.m1 is not None and gravity:
        low, high = _within(arm, knowns.m1, low, high, file, knowns)
    m2 = knowns.m2
    if m2 is None:
        m2 = arm.nearest(low, high)
    elif not low < m2 < high:
        why = (
            f"with link 2 of {m2:g} kg an inertia comes out negative; between {low:.4g} and "
            f"{high:.4g} kg"
        )
        raise SettingError(_refusal(file, knowns, why, "m2"))
    return arm.first(m2), arm.second(m2)


def _within(
    arm: _Free, m1: float, low: float, high: float, file: str, knowns: Knowns
) -> tuple[float, float]:
    """Masses of link 2 that leave a link 1 of `m1` kg possible: (h - m2 l1²) m1 > |s - m2 l1|²."""
    assert arm.s is not None
    middle = arm.s.real / arm.l1 - 0.5 * m1
    square = middle**2 - (abs(arm.s) ** 2 - arm.h * m1) / arm.l1**2
    if square > 0:
        low, high = max(low, middle - math.sqrt(square)), min(high, middle + math.sqrt(square))
    if square <= 0 or low >= high:
        why = f"with link 1 of {m1:g} kg a mass or an inertia comes out negative"
        raise SettingError(_refusal(file, knowns, why, "m1"))
    return low, high


def _refusal(file: str, knowns: Knowns, why: str, name: str) -> str:
    others = " or ".join(flag(other) for other in knowns.given if other != name)
    typed = flag(name)
    return (
        f"{typed}: {file}: {why}; check {typed}{' or ' + others if others else ''}, or leave it out"
    )


@dataclass(frozen=True)
class _Free:
    """The arm but for its masses: see the module's table.

    `s` and `h` are link 1's moments at m2 = 0.
    """

    s2: complex
    h2: float
    h: float
    s: complex | None
    l1: float
    knowns: Knowns

    def second(self, m2: float) -> Link:
        length = self.knowns.l2 or math.sqrt(3 * self.h2 / m2)
        return _link(length, m2, self.s2, self.h2)

    def first(self, m2: float) -> Link:
        h, l1, m1 = self.h - m2 * self.l1**2, self.l1, self.knowns.m1
        if self.s is None:  # without gravity nothing tells link 1's first moment
            m1 = m1 or 3 * h / l1**2
            s = complex(l1 * h * m1 / (h + m1 * l1**2 / 3))
        else:
            s = self.s - m2 * l1
            m1 = m1 or 3 * h / l1**2 - 3 * s.real / l1 + 2 * abs(s) ** 2 / h
        return _link(l1, m1, s, h)

    def nearest(self, low: float, high: float) -> float:
        """m2 between its bounds with the least D of both links together."""

        def distance(logit: float) -> float:
            m2 = low + (high - low) * float(expit(logit))
            return _distance(self.first(m2)) + _distance(self.second(m2))

        minimum = minimize_scalar(
            distance, bounds=(-_ENDS, _ENDS), method="bounded", options={"xatol": 1e-10}
        )
        return low + (high - low) * float(expit(minimum.x))


def _link(length: float, mass: float, s: complex, h: float) -> Link:
    """A link of these moments."""
    return Link(length, mass, s.real / mass, h - abs(s) ** 2 / mass, s.imag / mass)


def _distance(link: Link) -> float:
    """D of a link; infinite where rounding leaves it no inertia."""
    m, s, length = link.mass, link.mass * link.centre, link.length
    if m <= 0 or link.inertia <= 0:
        return math.inf
    h = link.inertia + m * (link.centre**2 + link.aside**2)
    return math.log(3 * (h - length * s + m * length**2 / 3) ** 2 / (length**2 * m * link.inertia))
