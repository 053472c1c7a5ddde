"""The arm that carries the payload, from its result: coefficients, lengths, their covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import ResultError
from algid.base.names import outside, vector, within
from algid.estimators.noise import first_guess
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.estimators.whitening import (
    Linearised,
    NoiseLevels,
    first_trajectory,
    linearise,
    trajectory,
)
from algid.identification.known import (
    by_constants,
    covariance_of,
    model_of,
    noise_of,
    payload_length,
    prior_of,
    shift_of,
    untold,
    values_of,
    with_error_bar,
)
from algid.model import K3, K6, K7, SINES, TERMS, Model
from algid.options import flag
from algid.results import Result
from algid.signals.differences import Stencil
from algid.signals.segments import Segment

COULOMB = TERMS["coulomb"]
FRICTION = (K6, K7) + COULOMB.names
LENGTHS = ("l1", "l2")


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """The arm that carries the payload.

    Parameters
    ----------
    shared : Shared
        Its parameters: model, payload, lengths, and what the payload has that is no point.
    beta : (Q,)
        Theirs, with a payload of 1 kg.
    noise : NoiseLevels
    shift : float, s, after which a logged torque acts
    held : bool, whether each torque was held until the next
    """

    shared: Shared
    beta: FloatArray
    noise: NoiseLevels
    shift: float = 0.0
    held: bool = False

    @property
    def model(self) -> Model:
        """The torque's model."""
        return self.shared.model

    @property
    def k(self) -> FloatArray:
        """Coefficients (q,) of the bare arm."""
        return self.beta[: len(self.model.names)]

    def value(self, name: str) -> float:
        """The parameter of that name."""
        return float(self.beta[self.shared.names.index(name)])

    @property
    def unit(self) -> FloatArray:
        """D (q,): what a payload of 1 kg adds to the coefficients."""
        return self.shared.coefficients(self.beta, True) - self.k

    @property
    def friction(self) -> list[int]:
        """Which coefficients are viscous or Coulomb friction's."""
        return list(map(self.model.names.index, within(FRICTION, self.model.names)))

    @property
    def columns(self) -> FloatArray:
        """U (1 + f, q): the columns of a kilogram and of friction out of all."""
        return np.vstack([self.unit, np.eye(self.k.size)[self.friction]])

    @property
    def tip_equivalent(self) -> float:
        """Mass in kg that at the tip has the inertia k3 of link 2 about joint 2."""
        return abs(self.value(K3)) / self.value("l2") ** 2

    @property
    def by_shape(self) -> FloatArray:
        """Derivatives (2 + b, q) of `unit` by l1, l2 and the payload's body."""
        return self.shared.jacobian(self.beta, True).T[self.k.size + 1 :]

    def times(self, piece: Segment) -> FloatArray:
        """Stamps (n,) in s of a piece's torques whose stencil lies within its angles."""
        return piece.t[Stencil(piece.dt, self.shift).torques(len(piece))]

    def linearised(self, piece: Segment, c: FloatArray, *, settle: bool = True) -> Linearised:
        """A piece of log, linearised at the coefficients `c` and whitened.

        `c` is (q,), or (q, n) by torque sample. With `settle` it is linearised once more at the
        trajectory of the fit before, which has less noise in its accelerations.
        """
        stencil = Stencil(piece.dt, self.shift, self.held, self.model.lag(self.k))
        theta = first_trajectory(piece.theta, piece.dt)
        if settle:
            first = linearise(self.model, c, theta, piece, stencil, self.noise, residual_only=True)
            theta = trajectory(piece, first, self.noise)
        return linearise(self.model, c, theta, piece, stencil, self.noise)


def arm_of(result: Result, first: Segment, **given: float) -> tuple[IdentifiedArm, FloatArray]:
    """The arm of a result with link lengths from it or given, and the covariance (p, p) of both.

    A given length goes before the one that the result was made with, and that before its estimate.
    After the q coefficients come l1, l2 and the payload's body. The model
    always has Coulomb friction, zero with no error where the result has none: friction may drift.

    Noise levels are the result's; where it has none, those of the log's first stretch.

    Raises
    ------
    ResultError
        If the result leaves a constant or a link length open.
    """
    if result.fit is None:
        raise ResultError(
            f"{result.log.path}: the result of {flag('estimator')} {result.estimator} has no error "
            f"bars; identify with {flag('estimator')} refined or weak"
        )
    model = model_of(result)
    prior = prior_of(result, model)
    if COULOMB.name not in model.terms:
        model = replace(model, terms=model.terms + (COULOMB.name,))
    stated = {name: result.settings[name] for name in LENGTHS if result.settings.get(name)}
    value = values_of(result) | dict.fromkeys(untold(result, model), 0.0) | stated | given
    m_p, J = value.get("m_p", 0.0), value.get("J_p", 0.0)
    value |= {"m_p": 1.0, "J_p": max(J, 0.0) / m_p if m_p > 0 else 0.0}
    if set(SINES).isdisjoint(model.names):
        value["y_p"] = 0.0
    known = with_error_bar(result, BODY_PARAMETERS) if m_p else ()
    body = tuple(name for name in BODY_PARAMETERS if value.get(name) or name in known)
    shared = Shared(model, payload=True, body=body)
    names, mass = shared.names, len(model.names)
    kept = outside(names, ("m_p",))
    T = np.delete(np.eye(len(names)), mass, axis=0)
    uncertain = {*prior.names, *known, *with_error_bar(result, outside(LENGTHS, given))}
    if "J_p" in known:  # of each kilogram: the derivatives of J_p / m_p
        T[kept.index("J_p"), [names.index("J_p"), mass]] = 1 / m_p, -J / m_p**2
        if "m_p" in result.fit.covariance_names:
            uncertain.add("m_p")
    if "l1" not in stated | given and payload_length(result) is None:
        constants = by_constants(result)
        if constants is not None and constants[0] > 0:
            value["l1"], _, slopes = constants
            T[kept.index("l1")] = vector(names, slopes, otherwise=0.0)
    for name in outside(LENGTHS, value):
        raise ResultError(
            f"{result.log.path}: its result has no {name}; give the link's length with {flag(name)}"
        )
    acts = shift_of(result)
    arm = IdentifiedArm(
        shared,
        vector(names, value, otherwise=0.0),
        noise_of(result) or first_guess(first.theta, first.tau),
        acts.at(first.dt),
        acts.held,
    )
    return arm, T @ covariance_of(result, names, uncertain) @ T.T
