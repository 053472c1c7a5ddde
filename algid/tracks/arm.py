"""The arm that carries the payload, from its result: coefficients, lengths, their covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import ResultError
from algid.base.names import vector, within
from algid.estimators.noise import first_guess
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.estimators.whitening import Linearised, NoiseLevels, linearise, trajectory
from algid.identification.known import (
    by_constants,
    covariance_of,
    has_error_bar,
    model_of,
    noise_of,
    payload_length,
    prior_of,
    shift_of,
    with_error_bar,
)
from algid.model import K3, K6, K7, SINES, TERMS, Model
from algid.options import flag
from algid.results import Result
from algid.signals.differences import Stencil
from algid.signals.filters import smoothed
from algid.signals.segments import Segment

SMOOTHING = 40.0  # Hz: arms move slower; of the trajectory at which a piece is first linearised
COULOMB = TERMS["coulomb"]
FRICTION = (K6, K7) + COULOMB.names


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """The arm that carries the payload: model, coefficients k (q,), link lengths in m, noise."""

    model: Model
    k: FloatArray
    l1: float
    l2: float
    noise: NoiseLevels
    shift: float = 0.0
    y: float = 0.0
    """m, of a payload's centre of mass off link 2's line."""
    gyration: float = 0.0
    """m, a payload's radius of gyration."""
    body: tuple[str, ...] = ()
    """What of the payload's body is uncertain: y_p, and J_p for each kilogram."""

    @property
    def unit(self) -> FloatArray:
        """D (q,): what a payload of 1 kg adds to the coefficients."""
        shared, beta = self._loaded
        return shared.coefficients(beta, True) - shared.coefficients(beta, False)

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
        return abs(float(self.k[self.model.names.index(K3)])) / self.l2**2

    @property
    def by_shape(self) -> FloatArray:
        """Derivatives (2 + b, q) of `unit` by l1, l2 and the uncertain parts of payload `body`."""
        shared, beta = self._loaded
        places = list(map(shared.names.index, ("l1", "l2") + self.body))
        return shared.jacobian(beta, True).T[places]

    @property
    def _loaded(self) -> tuple[Shared, FloatArray]:
        """Parameters of the arm with a payload of 1 kg."""
        shape = {"m_p": 1.0, "l1": self.l1, "l2": self.l2, "J_p": self.gyration**2}
        if not set(SINES).isdisjoint(self.model.names):
            shape["y_p"] = self.y
        body = within(BODY_PARAMETERS, shape)
        shared = Shared(self.model, payload=True, body=body)
        return shared, np.append(self.k, vector(shared.names[self.k.size :], shape))

    def linearised(self, piece: Segment, c: FloatArray, *, settle: bool = True) -> Linearised:
        """A piece of log, linearised at the coefficients `c` and whitened.

        `c` is (q,), or (q, n) by torque sample. With `settle` it is linearised once more at the
        trajectory of the fit before, which has less noise in its accelerations.
        """
        stencil = Stencil(piece.dt, self.shift, lag=self.model.lag(self.k))
        theta = smoothed(piece.theta, piece.dt, min(SMOOTHING, 0.1 / piece.dt))
        linear = linearise(self.model, c, theta, piece, stencil, self.noise)
        if settle:
            multiplier = linear.solve_transposed(linear.columns[-1:])[0]
            theta = trajectory(piece, linear, multiplier, self.noise)
            linear = linearise(self.model, c, theta, piece, stencil, self.noise)
        return linear


def arm_of(
    result: Result, first: Segment, l1: float | None = None, l2: float | None = None
) -> tuple[IdentifiedArm, FloatArray]:
    """The arm of a result with link lengths from it or given, and the covariance (p, p) of both.

    After the q coefficients come l1, l2 and the uncertain parts of the payload's body. The model
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
    payload = {name: float(one.estimate or 0.0) for name, one in result.payload.items()}
    m_p, J = payload.get("m_p", 0.0), payload.get("J_p", 0.0)
    body = with_error_bar(result, BODY_PARAMETERS) if m_p else ()
    names = model.names + ("l1", "l2") + body + ("m_p",)
    uncertain = set(prior.names + body)
    if "J_p" in body and "m_p" in result.fit.covariance_names:
        uncertain.add("m_p")
    lengths = {"l1": l1, "l2": l2}
    uncertain |= {name for name in lengths if lengths[name] is None and has_error_bar(result, name)}
    T = np.eye(len(names) - 1, len(names))
    if l1 is None and result.settings.get("l1") is None and payload_length(result) is None:
        constants = by_constants(result)
        if constants is not None and constants[0] > 0:
            lengths["l1"], slopes = constants
            T[names.index("l1")] = vector(names, slopes, otherwise=0.0)
    if "J_p" in body:  # of each kilogram: the derivatives of J_p / m_p
        T[names.index("J_p"), [names.index("J_p"), -1]] = 1 / m_p, -J / m_p**2
    first_link, second_link = (_length(result, name, given) for name, given in lengths.items())
    arm = IdentifiedArm(
        model=model,
        k=vector(model.names, dict(zip(prior.names, prior.mean, strict=True)), otherwise=0.0),
        l1=first_link,
        l2=second_link,
        noise=noise_of(result) or first_guess(first.theta, first.tau),
        shift=shift_of(result).at(first.dt),
        y=payload.get("y_p", 0.0),
        gyration=float(np.sqrt(max(J, 0.0) / m_p)) if m_p > 0 else 0.0,
        body=body,
    )
    return arm, T @ covariance_of(result, names, uncertain) @ T.T


def _length(result: Result, name: str, given: float | None) -> float:
    """A link's length: the one given, else the one the result was made with, else its estimate."""
    estimate = result.payload[name].estimate if name in result.payload else None
    for length in (given, result.settings.get(name), estimate):
        if length is not None:
            return float(length)
    raise ResultError(
        f"{result.log.path}: its result has no {name}; give the link's length with {flag(name)}"
    )
