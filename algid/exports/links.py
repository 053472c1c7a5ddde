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
from algid.notices import Remedy

ALONG = 0.05  # of a link's inertia across: that about its own line, as of a stout bar
_ENDS = 25.0  # how near the ends of the masses' range the search goes, in logits


Knowns = Mapping[str, float]
"""What the user knows: l1, l2 in m, m1, m2 in kg, rotor1 of joint 1 in kg m^2."""


@dataclass(frozen=True)
class Link:
    """A link along x from its joint: length m, mass kg, inertia about its centre kg m^2.

    Its centre lies `centre` along its line and `aside` to the left of it, in m.
    """

    length: float
    mass: float
    centre: float
    inertia: float
    aside: float

    @property
    def tensor(self) -> tuple[float, float, float]:
        """Principal inertias about x, y, z at the centre, of an axially symmetric bar."""
        return ALONG * self.inertia, self.inertia, self.inertia


def turn_of(k: Mapping[str, float]) -> float:
    """ε in rad: what is to be added to θ1 so that it counts from the horizontal.

    0 without gravity, which leaves no K2.
    """
    first, second, _ = moments_of(k)
    return cmath.phase(second / first) if first else 0.0


def links_of(
    k: Mapping[str, float], gravity: float, l1: float, knowns: Knowns, file: str
) -> tuple[Link, Link]:
    """Two links with the motion of the constants `k` under `gravity` in m/s^2, link 1 of `l1` m.

    Raises
    ------
    SettingError
        If what is known leaves no positive mass or inertia.
    """
    K1, K2, K4 = moments_of(k)
    level = cmath.exp(-1j * turn_of(k))
    s2, h2 = K2 * level / gravity if gravity else K1 / l1, k[K3]
    h, s = k[K5] - knowns.get("rotor1", 0.0), K4 * level / gravity if gravity else 0j  # at m2 = 0

    def first(m2: float) -> Link:
        left, own = h - m2 * l1**2, s - m2 * l1 if gravity else 0j
        m1 = knowns.get("m1") or 3 * left / l1**2 - 3 * own.real / l1 + 2 * abs(own) ** 2 / left
        if not gravity:  # nothing tells link 1's first moment
            own = complex(l1 * left * m1 / (left + m1 * l1**2 / 3))
        return _link(l1, m1, own, left)

    def second(m2: float) -> Link:
        return _link(knowns.get("l2") or math.sqrt(3 * h2 / m2), m2, s2, h2)

    low, high, m1, m2 = abs(s2) ** 2 / h2, h / l1**2, knowns.get("m1"), knowns.get("m2")
    if m1 is not None and gravity:  # possible is link 1 where left m1 > |own|²
        middle = s.real / l1 - 0.5 * m1
        square = middle**2 - (abs(s) ** 2 - h * m1) / l1**2
        half = math.sqrt(square) if square > 0 else -math.inf
        low, high = max(low, middle - half), min(high, middle + half)
    if not (low < high and (m2 is None or low < m2 < high)):
        given = Remedy(knowns).words
        left = f"{low:.4g} to {high:.4g} kg are left" if low < high else "none is left"
        raise SettingError(
            f"{file}: with {given} a mass or an inertia comes out negative; of link 2's masses "
            f"{left}: change one of them, or leave it out"
        )
    if m2 is None:  # the least D of both links together

        def distance(logit: float) -> float:
            mass = low + (high - low) * float(expit(logit))
            return _distance(first(mass)) + _distance(second(mass))

        ends = (-_ENDS, _ENDS)
        minimum = minimize_scalar(distance, bounds=ends, method="bounded", options={"xatol": 1e-10})
        m2 = low + (high - low) * float(expit(minimum.x))
    return first(m2), second(m2)


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
