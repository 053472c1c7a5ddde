"""The parameters that several logs share, and the chain rule to each log's own coefficients.

======  ==============================================================  ========
symbol  name                                                            shape
======  ==============================================================  ========
beta    shared parameters: columns, delay, then m_p, l1, l2, y_p, J_p   (Q,)
c       coefficients of one log: columns, delay                         (q,)
T       dc/dβ                                                           (q, Q)
======  ==============================================================  ========

A loaded log obeys the same equations with the constants of `algid.arm.with_payload`, so that it
informs about the arm as well as about its payload.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from algid.arm import FloatArray, payload_phasors
from algid.base.names import names_in, outside
from algid.model import DELAYS, PARAMETERS, SINE_OF, SINES, Model
from algid.physics.parameters import BODY, PAYLOAD
from algid.physics.terms.rigid import K1, K2

BODY_PARAMETERS = names_in(BODY)
PAYLOAD_PARAMETERS = names_in(PAYLOAD) + BODY_PARAMETERS
# which z adds to which coefficient, and its part: the moments are phasors
_LOADED: dict[str, tuple[int, str]] = {}
for _name, _parameter in PARAMETERS.items():
    if _parameter.payload is not None:
        _LOADED[_name] = (_parameter.payload, "real")
for _sine, _cosine in SINES.items():
    _LOADED[_sine] = (_LOADED[_cosine][0], "imag")


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

    def turn(self, beta: FloatArray) -> tuple[float, FloatArray]:
        """Correction to add to θ1, arg K2 - arg K1 in rad; its derivative (q,) by coefficients."""
        slope = np.zeros(len(self.log_names))
        turn = 0.0
        for cosine, sine, sign in self._phasors:
            K = complex(beta[cosine], beta[sine])
            turn += sign * float(np.angle(K))
            size = max(abs(K) ** 2, 1e-300)
            slope[cosine] -= sign * K.imag / size
            slope[sine] += sign * K.real / size
        return turn, slope

    @cached_property
    def _phasors(self) -> tuple[tuple[int, int, float], ...]:
        """Places of both parts of K2 and K1 and their signs in the turn; () where one has none."""
        place, places = self.model.compiled.place, []
        for name, sign in ((K2, 1.0), (K1, -1.0)):
            sine = SINE_OF.get(name, "")
            if sine not in place or name not in place:
                return ()
            places.append((place[name], place[sine], sign))
        return tuple(places)

    def coefficients(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """Coefficients c (q,) of a log."""
        c = beta[: len(self.log_names)].copy()
        if loaded:
            turn, _ = self.turn(beta)
            z = payload_phasors(*self.physical(beta), self.model.gravity, turn)
            for row, (part, side) in self._rows:
                c[row] += getattr(z[part], side)
        return c

    def jacobian(self, beta: FloatArray, loaded: bool) -> FloatArray:
        """T (q, Q)."""
        q, Q = len(self.log_names), len(self.names)
        T = np.eye(q, Q)
        if loaded:
            turn, slope = self.turn(beta)
            z = payload_phasors(*self.physical(beta), self.model.gravity, turn)
            turned = (0.0, 0.0, 0.0, 1j * z[3], 1j * z[4])
            for row, (part, side) in self._rows:
                T[row, :q] += getattr(complex(turned[part]), side) * slope
            # the payload's part is quadratic in each of its parameters: any step is exact
            for place in range(q, Q):
                step = np.eye(1, Q, place)[0]
                ahead, behind = (self.coefficients(beta + own, True) for own in (step, -step))
                T[:, place] = 0.5 * (ahead - behind)
        return T

    @cached_property
    def _rows(self) -> list[tuple[int, tuple[int, str]]]:
        return [(row, _LOADED[name]) for row, name in enumerate(self.log_names) if name in _LOADED]
