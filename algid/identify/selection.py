"""Do the optional terms of the model earn their place, and does a loaded log belong to the unloaded arm?

A term's worth is the fall of the likelihood when its coefficients are set to zero, which near the estimate is
the Wald statistic. It is formed with the covariance that the error bars rest on, so that coloured residuals do
not make every term look significant; the Bayesian criterion (Schwarz 1978) counts as samples what is independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtri

from algid.arm import FloatArray
from algid.identify.blocks import long_run_variance
from algid.identify.fit import Fit
from algid.identify.information import LogInformation, Prior, combine, scaled_pinv
from algid.identify.model import COULOMB_NAMES, OFFSET_NAMES, ROTOR_NAMES

TERMS = {"coulomb": COULOMB_NAMES, "offset": OFFSET_NAMES, "rotor": ROTOR_NAMES, "delay": ("delay",)}


@dataclass(frozen=True)
class TermWorth:
    """An optional term: the criterion with it less that without it (negative: it earns its place)."""

    term: str
    delta_bic: float

    @property
    def earned(self) -> bool:
        """Whether the criterion favours the term."""
        return self.delta_bic < 0


def term_worths(fit: Fit) -> list[TermWorth]:
    """Worth of each optional term of a fit's model."""
    worths = []
    for term, names in TERMS.items():
        places = [fit.names.index(name) for name in names if name in fit.names]
        if not places:
            continue
        values = fit.values[places]
        wald = float(values @ scaled_pinv(fit.covariance[np.ix_(places, places)]) @ values)
        worths.append(TermWorth(term, len(places) * float(np.log(max(2, fit.freedom))) - wald))
    return worths


def payload_distance(fit: Fit) -> float | None:
    """How far the loaded logs are from the unloaded arm with any payload, in standard deviations.

    None where the logs of either kind do not determine their own constants. The statistic compares the arm's
    constants with the loaded arm's, less the payload that fits best; it is chi-squared where they agree.
    """
    sides = [_alone([log for log in fit.logs if log.loaded is loaded]) for loaded in (False, True)]
    if not fit.shared.payload or any(side is None for side in sides):
        return None
    bare, burdened = [side for side in sides if side is not None]
    freedom = len(fit.shared.log_names) - (len(fit.shared.names) - len(fit.shared.log_names))
    arm = Prior.of(fit.shared.log_names, bare[0], bare[1])
    loaded = LogInformation(True, burdened[0], scaled_pinv(burdened[1])[None], np.zeros_like(burdened[0])[None])
    _, _, value = combine(fit.shared, [loaded], fit.values, arm)
    return max(0.0, float(-ndtri(chdtrc(freedom, max(0.0, -2 * value)))))


def _alone(logs: list[LogInformation]) -> tuple[FloatArray, FloatArray] | None:
    """Coefficients (q,) that logs of one kind give by themselves, and their robust covariance (q, q)."""
    if not logs:
        return None
    S = sum((log.total[0] for log in logs[1:]), logs[0].total[0])
    g = sum(
        (log.total[1] + log.total[0] @ log.c0 for log in logs[1:]), logs[0].total[1] + logs[0].total[0] @ logs[0].c0
    )
    inverse = scaled_pinv(S)
    if np.linalg.matrix_rank(inverse @ S) < S.shape[0]:
        return None
    c = inverse @ g
    meat = sum((long_run_variance(log.g - log.S @ (c - log.c0))[0] for log in logs), np.zeros_like(S))
    return c, inverse @ meat @ inverse
