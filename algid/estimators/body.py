"""A payload as a body: its centre of mass off link 2's line and its inertia, if significant.

Payloads act through the chain rule alone (`algid.estimators.parametrisation`), so that what the
logs say of them follows from the quadratic likelihoods of a fit, without a further pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from algid.base.names import names_in, outside, within
from algid.base.significance import sigmas
from algid.estimators.combine import likelihood
from algid.estimators.fit import Fit, solved_anew
from algid.estimators.parametrisation import BODY_PARAMETERS
from algid.model import SINES
from algid.physics.parameters import BODY

FALSE = 0.05
"""Chance of an offset or an inertia being chosen for a payload that is a point on link 2's line."""


def with_body(fit: Fit) -> Fit:
    """The fit with the payload's offset and inertia, as far as its logs determine them.

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
    names, worth = _candidates(fit)
    every = [with_body_of(fit, body) for body in _bodies(names)]
    worthy = [one for one in every if min(_worths(one)) > worth]

    def rank(one: Fit) -> tuple[int, float]:
        return len(one.shared.body), likelihood(one.shared, one.logs, one.values, one.prior)[0]

    return max(worthy, key=rank, default=with_body_of(fit, ()))


def _bodies(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Sets of one or more of the parameters `names`, the smallest first."""
    for count in range(1, len(names) + 1):
        yield from combinations(names, count)


def averaged_over_bodies(fit: Fit) -> Fit:
    """The fit averaged over what else the payload may have, where logs hardly determine that.

    What is left out biases mass and lengths by up to its own error, which no interval of the
    smaller model holds. The models that have more of the body are therefore averaged with it, each
    with its weight by Akaike's criterion, and the variance is that of the mixture:

        w ∝ exp(W / 2 - n),   C = Σ w (C_i + (β_i - β) (β_i - β)ᵀ)

    with W the Wald statistic of the n parameters more (Buckland, Burnham & Augustin 1997).

    Parameters
    ----------
    fit : Fit
        From `with_body`; one without loaded logs is returned as it is.
    """
    if not fit.shared.payload or not fit.converged:
        return fit
    values, covariances, weights = [fit.values], [fit.covariance], [1.0]
    names, _ = _candidates(fit)
    for more in _bodies(outside(names, fit.shared.body)):
        body = within(BODY_PARAMETERS, fit.shared.body + more)
        other = with_body_of(fit, body)
        if all(_worths(other)):  # else no object has it, or the logs leave it open
            places = list(map(other.names.index, fit.names))
            values.append(other.values[places])
            covariances.append(other.covariance[np.ix_(places, places)])
            weights.append(float(np.exp(min(0.5 * other.wald(more), _MOST) - len(more))))
    w = np.array(weights) / sum(weights)
    beta = w @ np.array(values)
    apart = np.array(values) - beta
    mixed = np.einsum("i,iab->ab", w, np.array(covariances))
    mixed += np.einsum("i,ia,ib->ab", w, apart, apart)
    return replace(fit, values=beta, covariance=mixed)


_MOST = 100.0  # W / 2, beyond which a weight is all there is


def _candidates(fit: Fit) -> tuple[tuple[str, ...], float]:
    """The parameters of the body that a fit may have, and the Wald statistic that each has to pass.

    An offset shows in the sine parts alone. `FALSE` is shared evenly by the tails: an offset has
    two, an inertia, which is positive, has one.
    """
    across = not set(SINES).isdisjoint(fit.shared.log_names)
    own = [one for one in BODY if across or one.sign == "+"]
    tails = sum(1 if one.sign == "+" else 2 for one in own)
    return names_in(own), sigmas(FALSE, tails, sides=1) ** 2


def with_body_of(fit: Fit, body: Sequence[str]) -> Fit:
    """The fit with the parameters `body` of the payload, from the same likelihoods."""
    if tuple(body) == fit.shared.body:
        return fit
    shared = replace(fit.shared, body=tuple(body))
    return solved_anew(fit, shared, fit.prior, fit.shrinkage)


def _worths(fit: Fit) -> list[float]:
    """Wald statistics of the body's parameters.

    0 of what no object at the tip has, or the logs leave open.

    An inertia is positive, and its radius of gyration no longer than joint 2 is away.
    """
    m_p, _, r, J = fit.shared.physical(fit.values)
    if J < 0 or m_p * abs(r) ** 2 < J:
        return [0.0]
    return [fit.wald((name,)) if name in fit.determined else 0.0 for name in fit.shared.body]
