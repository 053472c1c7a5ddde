"""How well a torque is predicted where a joint moves, and where it stands.

Where a joint stands, dry friction is any torque up to ± f: no model predicts which. Of a joint
slower than friction's step ω_s is therefore stated, beside the residual r, how far the torque lies
from all that friction f may be there,

    d = |r + f tanh(ω / ω_s)| − f, where that is positive; else 0
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from algid.arm import FloatArray
from algid.model import F1, F2, Model

FRICTIONS = (F1, F2)


def _nothing() -> FloatArray:
    return np.zeros(2)


@dataclass(frozen=True, eq=False)
class Standing:
    """Sums by joint (2,): samples and squared residuals, moving and at rest; d² at rest."""

    moving: FloatArray = field(default_factory=_nothing)
    moving_square: FloatArray = field(default_factory=_nothing)
    rest: FloatArray = field(default_factory=_nothing)
    rest_square: FloatArray = field(default_factory=_nothing)
    held_square: FloatArray = field(default_factory=_nothing)

    def __add__(self, other: Standing) -> Standing:
        return Standing(
            *(getattr(self, one.name) + getattr(other, one.name) for one in fields(self))
        )

    @property
    def rmse_moving(self) -> FloatArray:
        """RMSE (2,) in N m of a joint that moves; NaN where it never does."""
        return _rmse(self.moving_square, self.moving)

    @property
    def rmse_rest(self) -> FloatArray:
        """RMSE (2,) in N m of a joint that stands; NaN where it never does."""
        return _rmse(self.rest_square, self.rest)

    @property
    def rmse_held(self) -> FloatArray:
        """The same beyond what friction may be there."""
        return _rmse(self.held_square, self.rest)


def _rmse(square: FloatArray, count: FloatArray) -> FloatArray:
    return np.sqrt(np.divide(square, count, out=np.full(2, np.nan), where=count > 0))


def standing(model: Model, c: FloatArray, X: FloatArray, omega: FloatArray) -> Standing:
    """Sums over a piece.

    Parameters
    ----------
    model : Model
    c : (q,)
    X : (2, q + 1, n)
        Regressor of each joint, its torque last.
    omega : (2, n), rad/s
    """
    r = X[:, -1] - np.einsum("q,aqn->an", c, X[:, :-1])
    still = np.abs(omega) < model.coulomb_speed
    held = np.abs(r)
    for joint, name in enumerate(FRICTIONS):
        if name in model.names:
            place = model.names.index(name)
            f = max(float(c[place]), 0.0)
            held[joint] = np.maximum(np.abs(r[joint] + f * X[joint, place]) - f, 0.0)
    return Standing(
        np.sum(~still, axis=1).astype(np.float64),
        np.sum(np.where(still, 0.0, r**2), axis=1),
        np.sum(still, axis=1).astype(np.float64),
        np.sum(np.where(still, r**2, 0.0), axis=1),
        np.sum(np.where(still, held**2, 0.0), axis=1),
    )
