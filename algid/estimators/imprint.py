"""What torques beside a model's own leave in the whitened residual of logs.

======  =================================================  ================  =================
symbol  name                                               shape             unit
======  =================================================  ================  =================
Y       columns of the shared parameters                   (2 n, Q)          N m / parameter's
G       torques beside them                                (2 n, m)          N m
e       residual of the torque                             (2 n,)            N m
V       its covariance                                     (2 n, 2 n)        N² m²
======  =================================================  ================  =================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import Prior, scaled_pinv
from algid.estimators.fit import Fit


@dataclass(frozen=True, eq=False)
class Imprint:
    """Products of a log's whitened columns: derivatives by c, the residual, the torques beside.

    Parameters
    ----------
    loaded : bool
    gram : (q + 1 + m, q + 1 + m)
    """

    loaded: bool
    gram: FloatArray


@dataclass(frozen=True, eq=False)
class Imprints:
    """Of all logs: YᵀV⁻¹Y with the prior, YᵀV⁻¹G, GᵀV⁻¹G, YᵀV⁻¹e and GᵀV⁻¹e."""

    S: FloatArray
    X: FloatArray
    GG: FloatArray
    Ye: FloatArray
    Ge: FloatArray

    def beside(self) -> Leftover:
        """What is left of the torques beside where the parameters take up what they can."""
        D = scaled_pinv(self.S) @ self.X
        return Leftover(D, self.GG - self.X.T @ D, self.Ge - D.T @ self.Ye)


class Leftover(NamedTuple):
    """D = S⁻¹X, their information GᵀV⁻¹G − XᵀD and their score GᵀV⁻¹e − DᵀYᵀV⁻¹e."""

    D: FloatArray
    information: FloatArray
    score: FloatArray


def summed(fit: Fit, imprints: Sequence[Imprint], prior: Prior | None) -> Imprints:
    """The products of all logs, by the fit's parameters.

    Parameters
    ----------
    fit : Fit
    imprints : of each log, one at least, with the same torques beside
    prior : Prior, optional
        What held the fit beside its logs.
    """
    size = len(fit.names)
    count = len(imprints[0].gram) - fit.shared.jacobian(fit.values, imprints[0].loaded).shape[0] - 1
    whole = np.zeros((size + 1 + count, size + 1 + count))
    for one in imprints:
        T = fit.shared.jacobian(fit.values, one.loaded)
        by_shared = np.eye(T.shape[0] + 1 + count, size + 1 + count, size - T.shape[0])
        by_shared[: T.shape[0], :size] = T
        whole += by_shared.T @ one.gram @ by_shared
    S, G = whole[:size, :size], slice(size + 1, None)
    if prior is not None:
        places = prior.places(fit.names)
        S[np.ix_(places, places)] += prior.precision
    return Imprints(S, whole[:size, G], whole[G, G], whole[:size, size], whole[G, size])
