"""Sums of products of a motion's signals: derived, evaluated and written out as source text.

An atom is a signal that is no product of others: ω1, cos θ2, tanh(ω1 / ω_s). It knows its value,
its text in C and Python, and its derivatives. An expression is a sum of products of atoms with
numbers before them.

======  ==================================================  =========================
symbol  name                                                shape
======  ==================================================  =========================
E       expression, {(atom, atom, …): factor}               scalar at each sample
x       signal: θ1, θ2, ω1, ω2, α1 or α2                    (N,)
======  ==================================================  =========================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.names import names_in

if TYPE_CHECKING:
    from algid.physics.motion import Motion, Widths

Number = int | float


@dataclass(frozen=True, eq=False)
class Atom:
    """A signal of a motion.

    Parameters
    ----------
    name : str
        What it is called in exported sources.
    value : callable
        Its value (N,) from a motion and the shape of friction.
    source : str
        Its text, which C and Python read alike; "" for what every function is handed.
    slopes : callable
        Its derivatives by the signals it depends on, by their names. Called late: cosines derive
        from sines, and back.
    constant : callable or None
        Its value from the shape alone, for one that no motion changes.
    shapes : names of the widths that its value depends on, fields of `algid.physics.motion.Widths`
    """

    name: str
    value: Callable[[Motion, Widths], FloatArray]
    source: str
    slopes: Callable[[], Mapping[str, Expression]]
    constant: Callable[[Widths], float] | None = None
    shapes: tuple[str, ...] = ()

    def __lt__(self, other: Atom) -> bool:
        return self.name < other.name


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
        total = Expression({})
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

    def __bool__(self) -> bool:
        return bool(self.products)

    def by(self, signal: str) -> Expression:
        """The derivative by a signal: "theta1" … "alpha2"."""
        total = Expression({})
        for product, factor in self.products.items():
            for place, atom in enumerate(product):
                slope = atom.slopes().get(signal)
                if slope is not None:
                    rest = product[:place] + product[place + 1 :]
                    total = total + slope * Expression({rest: factor})
        return total

    def without(self, atoms: Iterable[Atom]) -> Expression:
        """The products that hold none of `atoms`."""
        gone = set(atoms)
        return Expression({p: factor for p, factor in self.products.items() if not gone & set(p)})

    @property
    def atoms(self) -> set[Atom]:
        """The atoms in it."""
        return set().union(*self.products)

    def source(self) -> str:
        """Its text, which C and Python read alike; "" for a sum of nothing."""
        text = ""
        for product, factor in self.products.items():
            size = abs(factor)
            parts = list(names_in(product))
            if size != 1 or not parts:
                parts.insert(0, f"{size:g}")
            joined = " * ".join(parts)
            if text and factor < 0:
                text += f" - {joined}"
            elif text:
                text += f" + {joined}"
            elif factor < 0:
                text = f"-{joined}"
            else:
                text = joined
        return text


NOTHING = Expression({})
ONE = Expression({(): 1.0})


def as_expression(value: Expression | Number) -> Expression:
    """A number as an expression."""
    if isinstance(value, Expression):
        return value
    if not value:
        return NOTHING
    return Expression({(): float(value)})


class Values:
    """Values of products along one motion, each worked out once.

    Parameters
    ----------
    motion : Motion of N samples
    shape : Widths
    """

    def __init__(self, motion: Motion, shape: Widths) -> None:
        self._motion, self._shape = motion, shape
        self._known: dict[Product, FloatArray | float] = {(): 1.0}

    def of(self, product: Product) -> FloatArray | float:
        """The value of a product (N,); a float where no motion changes it."""
        if product not in self._known:
            last = product[-1]
            if last.constant is not None:
                value: FloatArray | float = last.constant(self._shape)
            else:
                value = last.value(self._motion, self._shape)
            if len(product) > 1:
                value = self.of(product[:-1]) * value
            self._known[product] = value
        return self._known[product]

    def sum(self, expression: Expression) -> FloatArray | float:
        """The value of an expression (N,), or a float."""
        total: FloatArray | float = 0.0
        for product, factor in expression.products.items():
            value = self.of(product)
            if factor != 1:
                value = factor * value
            total = total + value
        return total

    def into(self, place: FloatArray, expression: Expression) -> None:
        """Write the value of an expression into `place` (N,)."""
        first = True
        for product, factor in expression.products.items():
            value = self.of(product)
            if first:
                np.multiply(value, factor, out=place)
                first = False
            elif factor == 1:
                place += value
            else:
                place += factor * value
