"""What a term of the torque says of itself.

A term of motion writes each of its columns as three vectors, by the least derivative they need,

    τ = d²s/dt² + dp/dt + f,   s(θ), p(θ, ω), f(θ, ω)

and the regressor, the moments over windows, M(θ), the dynamics, the partials and the exports all
derive from them. A term that acts on the torque's channel instead says which parameters do so, and
has no columns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Literal

from algid.base.names import names_in
from algid.physics.parameters import Parameter
from algid.physics.signals import MOTION, NOTHING, Atom, Expression, rate

Vector = tuple[Expression, Expression]
NONE: Vector = (NOTHING, NOTHING)


@dataclass(frozen=True)
class TorqueColumn:
    """The torque of both joints per unit of a parameter: d²s/dt² + dp/dt + f."""

    parameter: str
    s: Vector = NONE
    p: Vector = NONE
    f: Vector = NONE

    @cached_property
    def torque(self) -> Vector:
        """What it adds to each joint's torque."""
        one, two = map(lambda s, p, f: rate(rate(s)) + rate(p) + f, self.s, self.p, self.f)
        return one, two

    @cached_property
    def partials(self) -> Mapping[Atom, Vector]:
        """The derivatives of its torque by angles, velocities and accelerations."""
        one, two = self.torque
        return {signal: (one.by(signal), two.by(signal)) for signal in chain(*MOTION)}


@dataclass(frozen=True)
class PriorSpread:
    """How large physics lets a term's coefficients be, before any log.

    Parameters
    ----------
    size : float
        The largest spread, in what `of` names.
    of : str
        "torque" (RMS of the joint's), "inertia" (k3), "compliance" (one over the joint's inertia,
        k5 or k3), "cosine" (the constant whose sine part a coefficient is), or "unit", the
        coefficient's own.
    usual : float
        What most arms have of `size`.
    """

    size: float
    of: Literal["torque", "inertia", "compliance", "cosine", "unit"] = "unit"
    usual: float = 0.5


@dataclass(frozen=True)
class Term:
    """A term of the torque. Where it needs nothing special, it leaves the rest out.

    Parameters
    ----------
    name : str, as ``--model`` has it
    title : str, in words
    equation : str, what it adds to the torque of joint i
    parameters : tuple of Parameter
    columns : tuple of TorqueColumn, of a term of motion
    needs : str or None
        A term without which it has no meaning.
    inertial : bool
        Whether its columns are the joints' load, on which friction may depend: inertia, Coriolis
        and gravity.
    usual : bool
        Whether most real joints have it: other terms are weighed beside it first.
    shapes : names of the widths that its columns have, fields of `algid.physics.signals.Widths`
    by_load : pairs of a parameter and a joint: load times smooth sign of velocity it multiplies
    elastic : pairs of a parameter and the joint whose compliance it is
    of_motor : pairs of a parameter and the one of which it is the motor's share, by name
    gains : pairs of a parameter g and the joint whose torque it multiplies by 1 + g
    sines : pairs of a parameter and the one whose sine part it is: both are one phasor
    timing : "delay" or "lag"
        Whether its one parameter is a time by which the torque is late, as a whole or after a
        low-pass.
    damping, friction, rotor : pairs of a parameter and the joint
        Whose viscous and dry friction and rotor inertia it is, as robots' descriptions have them.
    spread : PriorSpread or None
        What its coefficients are shrunk by; None leaves them free.
    """

    name: str
    title: str
    equation: str
    parameters: tuple[Parameter, ...]
    columns: tuple[TorqueColumn, ...] = ()
    needs: str | None = None
    inertial: bool = False
    usual: bool = False
    shapes: tuple[str, ...] = ()
    by_load: tuple[tuple[str, int], ...] = ()
    elastic: tuple[tuple[str, int], ...] = ()
    of_motor: tuple[tuple[str, str], ...] = ()
    gains: tuple[tuple[str, int], ...] = ()
    sines: tuple[tuple[str, str], ...] = ()
    timing: Literal["delay", "lag"] | None = None
    damping: tuple[tuple[str, int], ...] = ()
    friction: tuple[tuple[str, int], ...] = ()
    rotor: tuple[tuple[str, int], ...] = ()
    spread: PriorSpread | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return names_in(self.parameters)

    @property
    def unit(self) -> str:
        """Unit of its parameters, which are alike."""
        return self.parameters[0].unit

    @property
    def delays(self) -> bool:
        """Whether it is a time by which the torque is late as a whole."""
        return self.timing == "delay"

    @property
    def lags(self) -> bool:
        """Whether it is the time constant of a low-pass of the torque."""
        return self.timing == "lag"

    @property
    def linear(self) -> bool:
        """Whether the torque is linear in its parameters beside those of other terms."""
        return not (self.by_load or self.gains or self.elastic)
