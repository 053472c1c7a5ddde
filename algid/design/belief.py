"""What is believed of an arm before its run: parameters, and how wrong they may be.

β = β̄ + F u, where u is standard normal (a result's covariance) or anywhere in the box |u| ≤ 1 (masses and friction
of which only a percentage is known, each its own u). Torques are linear in a log's coefficients, so the largest
torque that any such arm asks for has a closed form: |Y c̄| + Σ |Y F| over the box, |Y c̄| + z ‖Y F‖ for the normal.

======  ===========================================  =======
symbol  name                                         shape
======  ===========================================  =======
β̄       parameters as they are believed to be        (Q,)
F       how they vary                                (Q, r)
c̄       coefficients of a log                        (q,)
======  ===========================================  =======
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.estimators.parametrisation import Shared

SURE = 4.0  # z: standard deviations of the prior within which no limit breaks; beyond are 6 arms in 100,000
_ROUND = 1e-6  # of the largest torque: how the corners of |Y F| are rounded


@dataclass(frozen=True, eq=False)
class Load:
    """Coefficients of one kind of log: mean c (q,), and how they vary F (q, r), within a box or normally."""

    loaded: bool
    c: FloatArray
    F: FloatArray
    box: bool

    def largest(self, Y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Torque of the mean arm (2, N), what other arms add at most (2, N), and its derivative by Y (2, q, N)."""
        torque = np.einsum("aqn,q->an", Y, self.c)
        varied = np.einsum("aqn,qr->arn", Y, self.F)
        least = _ROUND * (np.abs(torque).max() + 1e-300)
        if self.box:
            size = np.sqrt(varied**2 + least**2)
            return torque, size.sum(axis=1), np.einsum("arn,qr->aqn", varied / size, self.F)
        size = np.sqrt(np.sum(varied**2, axis=1) + least**2)
        slope = np.einsum("arn,qr->aqn", varied, self.F) / size[:, None]
        return torque, SURE * size, SURE * slope


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
        """Coefficients of the logs without or with the payload."""
        T = self.shared.jacobian(self.mean, loaded)
        return Load(loaded, self.shared.coefficients(self.mean, loaded), T @ self.spread, self.box)

    def draws(self, count: int, seed: int) -> FloatArray:
        """Arms (count, Q) drawn from the belief."""
        rng = np.random.default_rng(seed)
        shape = (count, self.spread.shape[1])
        u = rng.uniform(-1, 1, shape) if self.box else rng.standard_normal(shape)
        return self.mean + u @ self.spread.T

    @property
    def std(self) -> FloatArray:
        """Standard deviations (Q,)."""
        return np.sqrt(np.sum(self.spread**2, axis=1) * (1 / 3 if self.box else 1.0))
