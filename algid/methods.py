"""The estimators, one entry each: what each is, what it cannot take, and its function.

Whatever must know the estimators reads this table: settings, the command line and its completion,
identification, reports and the guide. Adding one is a module and an entry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from algid.estimators.fit import Fit
    from algid.estimators.problem import Problem


@dataclass(frozen=True)
class Estimator:
    """An estimator.

    Parameters
    ----------
    name : str
        As ``--estimator`` has it.
    title : str
        What it is called in a sentence.
    does, when : str
        What it does and when to take it, for the guide.
    fit : callable or None
        ``fit(problem)`` gives a `Fit`. None where estimates are what time series settle to: the
        paper's method.
    observer : "zero-phase" or "luenberger"
        Where its velocities come from, unless the settings say otherwise.
    lacks : names of settings
        That mean nothing to it: of the model its terms, of gravity that it is zero.
    beside_paper : bool
        Whether its report shows the paper's convergence too.
    """

    name: str
    title: str
    does: str
    when: str
    fit: Callable[[Problem], Fit] | None
    observer: Literal["zero-phase", "luenberger"] = "zero-phase"
    lacks: tuple[str, ...] = ()
    beside_paper: bool = False


def _refined(problem: Problem) -> Fit:
    from algid.estimators import refined

    return refined.fit(problem)


def _weak(problem: Problem) -> Fit:
    from algid.estimators import weak

    return weak.fit(problem)


def _instruments(problem: Problem) -> Fit:
    from algid.estimators import instruments

    return instruments.fit(problem)


ESTIMATORS: tuple[Estimator, ...] = (
    Estimator(
        "refined",
        "maximum likelihood",
        "maximum likelihood with noise in angles and torques; noise levels from the data; banded "
        "Gauss-Newton",
        "always, first",
        _refined,
        beside_paper=True,
    ),
    Estimator(
        "weak",
        "the weak form",
        "momentum form under sliding modulating functions, weighted least squares; no acceleration "
        "anywhere",
        "very long logs, a first look",
        _weak,
    ),
    Estimator(
        "instruments",
        "instrumental variables",
        "the same windows, with regressors simulated from the measured torque as instruments",
        "where unmodelled torque drives the motion",
        _instruments,
    ),
    Estimator(
        "paper",
        "the paper's method",
        "the paper's observer and nested integrals, as time series",
        "to compare with the paper",
        None,
        observer="luenberger",
        lacks=(
            "model",
            "delay",
            "l1",
            "l2",
            "payload_mass",
            "constrain",
            "cross_validate",
            "gravity",
            "prior",
        ),
    ),
)
"""The default first."""
NAMES = tuple(one.name for one in ESTIMATORS)


def estimator_of(name: str) -> Estimator:
    """The entry of a name.

    Raises
    ------
    ValueError
        If there is none.
    """
    estimator = next((one for one in ESTIMATORS if one.name == name), None)
    if estimator is None:
        raise ValueError(f"estimator must be one of {', '.join(NAMES)}, got {name!r}")
    return estimator


def settles(name: object) -> bool:
    """Whether the estimates of the estimator of that name are what time series settle to."""
    return any(one.name == name and one.fit is None for one in ESTIMATORS)
