"""The estimators, one entry each: what each is, what it cannot take, and its function.

Whatever must know the estimators reads this table: settings, the command line and its completion,
identification, reports and the guide. Adding one is a module and an entry.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
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
    settles : bool
        Whether estimates are what time series settle to: the paper's method, which has no `fit`.
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
    observer: Literal["zero-phase", "luenberger"] = "zero-phase"
    lacks: tuple[str, ...] = ()
    beside_paper: bool = False
    settles: bool = False

    def fit(self, problem: Problem) -> Fit:
        """What the module of its name makes of a problem."""
        fit: Fit = import_module(f"algid.estimators.{self.name}").fit(problem)
        return fit


ESTIMATORS: tuple[Estimator, ...] = (
    Estimator(
        "refined",
        "maximum likelihood",
        "maximum likelihood with noise in angles and torques; noise levels from the data; banded "
        "Gauss-Newton",
        "always, first",
        beside_paper=True,
    ),
    Estimator(
        "weak",
        "the weak form",
        "momentum form under sliding modulating functions, weighted least squares; no acceleration "
        "anywhere",
        "very long logs, a first look",
    ),
    Estimator(
        "instruments",
        "instrumental variables",
        "the same windows, with regressors simulated from the measured torque as instruments",
        "where unmodelled torque drives the motion",
    ),
    Estimator(
        "paper",
        "the paper's method",
        "the paper's observer and nested integrals, as time series",
        "to compare with the paper",
        observer="luenberger",
        settles=True,
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
    """The entry of a name that `NAMES` holds."""
    return ESTIMATORS[NAMES.index(name)]


def settles(name: object) -> bool:
    """Whether the estimates of the estimator of that name are what time series settle to."""
    return any(one.name == name and one.settles for one in ESTIMATORS)
