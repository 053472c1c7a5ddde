"""What a choice of the weak windows' length moves, where few logs show little of the model's error.

From four logs on, leaving them out shows how far an estimate moves with what the model lacks. With
fewer, its windows are all that speak: longer ones weigh slow errors more, shorter ones fast ones.
Where the model holds all lengths agree within the error bars; where it does not, the scatter of the
estimates about the one reported is part of their error:

    W = V + Σ_w d dᵀ / n,   d = β_w − β,   n windows of `FACTORS` times the length
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators import shrunk
from algid.estimators.combine import Prior
from algid.estimators.fit import Fit
from algid.estimators.too_short import TooShortError
from algid.estimators.weak import Source, WeakSettings

FACTORS = (0.5, 2.0)


def scattered(
    fit: Fit,
    least: Fit,
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
    lengths: Mapping[str, float] | None = None,
    known: Prior | None = None,
) -> Fit:
    """The fit with the windows' scatter in its covariance; as it is where logs are left out.

    Parameters
    ----------
    fit : Fit
        Of shrunk terms, by least squares or by instruments.
    least : Fit
        The former.
    unloaded, loaded, settings, lengths, known : as of `shrunk.fit`
    """
    if fit.intervals == "jackknife":
        return fit
    determined = np.array([status != "NOT_IDENTIFIABLE" for status in least.status])
    moved: list[FloatArray] = []
    for factor in FACTORS:
        other = replace(settings, window=factor * settings.window)
        try:
            other_fit = shrunk.fit(unloaded, loaded, other, lengths, known)
        except TooShortError:  # of the longer windows
            continue
        if other_fit.names == least.names:
            moved.append(np.where(determined, other_fit.values - least.values, 0.0))
    if not moved:
        return fit
    scatter = np.transpose(moved) @ np.array(moved) / len(moved)
    return replace(fit, covariance=fit.covariance + scatter)
