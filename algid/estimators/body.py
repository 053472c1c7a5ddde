"""A payload as a body: its centre of mass off link 2's line and its inertia, if significant.

Payloads act through the chain rule alone (`algid.estimators.parametrisation`), so that what the
logs say of them follows from the quadratic likelihoods of a fit, without a further pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from algid.estimators.combine import likelihood
from algid.estimators.fit import Fit, conclude
from algid.estimators.shrunk_fit import concluded
from algid.model import SINES
from algid.physics.parameters import BODY

WORTH = 2.0
"""Wald statistic per parameter above which the parameter is kept (Akaike 1974).

A stricter limit would bias the mass of bodies whose inertia is of the size of its own error."""


def with_body(fit: Fit) -> Fit:
    """The fit with the payload's offset and inertia, as far as its logs tell them.

    Parameters
    ----------
    fit : Fit
        Of a point payload; one without loaded logs is returned as it is.

    Returns
    -------
    Fit
        The one with the most parameters of the body each of which is worth its price, of as many
        the likeliest: an inertia may be worth much that stands for an offset. It is positive.
    """
    if not fit.shared.payload or not fit.converged:
        return fit
    across = bool(set(SINES) & set(fit.shared.log_names))  # an offset shows in the sine parts alone
    names = [one.name for one in BODY if across or one.sign == "+"]
    for count in range(len(names), 0, -1):
        found = [with_body_of(fit, chosen) for chosen in combinations(names, count)]
        worthy = [one for one in found if _least_worth(one) > WORTH]
        if worthy:
            return max(worthy, key=_likelihood)
    return with_body_of(fit, ()) if fit.shared.body else fit


def with_body_of(fit: Fit, body: Sequence[str]) -> Fit:
    """The fit with the parameters `body` of the payload, from the same likelihoods."""
    if tuple(body) == fit.shared.body:
        return fit
    shared = replace(fit.shared, body=tuple(body))
    known = dict(zip(fit.names, fit.values.tolist(), strict=True))
    start = np.array([known.get(name, 0.0) for name in shared.names])
    if fit.shrinkage is not None and fit.prior is not None:
        found = concluded(shared, fit.logs, start, fit.prior, fit.shrinkage, fit.moved, fit.repeats)
        found = replace(found, estimator=fit.estimator)
    else:
        coloured = fit.intervals != "likelihood"
        found = conclude(
            fit.estimator,
            shared,
            fit.logs,
            start,
            fit.moved,
            fit.prior,
            coloured=coloured,
            samples=fit.freedom,
        )
    before = dict(zip(fit.names, fit.status, strict=True))
    statuses = zip(found.names, found.status, strict=True)
    status = tuple(
        own if before.get(name, "OK") == "OK" else before[name] for name, own in statuses
    )
    return replace(
        found,
        status=status,
        noise=fit.noise,
        whiteness=fit.whiteness,
        residual=fit.residual,
        iterations=fit.iterations,
        endogeneity=fit.endogeneity,
        notes=fit.notes,
    )


def _worths(fit: Fit) -> list[float]:
    """Wald statistics of the body's parameters.

    Nothing of what no object at the tip has, or the logs leave open.

    An inertia is positive, and its radius of gyration no longer than joint 2 is away.
    """
    worths = []
    m_p, _, r, J = fit.shared.physical(fit.values)
    if J < 0 or m_p * abs(r) ** 2 < J:
        return [0.0]
    for name in fit.shared.body:
        place = fit.names.index(name)
        value, std = float(fit.values[place]), float(fit.std[place])
        worths.append((value / std) ** 2 if std > 0 and np.isfinite(std) else 0.0)
    return worths


def _likelihood(fit: Fit) -> float:
    return likelihood(fit.shared, fit.logs, fit.values, fit.prior)[0]


def _least_worth(fit: Fit) -> float:
    return min(_worths(fit))
