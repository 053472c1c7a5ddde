"""Whether the residual of a likelihood depends on the motion: the model lacks something then.

The likelihood takes the level of the torque's noise from the logs. A torque that the model lacks
makes that level grow, and the error bars with it, by less than it moves the estimates. Rao's score
test (1948) sees it: of torques G that a motion makes, beside those of the model, the residual e has

    b = GᵀV⁻¹e - XᵀS⁻¹ YᵀV⁻¹e,   W = bᵀ M⁺ b,   M = GᵀV⁻¹G - XᵀS⁻¹X,   X = YᵀV⁻¹G

and W is χ² of rank(M) degrees of freedom where the model holds. G has the columns of the terms
that the model is without, one of a delay, and shapes that no term has: friction of gears by all
torque that passes them, a motor that saturates, drag of the air, cogging and cables' pull by the
joint's angle, friction that changes along a turn, and what one drive does to the other joint.

A controller makes torque of its encoders' noise, which the residual holds too: that they correlate
looks like a delay of the torque. Such a torque is fast. Of a delay the test sees only what the slow
part of the torque shows.

======  =================================================  ================  =================
symbol  name                                               shape             unit
======  =================================================  ================  =================
Y       columns of the parameters                          (2 n, Q)          N m / parameter's
G       torques beside them                                (2 n, m)          N m
h       coefficients of the columns of a term              (n,)              parameter's
======  =================================================  ================  =================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.compiled import chi2_tail
from algid.base.names import vector
from algid.estimators.combine import Prior, scaled_pinv
from algid.estimators.elastic import flexed, with_bends
from algid.estimators.fit import Fit, Misfit, Overlooked
from algid.model import (
    DELAYS,
    EVERY_TERM,
    TERMS,
    Model,
    Motion,
    attributes,
    regressor,
    sensitivity,
    smooth_sign,
    torque,
)
from algid.signals.filters import smoothed


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
    ("drag", lambda j: np.abs(j.omega) * j.omega),
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
_SLOW = 20.0
"""Hz: a torque changes no faster by what the arm is to do."""
_STEP = 1e-3
"""Relative change of a width of friction by which its effect is differentiated."""
_ALIKE = 1e-5
"""Share of the largest eigenvalue: along smaller ones the torques repeat each other."""


def lacking(model: Model) -> list[tuple[str, str]]:
    """Pairs of a term and a parameter that `model` is without, a delay's last."""
    names, pairs = _whole(model).names, []
    for term, entry in EVERY_TERM.items():
        if term not in model.terms:
            pairs += [(term, name) for name in entry.names if name in names or entry.delays]
    return [pair for pair in pairs if pair[1] not in model.names]


def columns(model: Model, c: FloatArray, motion: Motion, dt: float) -> FloatArray:
    """Torques (m, 2, n) in N m beside those of `model`.

    Those of `lacking`, shapes of no term, and last what a change of friction's widths makes.

    Parameters
    ----------
    model : Model
    c : (q,), in `algid.model.UNITS`
    motion : Motion of n samples
    dt : float, s
    """
    whole, modelled = _whole(model), _acting(model, c, motion)
    known = dict(zip(model.names, c.tolist(), strict=True))
    wide = vector(whole.names, known, otherwise=0.0)
    bent = flexed(whole, wide, motion, dt)
    J = with_bends(whole, wide, bent, sensitivity(whole, wide, bent), dt)
    for name, joint in attributes(whole, "gains"):
        J[joint, whole.names.index(name)] = modelled[joint]
    rows = []
    for _, name in lacking(model):
        if name in DELAYS:
            rows.append(np.gradient(_slow(modelled, dt), dt, axis=1))
        else:
            rows.append(J[:, whole.names.index(name)])
    rows += _shapes(model, modelled, motion)
    for width in _widths(model):
        rows.append(_change(model, c, motion, width))
    return np.stack(rows)


def _slow(tau: FloatArray, dt: float) -> FloatArray:
    """Torques (2, n), sampled every `dt` s, below `_SLOW` Hz; as they are where all of them is."""
    if _SLOW * dt >= 0.5:
        return tau
    return smoothed(tau, dt, _SLOW)


def _acting(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """The torque (2, n) in N m; nothing where its terms cancel, whose sum then is their noise.

    A joint without a motor has no torque that friction or a motor's faults could depend on.
    """
    parts = regressor(model, motion, c) * c[:, None]
    T = parts.sum(axis=1)
    size = np.sqrt(np.sum(np.mean(parts**2, axis=2), axis=1))
    return np.where(np.sqrt(np.mean(T**2, axis=1)) > _CANCELS * size, T.T, 0.0).T


def _whole(model: Model) -> Model:
    """The model with every term that is a function of the motion at one instant."""
    return replace(model, terms=tuple(name for name, term in TERMS.items() if not term.lags))


def _shapes(model: Model, modelled: FloatArray, motion: Motion) -> list[FloatArray]:
    """Torques (2, n) of one joint each, in shapes that no term has."""
    signs = [smooth_sign(model, omega) for omega in motion.omega]
    made = []
    for joint, other in ((0, 1), (1, 0)):
        own = motion.theta[joint], motion.omega[joint], signs[joint]
        seen = _Joint(modelled[joint], *own, signs[other], motion.omega[other], motion.alpha[other])
        for _, shape in _SHAPES:
            row = np.zeros_like(modelled)
            row[joint] = shape(seen)
            made.append(row)
    return made


def _widths(model: Model) -> list[str]:
    """Widths of friction that the torque of `model` has."""
    used: set[str] = set()
    for term in model.terms:
        used.update(TERMS[term].shapes)
    return sorted(used)


def _change(model: Model, c: FloatArray, motion: Motion, width: str) -> FloatArray:
    """Derivative (2, n) of the torque by the logarithm of a width of friction, in N m."""
    now = getattr(model, width)
    wider = replace(model, **{width: now * (1 + _STEP)})
    narrower = replace(model, **{width: now * (1 - _STEP)})
    return (torque(wider, c, motion) - torque(narrower, c, motion)) / (2 * _STEP)


def misfit(fit: Fit, products: Sequence[tuple[bool, FloatArray]], prior: Prior | None) -> Misfit:
    """The score test of a fit by the likelihood.

    Parameters
    ----------
    fit : Fit
    products : of some of its logs: whether it is loaded, and the products (q + 1 + m, q + 1 + m)
        of its whitened columns, its residual and the torques `columns`
    prior : Prior, optional
        What held the fit beside its logs.
    """
    Q = len(fit.names)
    whole = np.zeros(())
    for loaded, gram in products:
        T = fit.shared.jacobian(fit.values, loaded)
        by_shared = np.eye(len(gram), len(gram) - len(T) + Q, Q - len(T))
        by_shared[: len(T), :Q] = T
        whole = whole + by_shared.T @ gram @ by_shared
    S, X, G = whole[:Q, :Q], whole[:Q, Q + 1 :], whole[Q + 1 :, Q + 1 :]
    if prior is not None:
        known = prior.places(fit.names)
        S[np.ix_(known, known)] += prior.precision
    D = scaled_pinv(S) @ X  # what the parameters take up
    M, b = G - X.T @ D, whole[Q + 1 :, Q] - D.T @ whole[:Q, Q]
    size = np.diag(G)
    count = len(_widths(fit.shared.model))
    if count:  # widths are estimated too
        shares = M[:-count, -count:] @ scaled_pinv(M[-count:, -count:])
        M, b = M[:-count, :-count] - shares @ M[-count:, :-count], b[:-count] - shares @ b[-count:]
        size = size[:-count]
    pairs = lacking(fit.shared.model)
    beside = np.diag(M) > _OWN * size
    if fit.shared.delay:  # of which the slow part's is one already
        beside[[place for place, (term, _) in enumerate(pairs) if term in DELAYS]] = False
    freedom, statistic, _ = _score(M, b, np.flatnonzero(beside))
    kinds = [kind for kind, _ in _SHAPES]
    places: dict[str, list[int]] = {}
    for place, kind in enumerate([*(term for term, _ in pairs), *kinds, *kinds]):
        if beside[place]:
            places.setdefault(kind, []).append(place)
    overlooked, alone = [], [1.0]
    for kind, own in places.items():
        rank, wald, h = _score(M, b, np.array(own))
        alone.append(float(chi2_tail(rank, wald)))
        if kind not in kinds:
            values = {pairs[place][1]: float(value) for place, value in zip(own, h, strict=True)}
            overlooked.append(Overlooked(kind, alone[-1], values))
    together = float(chi2_tail(max(freedom, 1), statistic))
    return Misfit(min(1.0, 2 * together, 2 * len(places) * min(alone)), tuple(overlooked))


def _score(M: FloatArray, b: FloatArray, own: NDArray[np.int64]) -> tuple[int, float, FloatArray]:
    """Rank and statistic of the score along the torques `own`, and their coefficients."""
    size = np.sqrt(np.diag(M)[own])
    values, vectors = np.linalg.eigh(M[np.ix_(own, own)] / np.outer(size, size))
    kept = values > _ALIKE * values.max(initial=0.0)
    along = vectors[:, kept].T @ (b[own] / size)
    h = vectors[:, kept] @ (along / values[kept]) / size
    return int(kept.sum()), float(along @ (along / values[kept])), h
