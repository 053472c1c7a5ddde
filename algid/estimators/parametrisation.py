"""The parameters that several logs share, and the chain rule to each log's own coefficients.

======  ==============================================================  ========
symbol  name                                                            shape
======  ==============================================================  ========
beta    shared parameters: columns, delay, then m_p, l1, l2, y_p, J_p   (Q,)
c       coefficients of one log: columns, delay                         (q,)
T       dc/dβ                                                           (q, Q)
======  ==============================================================  ========

A loaded log obeys the same equations with the constants of `algid.arm.Arm.phasors`, so that it
informs about the arm as well as about its payload.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray, payload_phasors
from algid.base.names import names_in, outside, within
from algid.model import DELAYS, PARAMETERS, SINE_OF, SINES, Model
from algid.physics.parameters import BODY, PAYLOAD
from algid.physics.terms.rigid import K1, K2

BODY_PARAMETERS = names_in(BODY)
PAYLOAD_PARAMETERS = names_in(PAYLOAD) + BODY_PARAMETERS
# which of z adds to which coefficient, by its place among real and imaginary parts in turn
_LOADED = {name: 2 * one.payload for name, one in PARAMETERS.items() if one.payload is not None}
_LOADED |= {sine: _LOADED[cosine] + 1 for sine, cosine in SINES.items()}
_UPRIGHT = np.array([0, 0, 0, 1, 1])  # which of z turn with the arm: those of gravity


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
    body : names among `algid.physics.parameters.BODY`
        What the payload has that is no point at the tip.
    """

    model: Model
    delay: bool = False
    payload: bool = False
    lengths: dict[str, float] = field(default_factory=dict)
    body: tuple[str, ...] = ()

    @cached_property
    def log_names(self) -> tuple[str, ...]:
        """Names of the coefficients of one log."""
        if self.delay:
            return self.model.names + DELAYS
        return self.model.names

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the shared parameters."""
        if not self.payload:
            return self.log_names
        free = outside(names_in(PAYLOAD), self.lengths)
        return self.log_names + free + self.body

    def physical(self, beta: FloatArray) -> tuple[float, float, complex, float]:
        """m_p, l1, the payload's place x + i y, and its inertia."""
        value = dict(zip(self.names, map(float, beta), strict=True)) | self.lengths
        return (
            value["m_p"],
            value["l1"],
            complex(value["l2"], value.get("y_p", 0.0)),
            value.get("J_p", 0.0),
        )

    def phase(self, beta: FloatArray, *moments: str) -> tuple[float, FloatArray]:
        """Arg K - arg K' + arg K'' of `moments` in rad, and its derivative (q,) by coefficients.

        Nothing where the first has no sine part. That of K2 and K1 is to be added to θ1.
        """
        slope, phase = np.zeros(len(self.log_names)), 0.0
        place = self.model.compiled.place
        if SINE_OF.get(moments[0]) not in place:
            return phase, slope
        for name, sign in zip(moments, (1.0, -1.0, 1.0), strict=False):
            cosine, sine = place[name], place[SINE_OF[name]]
            K = complex(beta[cosine], beta[sine])
            phase += sign * float(np.angle(K))
            size = max(abs(K) ** 2, 1e-300)
            slope[cosine] -= sign * K.imag / size
            slope[sine] += sign * K.real / size
        return phase, slope

    def moments(self, beta: FloatArray) -> NDArray[np.complex128]:
        """The payload's constants and phasors z (5,)."""
        turn, _ = self.phase(beta, K2, K1)
        return np.array(payload_phasors(*self.physical(beta), self.model.gravity, turn))

    def coefficients(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """Coefficients c (q,) of a log."""
        c = beta[: len(self.log_names)].copy()
        if loaded:
            rows, parts = self._loaded
            c[rows] += self.moments(beta).view(np.float64)[parts]
        return c

    def jacobian(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """T (q, Q)."""
        q, Q = len(self.log_names), len(self.names)
        T = np.eye(q, Q)
        if loaded:
            (rows, parts), (_, slope) = self._loaded, self.phase(beta, K2, K1)
            turned = 1j * self.moments(beta) * _UPRIGHT
            T[rows, :q] += turned.view(np.float64)[parts, None] * slope
            # the payload's part is quadratic in each of its parameters: any step is exact
            for place in range(q, Q):
                step = np.eye(1, Q, place)[0]
                ahead, behind = (self.coefficients(beta + own, True) for own in (step, -step))
                T[:, place] = 0.5 * (ahead - behind)
        return T

    @cached_property
    def _loaded(self) -> tuple[list[int], list[int]]:
        """Places of the coefficients that a payload adds to, and of what it adds."""
        names = within(self.log_names, _LOADED)
        return list(map(self.log_names.index, names)), [_LOADED[name] for name in names]
