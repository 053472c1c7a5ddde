"""Error bars where the evidence that chose the model's terms was refuted.

Terms are left out because the logs cannot tell them from nothing, and what cannot be told so is taken for zero: that
narrows the error bars. Where the likelihood is refuted afterwards, the torque has errors that no term explains, and
the same errors were weighed when the terms were. Error bars as if nothing had been left out let that in; the
estimates stay, since the smaller model foretells better. (On inference after selection: Leeb & Pötscher 2005,
Econometric Theory 21.) What differs from run to run shows it by itself: with `FEWEST_LOGS` logs nothing is widened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from algid.estimators import weak
from algid.estimators.combine import FEWEST_LOGS, Prior
from algid.estimators.fit import Fit, widened
from algid.estimators.selection import FIRST_TERMS
from algid.estimators.weak import Source, WeakSettings


def hedged(
    fit: Fit,
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
    lengths: Mapping[str, float] | None = None,
    prior: Prior | None = None,
) -> Fit:
    """The fit with no error bar narrower than that of the model with a delay and `FIRST_TERMS` too.

    Parameters
    ----------
    fit : Fit
        Of the terms that the logs chose; with four logs or more it is returned as it is.
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`.
    settings : WeakSettings
        Of the fit: its model, window, bandwidth, hold and delay.
    lengths : mapping of "l1", "l2" to m, where known
    prior : Prior, optional
    """
    if len(fit.logs) >= FEWEST_LOGS:
        return fit
    terms = tuple(dict.fromkeys((*settings.model.terms, *FIRST_TERMS)))
    delayed = settings.estimate_delay or (settings.delay == 0 and "lag" not in terms)
    larger = replace(settings, model=replace(settings.model, terms=terms), estimate_delay=delayed)
    general = weak.fit(unloaded, loaded, larger, dict(lengths or {}), prior)
    stds = zip(general.names, general.std, general.status, strict=True)
    told = {name: std for name, std, status in stds if status == "OK"}
    least = np.array([told.get(name, 0.0) for name in fit.names])
    covariance = widened(fit.covariance, np.diag(least**2))
    if not fit.note or np.array_equal(covariance, fit.covariance):
        return replace(fit, covariance=covariance)
    added = [term for term in terms if term not in settings.model.terms]
    if delayed and not settings.estimate_delay:
        added.append("delay")
    return replace(fit, covariance=covariance, note=f"{fit.note}, with error bars as if it had {', '.join(added)} too")
