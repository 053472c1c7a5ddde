"""Whether the residual of a likelihood depends on the motion: the model lacks something then.

The likelihood takes the level of the torque's noise from the logs. A torque that the model lacks
makes that level grow, and the error bars with it, by less than it moves the estimates. Rao's score
test (1948) sees it: of torques G that a motion makes, beside those of the model, the residual e has

    b = GᵀV⁻¹e - XᵀS⁻¹ YᵀV⁻¹e,   W = bᵀ M⁺ b,   M = GᵀV⁻¹G - XᵀS⁻¹X,   X = YᵀV⁻¹G

and W is χ² of rank(M) degrees of freedom where the model holds. G has the columns of the terms
that the model is without, one of a delay, and shapes that no term has: friction of gears by all
torque that passes them, a motor that saturates or has a dead band, drag of the air, springs (a
cable, a hose), cogging and other pull by the joint's angle, friction that changes along a turn, and
what one drive does to the other joint.

A controller makes torque of its encoders' noise, which the residual holds too: that they correlate
looks like a delay of the torque. Such a torque is fast: the columns are those of the smooth motion.

======  =================================================  ================  =================
symbol  name                                               shape             unit
======  =================================================  ================  =================
Y       columns of the parameters                          (2 n, Q)          N m / parameter's
G       torques beside them                                (2 n, m)          N m
======  =================================================  ================  =================
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.compiled import chi2_tail
from algid.base.names import places_outside
from algid.estimators.combine import Prior, scaled_pinv
from algid.estimators.fit import Fit
from algid.estimators.terms import TERM_OF, WIDTHS, Products, widened
from algid.model import Model, Motion, regressor, smooth_sign


class _Joint(NamedTuple):
    """A joint's torque, angle, velocity and its smooth sign (n,), and the other joint's motion."""

    T: FloatArray
    theta: FloatArray
    omega: FloatArray
    sign: FloatArray
    other_sign: FloatArray
    other_omega: FloatArray
    other_alpha: FloatArray


_SHAPES: tuple[tuple[str, Callable[[_Joint], FloatArray]], ...] = (
    ("gears", lambda j: np.abs(j.T) * j.sign),
    ("saturation", lambda j: np.abs(j.T) * j.T),
    ("dead band", lambda j: np.sign(j.T)),
    ("drag", lambda j: np.abs(j.omega) * j.omega),
    ("spring", lambda j: j.theta - j.theta.mean()),
    ("once a turn", lambda j: np.sin(j.theta)),
    ("once a turn", lambda j: np.cos(j.theta)),
    ("twice a turn", lambda j: np.sin(2 * j.theta)),
    ("twice a turn", lambda j: np.cos(2 * j.theta)),
    ("friction along a turn", lambda j: np.sin(j.theta) * j.sign),
    ("friction along a turn", lambda j: np.cos(j.theta) * j.sign),
    ("the other joint", lambda j: j.other_sign),
    ("the other joint", lambda j: j.other_omega),
    ("the other joint", lambda j: j.other_alpha),
)
"""Torques of a joint in shapes that no term has, and what each belongs to."""
_OWN = 1e-6
"""Share of a torque beside the parameters' columns: with less it is one of theirs."""
_CANCELS = 0.02
"""Share of its terms that a torque is where they cancel."""
_ALIKE = 1e-5
"""Share of the largest eigenvalue: along smaller ones the torques repeat each other."""


def shapes(model: Model, c: FloatArray, motion: Motion, dt: float) -> FloatArray:
    """What friction's widths change, and torques of one joint each in shapes that no term has."""
    own = of_no_term(model, _acting(model, c, motion), motion)
    return np.stack([*widened(model, c, motion, dt), *own])


def of_no_term(model: Model, acting: FloatArray, motion: Motion) -> list[FloatArray]:
    """Torques (2, n) of one joint each, in shapes that no term has, where (2, n) N m act."""
    signs = [smooth_sign(model, omega) for omega in motion.omega]
    made = []
    for joint, other in ((0, 1), (1, 0)):
        own = motion.theta[joint], motion.omega[joint], signs[joint]
        seen = _Joint(acting[joint], *own, signs[other], motion.omega[other], motion.alpha[other])
        for _, shape in _SHAPES:
            row = np.zeros_like(acting)
            row[joint] = shape(seen)
            made.append(row)
    return made


def _acting(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """The torque (2, n) in N m; nothing where its terms cancel, whose sum then is their noise.

    A joint without a motor has no torque that friction or a motor's faults could depend on.
    """
    parts = regressor(model, motion, c) * c[:, None]
    T = parts.sum(axis=1)
    size = np.sqrt(np.sum(np.mean(parts**2, axis=2), axis=1))
    return np.where(np.sqrt(np.mean(T**2, axis=1)) > _CANCELS * size, T.T, 0.0).T


def misfit(fit: Fit, products: Products, prior: Prior | None) -> float:
    """The p value of the score test of a fit by the likelihood.

    Of all torques beside the model's together, and of the most evident kind (Bonferroni).

    Parameters
    ----------
    fit : Fit
    products : Products
        Of some of its logs, at its estimates, with the torques `shapes`.
    prior : Prior, optional
        What held the fit beside its logs.
    """
    shared, names, kinds = fit.shared, products.names, 2 * [kind for kind, _ in _SHAPES]
    present = [names.index(name) for name in shared.log_names]
    absent = places_outside(names, [*shared.log_names, *WIDTHS])
    # friction's widths are estimated beside the parameters
    free = [names.index(name) for name in WIDTHS]
    rest = [*free, -1, *absent, *range(len(names), len(names) + len(kinds))]
    Q, whole = len(fit.names), np.zeros(())
    for loaded, gram in products.each:
        by_shared = np.zeros((len(gram), Q + len(rest)))
        by_shared[present, :Q] = shared.jacobian(fit.values, loaded)
        by_shared[rest, Q + np.arange(len(rest))] = 1
        whole = whole + by_shared.T @ gram @ by_shared
    P = Q + len(free)
    S, X, G = whole[:P, :P], whole[:P, P + 1 :], whole[P + 1 :, P + 1 :]
    if prior is not None:
        known = prior.places(fit.names)
        S[np.ix_(known, known)] += prior.precision
    D = scaled_pinv(S) @ X  # what the parameters take up
    M, b = G - X.T @ D, whole[P + 1 :, P] - D.T @ whole[:P, P]
    kinds = [TERM_OF[names[place]] for place in absent] + kinds
    beside = np.diag(M) > _OWN * np.diag(G)
    freedom, statistic = _score(M, b, np.flatnonzero(beside))
    places: dict[str, list[int]] = {}
    for place, kind in enumerate(kinds):
        if beside[place]:
            places.setdefault(kind, []).append(place)
    alone = [1.0]
    for own in places.values():
        rank, wald = _score(M, b, np.array(own))
        alone.append(float(chi2_tail(rank, wald)))
    together = float(chi2_tail(max(freedom, 1), statistic))
    return min(1.0, 2 * together, 2 * len(places) * min(alone))


def _score(M: FloatArray, b: FloatArray, own: NDArray[np.int64]) -> tuple[int, float]:
    """Rank and statistic of the score along the torques `own`."""
    size = np.sqrt(np.diag(M)[own])
    values, vectors = np.linalg.eigh(M[np.ix_(own, own)] / np.outer(size, size))
    kept = values > _ALIKE * values.max(initial=0.0)
    along = vectors[:, kept].T @ (b[own] / size)
    return int(kept.sum()), float(along @ (along / values[kept]))
