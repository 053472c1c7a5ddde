"""What the convention of friction by load moves, where the model does not hold.

Gears rub in proportion to the torque that passes them. Whether that is a joint's load L, which is
its inertia and weight, or all other torque, friction D of motor and bearings included, depends on
the order in which they lie along the drive. Between both is

    e (|L + D| − |L|) tanh(ω / ω_s) ≈ e |D| sgn L

a torque that looks like a gain common to both joints: it moves all constants together, and no
scatter from log to log or from window to window shows it. Where the residual is white the model
holds, and its convention with it. Where it is not, the change of the estimate is part of its error:

    W = V + d dᵀ,   d = β_torque − β_load
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from algid.estimators.fit import Fit
from algid.model import Model, attributes

Refit = Callable[[Model], Fit]
"""The weak form's estimate with a model."""


def widened(fit: Fit, refit: Refit, by_load: Fit | None = None) -> Fit:
    """The fit with the change d in its covariance; as it is without friction by load.

    Parameters
    ----------
    fit : Fit
    refit : callable
    by_load : Fit, optional
        What `refit` gives with the fit's own model, where that is known.
    """
    model = fit.shared.model
    if not attributes(model, "by_load"):
        return fit
    by_load = refit(model) if by_load is None else by_load
    by_torque = refit(replace(model, by_torque=True))
    if not by_torque.converged:
        return fit
    before = dict(zip(by_load.names, by_load.values, strict=True))
    after = dict(zip(by_torque.names, by_torque.values, strict=True))
    moved = np.array(
        [
            0.0
            if status == "NOT_IDENTIFIABLE" or name not in before or name not in after
            else after[name] - before[name]
            for name, status in zip(fit.names, fit.status, strict=True)
        ]
    )
    return replace(fit, covariance=fit.covariance + np.outer(moved, moved))
