"""The motion that a controller's reference explains: an instrument that no disturbance reaches.

Under feedback the logged torque answers what the model lacks, and so is no instrument. The
reference that the controller follows answers nothing. What it explains of the motion is found by
least squares, joint by joint, on both joints' references some time ago, of all logs together:

    θ̂(t) = b0 + Σ_l B_l q_d(t − l),   l = 0 … `_LONGEST` s, denser near zero

The columns of a model along θ̂ are then the instruments (the auxiliary model of Janot,
Vandanjon & Gautier 2014, made of the log in place of a simulated controller, of which a log says
nothing). A right θ̂ makes them strong; a wrong one leaves them valid.

======  =======================================================  ========  =====
symbol  name                                                     shape     unit
======  =======================================================  ========  =====
q_d     reference                                                (2, N)    rad
F       references some time ago, and 1                          (m, N)    rad
B       what the reference makes of angles and torques           (4, m)    mixed
======  =======================================================  ========  =====
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.combine import scaled_pinv
from algid.estimators.problem import Problem
from algid.signals.segments import Segment

_LONGEST = 1.0  # s: a joint has followed its reference by then
_LAGS = 16
_TOLERANCE = 1e-9  # relative eigenvalue: a slow reference is almost the one a lag before
_FARTHEST = 1e4  # rad: no joint turns so far
_FEWEST = 0.5  # share of a piece's samples that have a reference
FOLLOWED = 0.5
"""Share of each joint's motion (R²) that a reference explains, at least, to be an instrument."""


Explained = Callable[[Segment], Segment | None]
"""Gives a piece with the angles, velocities and torques that its reference explains; None where it
has none."""


def followed(problem: Problem) -> Explained | None:
    """How the arm follows the references of its logs; None where one has none, or it does not."""
    gram = None
    for source in problem.logs:
        known = False
        for piece, _, _ in weak.overlapping(source(), problem.settings):
            if piece.reference is None:
                return None
            F = _features(piece)
            if F is not None:
                rows = np.concatenate([F, piece.theta, piece.tau])
                gram = rows @ rows.T + (0.0 if gram is None else gram)
                known = True
        if not known:
            return None
    if gram is None:
        return None
    m = len(gram) - 4
    B = gram[m:, :m] @ scaled_pinv(gram[:m, :m], _TOLERANCE)
    count, sums = gram[m - 1, m - 1], gram[m : m + 2, m - 1]
    total = np.diag(gram)[m : m + 2] - sums**2 / count
    left = np.diag(gram)[m : m + 2] - np.sum(B[:2] * gram[m : m + 2, :m], axis=1)
    if not np.all(left < (1 - FOLLOWED) * total):
        return None

    def explained(piece: Segment) -> Segment | None:
        F = _features(piece)
        if F is None:
            return None
        theta, tau = np.split(B @ F, 2)
        omega = None if piece.omega is None else np.gradient(theta, piece.dt, axis=1)
        return replace(piece, theta=theta, tau=tau, omega=omega)

    return explained


def _features(piece: Segment) -> FloatArray | None:
    """F (m, N), the last row 1; None where most samples of the piece have no reference.

    Before its beginning, and where it has none, a reference is taken to have stood still.
    """
    reference = _filled(piece.reference)
    if reference is None:
        return None
    count = len(piece)
    lags = np.unique(
        np.rint(_LONGEST / piece.dt * (np.arange(_LAGS) / (_LAGS - 1)) ** 2).astype(np.int64)
    )
    at = np.maximum(np.arange(count) - lags[:, None], 0)
    ago = reference[:, at].reshape(-1, count)
    return np.concatenate([ago, np.ones((1, count))])


def _filled(reference: FloatArray | None) -> FloatArray | None:
    """A reference (2, N) with the last one before each sample that has none.

    At the beginning the first. None where fewer than `_FEWEST` of the samples have one.
    """
    if reference is None:
        return None
    good = np.all(np.abs(reference) < _FARTHEST, axis=0)
    if good.all():
        return reference
    if np.mean(good) < _FEWEST:
        return None
    place = np.maximum.accumulate(np.where(good, np.arange(good.size), 0))
    return reference[:, np.maximum(place, np.argmax(good))]
