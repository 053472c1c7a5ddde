"""Arms with a joint that has no motor, where least squares ends at constants near nothing.

The equation of such a joint has no torque that scales it: constants near nothing solve it, and
where friction and cables pull nearly as hard as the arm's load, its residual draws least squares
there. Instruments are not drawn: a motion simulated from the other joint's torque holds nothing of
what pulls, so that at the true constants its products with the residual vanish in the mean, and
the joint with a motor sets the scale. The constants that it is simulated with need the right
ratios and no scale: least squares with equal weights has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators import instruments, weak
from algid.estimators.combine import Prior, scaled_pinv
from algid.estimators.diagnostics import broken_bounds
from algid.estimators.doubt import doubted_without_motor
from algid.estimators.fit import Fit
from algid.estimators.weak import Source, WeakSettings
from algid.notices import Notice


def by_instruments(
    unloaded: Sequence[Source],
    settings: WeakSettings,
    lengths: dict[str, float] | None = None,
    prior: Prior | None = None,
) -> Fit | None:
    """Parameters of the arm by windowed instruments, from least squares with equal weights.

    Parameters
    ----------
    unloaded : sequence of callables
        Each gives a fresh iterable of `Segment`, the stretches of one log in time.
    settings : WeakSettings
        A linear model and no delay to estimate.
    lengths : dict
        Known link lengths "l1", "l2" in m.
    prior : Prior
        What an earlier result knows of the arm.

    Returns
    -------
    Fit or None
        None where instruments do not converge, or end at constants near nothing or that physics
        forbids.
    """
    start = weak.fit(unloaded, (), settings, lengths, prior)
    start = replace(start, values=_equally_weighted(unloaded, settings))
    better = instruments.fit(unloaded, (), settings, lengths, prior, start)
    if not better.converged:
        return None
    for one in broken_bounds(better):
        if one.distance is None or one.distance > better.quantile:
            return None
    checked = doubted_without_motor(better, unloaded, (), settings)
    if checked is not better:
        return None
    return better.noted(Notice("INSTRUMENTS", numbers={"case": "passive"}))


def _equally_weighted(sources: Sequence[Source], settings: WeakSettings) -> FloatArray:
    """Coefficients (q,) by least squares with the same weight for the rows of both joints."""
    normals = weak.normals_of(sources, settings)
    total = np.sum([normal.gram.sum(axis=(0, 1)) for normal in normals], axis=0)
    return np.asarray(scaled_pinv(total[:-1, :-1]) @ total[:-1, -1])
