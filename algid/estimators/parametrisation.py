"""The parameters that several logs share, and the chain rule to each log's own coefficients.

======  ==============================================================  ========
symbol  name                                                            shape
======  ==============================================================  ========
beta    shared parameters: columns, delay, then m_p, l1, l2             (Q,)
c       coefficients of one log: columns, delay                         (q,)
T       dc/dβ                                                           (q, Q)
======  ==============================================================  ========

A loaded log obeys the same equations with the constants of `algid.arm.with_payload`, so that it informs about
the arm as well as about its payload.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from algid.arm import FloatArray, payload_constants
from algid.model import DELAYS, Model
from algid.physics.parameters import PAYLOAD

PAYLOAD_PARAMETERS = tuple(one.name for one in PAYLOAD)
_LOADED = {"k1": 2, "k2": 4, "k3": 1, "k4": 3, "k5": 0}  # which z adds to which k: eq. (5) against eq. (3)


@dataclass(frozen=True, eq=False)
class Shared:
    """Which parameters are estimated.

    Parameters
    ----------
    model : Model
    delay : bool
        Whether the delay is one of them.
    payload : bool
        Whether there are loaded logs.
    lengths : dict
        Known link lengths "l1", "l2" in m, which are not estimated.
    """

    model: Model
    delay: bool = False
    payload: bool = False
    lengths: dict[str, float] = field(default_factory=dict)

    @cached_property
    def log_names(self) -> tuple[str, ...]:
        """Names of the coefficients of one log."""
        return self.model.names + (DELAYS if self.delay else ())

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the shared parameters."""
        if not self.payload:
            return self.log_names
        return self.log_names + tuple(name for name in PAYLOAD_PARAMETERS if name not in self.lengths)

    def physical(self, beta: FloatArray) -> tuple[float, float, float]:
        """m_p, l1, l2."""
        value = dict(zip(self.names, map(float, beta), strict=True)) | self.lengths
        return value["m_p"], value["l1"], value["l2"]

    def coefficients(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """Coefficients c (q,) of a log."""
        c = beta[: len(self.log_names)].copy()
        if loaded:
            z = payload_constants(*self.physical(beta), self.model.gravity)
            for row, part in self._rows():
                c[row] += z[part]
        return c

    def jacobian(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """T (q, Q)."""
        T = np.eye(len(self.log_names), len(self.names))
        if loaded:
            m_p, l1, l2 = self.physical(beta)
            g = self.model.gravity
            slope = {
                "m_p": (l1**2, l2**2, l1 * l2, g * l1, g * l2),
                "l1": (2 * m_p * l1, 0.0, m_p * l2, m_p * g, 0.0),
                "l2": (0.0, 2 * m_p * l2, m_p * l1, 0.0, m_p * g),
            }
            for column in range(len(self.log_names), len(self.names)):
                for row, part in self._rows():
                    T[row, column] = slope[self.names[column]][part]
        return T

    def _rows(self) -> list[tuple[int, int]]:
        return [(row, _LOADED[name]) for row, name in enumerate(self.log_names) if name in _LOADED]
