"""What the integration and the sampling of a log without noise leave open in its estimates.

A simulator of first order does not solve the equation of motion, but one near it. In its samples q
at steps of dt, semi-implicit Euler's central difference is

    (q[n+1] − 2 q[n] + q[n−1]) / dt² = a(q[n], (q[n] − q[n−1]) / dt, τ[n])

so that velocities act half a step late; where a joint's damping is taken implicitly they act half
a step early there (Hairer, Lubich & Wanner 2006, ch. IX, on modified equations). A torque that
bends between two samples is not the straight line that it is taken for. Part of all this looks
like another inertia, which no choice of terms can tell from the arm's own: where a log has no
noise, this is its error.

The log determines each deviation h from what is left of it beside the estimates,

    h = (Gᵀ V⁻¹ P G)⁻¹ Gᵀ V⁻¹ P e,   P without what the parameters take up,

and the estimates' covariance gains what h has moved them by:

    W = V + D h hᵀ Dᵀ,   D = S⁻¹ Yᵀ V⁻¹ G

======  =============================================  ===============  ===========
symbol  name                                           shape            unit
======  =============================================  ===============  ===========
G       torque of one sample of each deviation         (m, 2, n)        N m
h       deviations, in samples or shares               (m,)             1
D       change of the estimates with a deviation       (Q, m)           parameter's
======  =============================================  ===============  ===========
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.base.compiled import chi2_tail
from algid.base.significance import LEVEL
from algid.estimators.combine import Prior, scaled_pinv
from algid.estimators.fit import Fit
from algid.estimators.imprint import Imprint, summed
from algid.model import PARAMETERS, RIGID, SINES, Model, Motion, partials, torque
from algid.notices import Notice
from algid.physics.parameters import VISCOUS

DEVIATIONS = ("velocity of friction", "velocity of inertia", "position", "bend", "stamps")
"""Friction at another velocity, Coriolis' torque at another one, gravity and inertia at another
position, a torque that bends between samples, and one that acts at another time."""
_INERTIAL = frozenset({*(n for n in RIGID if PARAMETERS[n].scale is not VISCOUS), *SINES})
_DETERMINED = 1e-6
"""Share of a deviation's torque: with less beside the parameters, the log does not determine it."""
_SURE = 0.05
"""Samples: what the log determines no better, it does not determine."""
_LARGEST = 1.5
"""Samples: no integrator is further off; what is, is something else than integration."""
_FELT = 1.1
"""Factor of an interval from which it is said that integration limits it."""


def deviations(model: Model, c: FloatArray, motion: Motion, dt: float) -> FloatArray:
    """Torques (m, 2, n) in N m that one sample of each of `DEVIATIONS` makes.

    Parameters
    ----------
    model : Model
    c : (q,), in `algid.model.UNITS`
    motion : Motion of n samples
    dt : float, s
    """
    by_motion = partials(model, c, motion)
    rubbing = np.where([name in _INERTIAL for name in model.names], 0.0, c)
    friction = partials(model, rubbing, motion)[1]

    def along(P: FloatArray, change: FloatArray) -> FloatArray:
        return dt * np.einsum("abn,bn->an", P, change)

    slope = np.gradient(torque(model, c, motion), axis=1)
    return np.stack(
        [
            along(friction, motion.alpha),
            along(by_motion[1] - friction, motion.alpha),
            along(by_motion[0], motion.omega),
            np.gradient(slope, axis=1),
            slope,
        ]
    )


def widened_by_integration(fit: Fit, imprints: Sequence[Imprint], prior: Prior | None) -> Fit:
    """The fit with what integration and sampling may have moved in its covariance.

    Parameters
    ----------
    fit : Fit
    imprints : of logs without noise
    prior : Prior, optional
        What held the fit beside its logs.

    Returns
    -------
    Fit
        `fit` itself where the logs determine no deviation, or one that no integration makes.

    Notes
    -----
    A deviation that the parameters take up whole, as a rotor's inertia does that of its joint's
    friction, counts as large as the largest that the logs determine.
    """
    sums = summed(fit, imprints, prior)
    D, beside, right = sums.beside()
    made = np.diag(sums.GG) > 0
    seen = np.diag(beside) > _DETERMINED * np.diag(sums.GG)
    seen[seen] = np.sqrt(np.diag(scaled_pinv(beside[np.ix_(seen, seen)]))) < _SURE
    if not seen.any():
        return fit
    information = beside[np.ix_(seen, seen)]
    h = np.zeros(made.size)
    h[seen] = scaled_pinv(information) @ right[seen]
    largest = float(np.abs(h).max())
    by_chance = chi2_tail(int(seen.sum()), float(h[seen] @ information @ h[seen])) >= LEVEL
    if by_chance or largest > _LARGEST:
        return fit
    unseen = made & ~seen
    unseen[DEVIATIONS.index("stamps")] &= not _shifted(fit)
    moved = np.column_stack([D @ h, largest * D[:, unseen]])
    wider = fit.covariance + moved @ moved.T
    before, after = np.sqrt(np.diag(fit.covariance)), np.sqrt(np.diag(wider))
    factor = float(np.max(np.divide(after, before, out=np.ones_like(after), where=before > 0)))
    fit = replace(fit, covariance=wider)
    if factor < _FELT:
        return fit
    numbers = {"samples": largest, "factor": factor}
    return fit.noted(Notice("SLOW_SAMPLING", numbers={"case": "integration"} | numbers))


def _shifted(fit: Fit) -> bool:
    """Whether a delay or a lag of the torque is estimated, which the stamps' deviation is."""
    return fit.shared.delay or fit.shared.model.lag_name is not None
