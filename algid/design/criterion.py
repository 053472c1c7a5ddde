"""The figure that a design makes small: the largest relative bound among the parameters asked for.

The Cramér-Rao bound of parameter i is the root of C_ii, C = S⁻¹; relative to the size s_i of the parameter, its square
is v_i. Their p-norm stands in for the largest, so that the figure has a derivative:

    J = ½ log (Σ v_i^p)^(1/p),   dJ = tr(A dS),   A = −C diag(∂J/∂C_ii) C
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.design.belief import Belief
from algid.errors import SettingError
from algid.estimators.identifiability import sizes
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS

UNKNOWN = 1e3  # relative bound at which a parameter that the motion leaves open is held
_SEEN = 2.0  # standard deviations of the prior from zero, for a parameter to have a size of its own


@dataclass(frozen=True, eq=False)
class Asked:
    """Sizes (Q,) of the parameters, which of them the prior knows (Q,), and which the design is for (Q,).

    What the prior cannot tell from zero has the size of its class.
    """

    size: FloatArray
    known: NDArray[np.bool_]
    wanted: NDArray[np.bool_]

    def covariance(self, S: FloatArray) -> FloatArray:
        """Covariance (Q, Q) of the estimates; a direction that S leaves open is held at `UNKNOWN` sizes."""
        scaled = S * np.outer(self.size, self.size) + np.eye(self.size.size) / UNKNOWN**2
        return np.linalg.inv(0.5 * (scaled + scaled.T)) * np.outer(self.size, self.size)

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


def asked_for(belief: Belief, names: Sequence[str] | None, source: str) -> Asked:
    """What a design for the parameters `names` makes small; for all that the prior knows where None.

    Raises
    ------
    SettingError
        If there is no such parameter, or the prior cannot tell it from zero, so that it has no relative bound.
    """
    every, mean = belief.shared.names, belief.mean
    known = np.abs(mean) > _SEEN * belief.std
    size = np.where(known, np.abs(mean), sizes(every, mean))
    if names is None:
        return Asked(size, known, known)
    for name in names:
        if name not in every:
            hint = " (there are no loaded runs)" if name in PAYLOAD_PARAMETERS else ""
            raise SettingError(f"--for {name}: expected some of {', '.join(every)}, found {name!r}{hint}; leave it out")
        place = every.index(name)
        if not known[place]:
            raise SettingError(
                f"--for {name}: {source} cannot tell it from zero ({mean[place]:.3g} ± {belief.std[place]:.2g}), so "
                "that no error is large or small beside it; leave it out"
            )
    return Asked(size, known, np.array([name in names for name in every]))
