"""Significance of all checks together: one budget of false alarms a log.

A sound log brings a warning by chance at most `BUDGET` of the time. The budget is shared evenly by
`TESTS`, and the share of a test by the comparisons that it makes (Bonferroni 1936). A test that
gives a p value holds it against `LEVEL`; one that gives a distance in standard deviations holds it
against `sigmas`. What accuses (another arm, exchanged logs, a length that is wrong) asks for
`CERTAIN`: such a claim is never made of a single log's error bars, which are estimates themselves.
"""

from __future__ import annotations

from functools import cache
from math import erfc, sqrt
from statistics import NormalDist

BUDGET = 0.01
"""Share of sound logs that may bring a warning."""
TESTS = (
    "the bounds of physics",
    "the whiteness of the residual, joint 1",
    "the whiteness of the residual, joint 2",
    "the residual against the motion",
    "least squares against instruments",
    "an answer of the torque to the motion",
    "the constants of joint 1 against those of joint 2",
    "the gains of the torques",
    "loaded against unloaded logs",
    "a given length against that of the constants",
    "estimates against a truth that is known",
)
"""The tests by whose chance a sound log can bring a warning."""
LEVEL = BUDGET / len(TESTS)
"""The p value below which a test speaks."""
CERTAIN = LEVEL**2
"""The p value below which something is accused."""

NORMAL = 1.959963984540054
"""Half width of a 95 % interval in standard deviations."""
ONE_SIDED = 1.6448536269514722
"""Standard deviations of a bound that holds to one side 95 % of the time."""


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
