"""Significance of all checks together: one budget of false alarms a log.

A sound log brings a warning by chance at most `BUDGET` of the time. Each check has its share of it
(`SHARES`), and that share is divided by the comparisons that it makes (Bonferroni 1936). A check
that gives a p value holds it against `level`; one that gives a distance in standard deviations
holds it against `sigmas`. What accuses (another arm, exchanged logs, a length that is wrong) asks
for `CERTAIN`: such a claim is never made of a single log's error bars, which are estimates
themselves.
"""

from __future__ import annotations

from functools import cache
from math import erfc, sqrt
from statistics import NormalDist

BUDGET = 0.01
"""Share of sound logs that may bring a warning."""
LEVEL = BUDGET / 11
"""The p value of a whole share. It also sets the margins of designs: a new check takes its share
from those of others, and leaves this as it is."""
SHARES = {
    "BROKEN_BOUND": 1 / 11,
    "whiteness": 2 / 11,  # of both joints; it warns of nothing, and has error bars wider
    "REFUTED": 1 / 11,
    "INSTRUMENTS": 1 / 11,
    "FEEDBACK": 1 / 11,
    "JOINTS_CONTRADICT": 1 / 11,
    "TORQUE_GAIN": 1 / 11,
    "LOGS_APART": 1 / 11,
    "LENGTH_CONTRADICTED": 1 / 11,
    "FAR_FROM_TRUTH": 1 / 11,
}
"""By code, what a check that chance can set off has of the budget; no more than all of it."""
CERTAIN = LEVEL**2
"""The p value below which something is accused."""

NORMAL = 1.959963984540054
"""Half width of a 95 % interval in standard deviations."""


def level(code: str) -> float:
    """The p value below which the check of this code speaks."""
    return BUDGET * SHARES[code]


@cache
def sigmas(level: float = LEVEL, comparisons: int = 1, sides: int = 2) -> float:
    """Standard deviations that the largest of several normal variables exceeds with `level`.

    Parameters
    ----------
    level : float
        Probability for all comparisons together.
    comparisons : int
        How many variables there are.
    sides : 1 or 2
        Whether one sign alone counts, or both.
    """
    return -NormalDist().inv_cdf(level / (sides * comparisons))


def chance(distance: float, comparisons: int = 1) -> float:
    """Two-sided p value of the largest of several distances in standard deviations (Bonferroni)."""
    return min(1.0, comparisons * erfc(distance / sqrt(2)))


SURE = sigmas(comparisons=16)
"""Standard deviations that none of an arm's and payload's 16 numbers exceeds by chance: 4.0."""
