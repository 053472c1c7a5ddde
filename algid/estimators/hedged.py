"""Error bars where the evidence that chose the model's terms was refuted.

Terms are left out because the logs cannot tell them from nothing, and what cannot be distinguished is taken for zero:
that narrows the error bars. Where the likelihood is refuted afterwards, the torque has errors that no term explains,
and the same errors were weighed when the terms were. Error bars as if nothing had been left out let that in; the
estimates stay, since the smaller model foretells better. (On inference after selection: Leeb & Pötscher 2005,
Econometric Theory 21.) What differs from run to run shows it by itself: with `FEWEST_LOGS` logs nothing is widened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from algid.estimators import weak
from algid.estimators.combine import FEWEST_LOGS, Prior
from algid.estimators.diagnostics import joints_apart
from algid.estimators.fit import Fit, widened
from algid.estimators.identifiability import STILL
from algid.estimators.selection import FIRST_TERMS
from algid.estimators.weak import Source, WeakSettings
from algid.model import DELAYS, RIGID, UNITS
from algid.notices import Notice


def hedged(
    fit: Fit,
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
    lengths: Mapping[str, float] | None = None,
    prior: Prior | None = None,
) -> Fit:
    """The fit with no error bar narrower than that of the model with a delay and `FIRST_TERMS` too.

    Where a joint stood still, or the joints' equations contradict each other, k1 … k5 have status WEAK_EXCITATION.

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
    model = replace(settings.model, terms=terms)
    delayed = settings.estimate_delay or (bool(DELAYS) and settings.delay == 0 and model.lag_name is None)
    larger = replace(settings, model=model, estimate_delay=delayed)
    general = weak.fit(unloaded, loaded, larger, dict(lengths or {}), prior)
    stds = zip(general.names, general.std, general.status, strict=True)
    spreads = {name: std for name, std, status in stds if status == "OK"}
    least = np.array([spreads.get(name, 0.0) for name in fit.names])
    covariance = widened(fit.covariance, np.diag(least**2))
    wider = None
    if fit.refuted and not np.array_equal(covariance, fit.covariance):
        added = [term for term in terms if term not in settings.model.terms]
        if delayed and not settings.estimate_delay:
            added += DELAYS
        wider = Notice("WIDER_MODEL", numbers={"terms": added}, note=True)
    doubt = _doubt(fit, unloaded, loaded, settings)
    fit = replace(fit, covariance=covariance)
    fit = fit if wider is None else fit.noted(wider)
    return fit if doubt is None else fit.marked("WEAK_EXCITATION", RIGID).noted(doubt)


def _doubt(fit: Fit, unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings) -> Notice | None:
    """Why no error bar stands for k1 … k5: a joint that stood still, or whose torque contradicts the other's."""
    still = [f"joint {joint + 1}" for joint in range(2) if fit.moved[joint] < STILL]
    if still:
        return Notice("JOINT_STILL", numbers={"joints": still})
    names, value = settings.model.names, dict(zip(fit.names, fit.values.tolist(), strict=True))
    settings = replace(settings, estimate_delay=False, delay=value.get("delay", settings.delay))
    for sources, kind in ((unloaded, False), (loaded, True)):
        if not sources:
            continue
        at = None if settings.model.linear else fit.shared.coefficients(fit.values, kind)[: len(names)]
        every = [weak.normal_equations(source, settings, at) for source in sources]
        normals = [normal for normal in every if normal is not None]
        apart = joints_apart(normals, settings.model) if normals else None
        if apart is not None:
            unit = UNITS[apart.name]
            numbers = {"name": apart.name, "first": apart.first, "second": apart.second, "unit": unit}
            return Notice("JOINTS_CONTRADICT", numbers=numbers)
    return None
