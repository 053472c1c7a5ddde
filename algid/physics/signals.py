"""Signals of a motion and sums of their products: derived, evaluated and written out as text.

An atom is a signal that is no product of others: ω1, cos θ2, tanh(ω1 / ω_s). An expression is a sum
of products of atoms with numbers before them. An atom that is a function states the function and
its argument: its value, its text in C and Python and its derivatives follow.

=========  ==================================================  =========================
name       meaning                                             shape, unit
=========  ==================================================  =========================
E          expression, {(atom, atom, …): factor}               scalar at each sample
Q1, Q2     θ1, θ2                                              (N,), rad
W1, W2     ω1, ω2                                              (N,), rad/s
S1 … C12   sine and cosine of θ1, θ2, θ1 + θ2                  (N,), 1
T1, T2     tanh(ω / ω_s), the smooth sign                      (N,), 1
H1, H2     exp(-(ω / ω_S)²), Stribeck's fading                 (N,), 1
=========  ==================================================  =========================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.base.names import names_in

Number = int | float


@dataclass(frozen=True, eq=False)
class Atom:
    """A signal of a motion or one over a width, which every exported function is handed.

    Parameters
    ----------
    name : str
        What it is called in exported sources.
    """

    name: str

    def __lt__(self, other: Atom) -> bool:
        return self.name < other.name

    @property
    def source(self) -> str:
        """Its text, which C and Python read alike; "" for what every function is handed."""
        return ""

    @property
    def leaves(self) -> frozenset[Atom]:
        """The signals and widths that it depends on."""
        return frozenset([self])

    def by(self, leaf: Atom) -> Expression:
        """Its derivative by a signal."""
        return ONE if self is leaf else NOTHING


@dataclass(frozen=True, eq=False)
class Function(Atom):
    """A function of an expression.

    Parameters
    ----------
    function : NumPy's function, whose name C and Python have too
    argument : Expression
    slope : callable
        Its derivative by its argument. Called late: cosines derive from sines, and back.
    """

    function: np.ufunc
    argument: Expression
    slope: Callable[[], Expression]

    @property
    def source(self) -> str:
        """Its text: the function of the argument's."""
        return f"{self.function.__name__}({self.argument.source()})"

    @property
    def leaves(self) -> frozenset[Atom]:
        """The signals and widths in its argument."""
        return self.argument.leaves

    def by(self, leaf: Atom) -> Expression:
        """Its derivative by a signal, by the chain rule."""
        return self.slope() * self.argument.by(leaf)


Product = tuple[Atom, ...]


@dataclass(frozen=True, eq=False)
class Expression:
    """A sum of products, each with its factor.

    No product stands twice, and none with a factor of zero.
    """

    products: Mapping[Product, float]

    def __add__(self, other: Expression | Number) -> Expression:
        total = dict(self.products)
        for product, factor in as_expression(other).products.items():
            total[product] = total.get(product, 0.0) + factor
        return Expression({product: factor for product, factor in total.items() if factor})

    def __mul__(self, other: Expression | Number) -> Expression:
        total = NOTHING
        for first, factor in self.products.items():
            for second, by in as_expression(other).products.items():
                total = total + Expression({tuple(sorted(first + second)): factor * by})
        return total

    def __sub__(self, other: Expression | Number) -> Expression:
        return self + as_expression(other) * -1.0

    def __neg__(self) -> Expression:
        return self * -1.0

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Expression | Number) -> Expression:
        return as_expression(other) - self

    def by(self, leaf: Atom) -> Expression:
        """The derivative by a signal."""
        total = NOTHING
        for product, factor in self.products.items():
            for place, atom in enumerate(product):
                rest = Expression({product[:place] + product[place + 1 :]: factor})
                total = total + atom.by(leaf) * rest
        return total

    @property
    def leaves(self) -> frozenset[Atom]:
        """The signals and widths that it depends on."""
        return frozenset().union(*(atom.leaves for atom in chain(*self.products)))

    def source(self) -> str:
        """Its text, which C and Python read alike; "" for a sum of nothing."""
        return text_of_sum((factor, names_in(product)) for product, factor in self.products.items())


def text_of_sum(parts: Iterable[tuple[float, Sequence[str]]]) -> str:
    """A sum of products, each a number and names, as text that C and Python read alike."""
    products = []
    for factor, names in parts:
        number = [] if names and factor == 1 else [f"{factor:g}"]
        products.append(" * ".join([*number, *names]))
    return " + ".join(products)


NOTHING = Expression({})
ONE = Expression({(): 1.0})


def as_expression(value: Expression | Atom | Number) -> Expression:
    """A number or an atom as an expression."""
    if isinstance(value, Expression):
        return value
    if isinstance(value, Atom):
        return Expression({(value,): 1.0})
    return Expression({(): float(value)}) if value else NOTHING


@dataclass(frozen=True, kw_only=True)
class Widths:
    """The widths of friction, which models and results have.

    Parameters
    ----------
    coulomb_speed : float, rad/s
        ω_s: speed at which Coulomb friction has reached three quarters of its value.
    stribeck_speed : float, rad/s
        ω_S: speed at which a third of Stribeck's additional friction is left.
    """

    coulomb_speed: float = 0.2
    stribeck_speed: float = 0.3


TRIED = {
    "coulomb_speed": (0.01, 0.02, 0.04, 0.08, 0.16, 0.32),
    "stribeck_speed": (0.1, 0.3, 0.9),
}
"""rad/s: the values of each width that logs are tried with; drives' lie between."""
WIDTHS = {one.name: Atom(f"(1 / {one.name.upper()})") for one in fields(Widths)}
"""One over each width, by the width's name."""


def widths_of(holder: Widths) -> dict[str, Any]:
    """The widths of friction among the fields of a model, or of what a result says of it."""
    return {name: float(getattr(holder, name)) for name in WIDTHS}


THETA = (Atom("q1"), Atom("q2"))
OMEGA = (Atom("w1"), Atom("w2"))
ALPHA = (Atom("alpha1"), Atom("alpha2"))
MOTION = (THETA, OMEGA, ALPHA)
"""By the order of θ's derivative: each pair is the one before derived by time."""

Q1, Q2, W1, W2, A1, A2 = map(as_expression, chain(*MOTION))


def function(
    name: str,
    function: np.ufunc,
    argument: Expression,
    slope: Callable[[], Expression],
) -> Expression:
    """A function of an expression: see `Function`."""
    return as_expression(Function(name, function, argument, slope))


S1: Expression = function("s1", np.sin, Q1, lambda: C1)
C1: Expression = function("c1", np.cos, Q1, lambda: -S1)
S2: Expression = function("s2", np.sin, Q2, lambda: C2)
C2: Expression = function("c2", np.cos, Q2, lambda: -S2)
S12: Expression = function("s12", np.sin, Q1 + Q2, lambda: C12)
C12: Expression = function("c12", np.cos, Q1 + Q2, lambda: -S12)
_KNOWN = (ONE, Q1, Q2, W1, W2, A1, A2, S1, C1, S2, C2, S12, C12)
KNOWN = [product for known in _KNOWN for product in known.products]
"""The products of one atom or none as `Motion.signals` has their values."""

_RATE = as_expression(WIDTHS["coulomb_speed"])
T1: Expression = function("t1", np.tanh, W1 * _RATE, lambda: 1 - T1 * T1)
T2: Expression = function("t2", np.tanh, W2 * _RATE, lambda: 1 - T2 * T2)

_FADING_RATE = as_expression(WIDTHS["stribeck_speed"])
H1: Expression = function("h1", np.exp, -W1 * W1 * _FADING_RATE * _FADING_RATE, lambda: H1)
H2: Expression = function("h2", np.exp, -W2 * W2 * _FADING_RATE * _FADING_RATE, lambda: H2)


def rate(e: Expression) -> Expression:
    """The derivative by time of an expression without accelerations."""
    total = NOTHING
    for signals, speeds in pairwise(MOTION):
        for signal, speed in zip(signals, speeds, strict=True):
            total = total + e.by(signal) * as_expression(speed)
    return total


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles, velocities, accelerations (2, N) and what eq. (1) needs of them.

    `load` (3, 2, N) is what bends the joints where they are elastic, in N m, with its two rates.
    """

    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray
    load: FloatArray | None = None

    @cached_property
    def signals(self) -> tuple[FloatArray | float, ...]:
        """1, its rows, then sine and cosine of θ1, of θ2 and of θ1 + θ2, each (N,)."""
        (s1, s2), (c1, c2) = sine_cosine(self.theta)
        both = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
        return 1.0, *self.theta, *self.omega, *self.alpha, s1, c1, s2, c2, *both


def sine_cosine(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of angles, each in the shape of `theta`, by one tangent of the half angle.

    Exact to a unit in the last place of 1, also where the tangent has its poles. NumPy has vector
    instructions for the tangent on more processors than for sine and cosine: this is several times
    faster there.
    """
    half = np.tan(0.5 * theta)
    square = half * half
    scale = 1 / (1 + square)
    return 2 * half * scale, (1 - square) * scale


class Values:
    """Values of products along one motion, each worked out once.

    Parameters
    ----------
    motion : Motion of N samples
    widths : Widths
    """

    def __init__(self, motion: Motion, widths: Widths) -> None:
        self._known: dict[Product, FloatArray | float]
        self._known = dict(zip(KNOWN, motion.signals, strict=True))
        for name, width in widths_of(widths).items():
            self._known[(WIDTHS[name],)] = 1 / width

    def of(self, product: Product) -> FloatArray | float:
        """The value of a product (N,); a float where no motion changes it."""
        if product not in self._known:
            last = product[-1]
            if len(product) > 1:
                value = self.of(product[:-1]) * self.of((last,))
            else:
                assert isinstance(last, Function)  # all else is known
                value = last.function(self.sum(last.argument.products))
            self._known[product] = value
        return self._known[product]

    def sum(self, products: Mapping[Product, FloatArray | float]) -> FloatArray | float:
        """The value (N,) of a sum of products with factors (N,) or none, or a float."""
        total: FloatArray | float = 0.0
        for product, factor in products.items():
            if isinstance(factor, np.ndarray) or factor:
                total = total + factor * self.of(product)
        return total
