"""Case 1's arm, and its sensors' noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import NoiseLevels
from algid.log import Log
from algid.model import Model
from algid.synth.cases import load_case
from algid.tracks.arm import IdentifiedArm

CASE = load_case("case1")
NOISE = NoiseLevels(np.full(2, 1e-3), np.full(2, 1e-2))


def carrier(
    model: Model | None = None,
    k: FloatArray | None = None,
    l1: float = CASE.arm.l1,
    l2: float = CASE.arm.l2,
    **body: float,
) -> IdentifiedArm:
    """An arm, case 1's by default, whose payload has the `body` of each kilogram."""
    constants = CASE.arm.constants() if k is None else k
    shared = Shared(model or Model(), payload=True, body=tuple(body))
    return IdentifiedArm(shared, np.array([*constants, 1.0, l1, l2, *body.values()]), NOISE)


def noisy(log: Log, rng: np.random.Generator) -> Log:
    """The log as sensors of 1e-3 rad and 1e-2 N m see it."""
    theta = log.theta + 1e-3 * rng.standard_normal(log.theta.shape)
    return replace(
        log, theta=theta, tau=log.tau + 1e-2 * rng.standard_normal(log.tau.shape), omega=None
    )


RUBBING = Model(("coulomb",), coulomb_speed=0.1)


def rubbing(log: Log, friction: float) -> Log:
    """The log with Coulomb friction of so many N m in both joints, as `RUBBING` has it."""
    return replace(log, tau=log.tau + friction * np.tanh(log.omega / RUBBING.coulomb_speed))


def without_coulomb(
    found: tuple[IdentifiedArm, FloatArray],
) -> tuple[IdentifiedArm, FloatArray]:
    """An arm and its covariance less the Coulomb friction that a track adds, which is zero."""
    arm, covariance = found
    names = [*arm.model.names, "l1", "l2", *arm.shared.body]
    added = [names.index(name) for name in ("f1", "f2")]
    assert not covariance[added].any()
    assert not arm.k[added].any()
    terms = tuple(name for name in arm.model.terms if name != "coulomb")
    shared = replace(arm.shared, model=replace(arm.model, terms=terms))
    lean = replace(arm, shared=shared, beta=np.delete(arm.beta, added))
    return lean, np.delete(np.delete(covariance, added, axis=0), added, axis=1)
