"""Belief about an arm before its run: its error, and the parameters that a design is to determine.

β = β̄ + F u, where u is standard normal (a result's covariance) or anywhere in the box |u| ≤ 1
(masses and friction of which only a percentage is known, each its own u). Torques are linear in a
log's coefficients, so the largest torque that any such arm asks for has a closed form: |Y c̄| + Σ
|Y F| over the box, |Y c̄| + z ‖Y F‖ for the normal.

======  ===========================================  =======
symbol  name                                         shape
======  ===========================================  =======
β̄       parameters as they are believed to be        (Q,)
F       how they vary                                (Q, r)
c̄       coefficients of a log                        (q,)
======  ===========================================  =======

A design makes the largest relative bound among the parameters asked for small. The Cramér-Rao
bound of parameter i is the root of C_ii, C = S⁻¹; relative to the size s_i of the parameter, its
square is v_i. Their p-norm stands in for the largest, so that the figure has a derivative:

    J = ½ log (Σ v_i^p)^(1/p),   dJ = tr(A dS),   A = −C diag(∂J/∂C_ii) C
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.significance import SURE
from algid.estimators.identifiability import sizes
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS, Shared
from algid.model import DELAYS
from algid.options import flag

UNKNOWN = 1e3  # relative bound at which a parameter that the motion leaves open is held
_ROUND = 1e-6  # of the largest torque: how the corners of |Y F| are rounded
# N m, whose share squared is a double still: an arm at rest without weight asks for no torque at
# all
_TINY = 1e-100
_SEEN = 2.0  # standard deviations of the prior from zero, for a parameter to have a size of its own


@dataclass(frozen=True, eq=False)
class Load:
    """Coefficients of one kind of log: mean c (q,), and spread F (q, r), in a box or normal."""

    loaded: bool
    c: FloatArray
    F: FloatArray
    box: bool

    def largest(self, Y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean arm's torque (2, N), most that others add (2, N), its derivative by Y (2, q, N)."""
        torque = np.einsum("aqn,q->an", Y, self.c)
        varied = np.einsum("aqn,qr->arn", Y, self.F)
        least = _ROUND * max(float(np.abs(torque).max()), _TINY)
        # of a box each part by itself, of a normal all of them together
        squares = varied**2 if self.box else np.sum(varied**2, axis=1, keepdims=True)
        size, far = np.sqrt(squares + least**2), 1.0 if self.box else SURE
        slope = np.einsum("arn,qr->aqn", varied / size, self.F)
        return torque, far * size.sum(axis=1), far * slope


@dataclass(frozen=True, eq=False)
class Belief:
    """Parameters of an arm, and how wrong they may be: see the module's table.

    Parameters
    ----------
    shared : Shared
        Which parameters there are, the payload's among them.
    mean : (Q,)
    spread : (Q, r)
    box : bool
        Whether u lies in a box; else it is standard normal.
    """

    shared: Shared
    mean: FloatArray
    spread: FloatArray
    box: bool

    def load(self, loaded: bool) -> Load:
        """Coefficients of the logs without or with the payload; a delay is none of the torque's."""
        q = len(self.shared.model.names)
        T = self.shared.jacobian(self.mean, loaded)[:q]
        c = self.shared.coefficients(self.mean, loaded)[:q]
        return Load(loaded, c, T @ self.spread, self.box)

    def draws(self, count: int, seed: int) -> FloatArray:
        """Arms (count, Q) drawn from the belief."""
        rng = np.random.default_rng(seed)
        shape = (count, self.spread.shape[1])
        u = rng.uniform(-1, 1, shape) if self.box else rng.standard_normal(shape)
        return self.mean + u @ self.spread.T

    @property
    def std(self) -> FloatArray:
        """Standard deviations (Q,)."""
        return np.sqrt(np.sum(self.spread**2, axis=1) * (1 / 3 if self.box else 1))


@dataclass(frozen=True, eq=False)
class Objective:
    """Sizes (Q,) of the parameters, which of them the prior knows (Q,), and the wanted ones (Q,).

    A parameter whose prior is not significantly different from zero has the size of its class.
    """

    size: FloatArray
    known: NDArray[np.bool_]
    wanted: NDArray[np.bool_]

    def covariance(self, S: FloatArray) -> FloatArray:
        """Covariance (Q, Q) of the estimates.

        A direction that S leaves open is held at `UNKNOWN` sizes. S has no negative eigenvalue but
        by rounding.
        """
        size = np.outer(self.size, self.size)
        values, axes = np.linalg.eigh(0.5 * (S + S.T) * size)
        return (axes / (np.maximum(values, 0.0) + 1 / UNKNOWN**2)) @ axes.T * size

    def relative(self, S: FloatArray) -> FloatArray:
        """Relative bounds (Q,)."""
        return np.sqrt(np.diag(self.covariance(S))) / self.size

    def largest(self, S: FloatArray) -> float:
        """The largest relative bound among the wanted."""
        return float(self.relative(S)[self.wanted].max())

    def figure(self, S: FloatArray, sharpness: float) -> tuple[float, FloatArray]:
        """J for the p-norm of that `sharpness`, and its derivative A (Q, Q) by S."""
        C = self.covariance(S)
        v = np.diag(C) / self.size**2
        top = v[self.wanted].max()
        parts = np.where(self.wanted, v / top, 0.0) ** sharpness
        total = parts.sum()
        by_diagonal = 0.5 * parts / (total * v * self.size**2)
        return 0.5 * float(np.log(top) + np.log(total) / sharpness), -(C * by_diagonal) @ C


def objective_of(belief: Belief, names: Sequence[str] | None, source: str) -> Objective:
    """What a design for the parameters `names` makes small.

    For all that the prior knows where None, but for a delay.

    Raises
    ------
    SettingError
        If there is no such parameter, or it is not significant in the prior, so that it has no
        relative bound.
    """
    every, mean = belief.shared.names, belief.mean
    known = np.abs(mean) > _SEEN * belief.std
    size = np.where(known, np.abs(mean), sizes(every, mean))
    if names is None:
        return Objective(size, known, known & ~np.isin(every, DELAYS))
    for name in names:
        if name not in every:
            hint = ""
            if name in PAYLOAD_PARAMETERS:
                hint = " (there are no loaded runs)"
            raise SettingError(
                f"{flag('for')} {name}: expected some of {', '.join(every)}, found {name!r}{hint}; "
                "leave it out"
            )
        place = every.index(name)
        if not known[place]:
            raise SettingError(
                f"{flag('for')} {name}: {source} cannot tell it from zero ({mean[place]:.3g} ± "
                f"{belief.std[place]:.2g}), so that no error is large or small beside it; leave it "
                "out"
            )
    return Objective(size, known, np.isin(every, list(names)))
