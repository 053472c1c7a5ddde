"""Prior of an arm before its run: from a result's folder, a shipped case, or a TOML file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.base.errors import ResultError, SettingError
from algid.base.names import given, named_values, outside, vector
from algid.base.significance import SURE
from algid.designs.belief import Belief
from algid.estimators.noise import first_guess
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.estimators.whitening import NoiseLevels
from algid.identification.known import (
    contradictions,
    covariance_of,
    given_lengths,
    model_of,
    noise_of,
    values_of,
    with_error_bar,
    wrong_inertia,
)
from algid.log import Log
from algid.model import DELAYS, SINES, TERMS, Model
from algid.notices import Notice
from algid.options import flag
from algid.results import Result, read_result
from algid.synth.cases import Case, load_case

PHASES = next(name for name, term in TERMS.items() if term.sines)
WRONG = 0.2  # share by which masses and friction of a drawing may be wrong
# the torque is not linear in them, or they are not of one instant
_UNPLANNED = tuple(name for name, term in TERMS.items() if not term.linear or term.timing)


@dataclass(frozen=True, eq=False)
class PriorArm:
    """An arm as it is believed to be.

    Parameters
    ----------
    source : str
        The file or case that it comes from.
    belief : Belief
    lengths : (2,), m
        Of the links; NaN where they are not known.
    noise : NoiseLevels or None
        Of the logs behind a result.
    doubts : what does not fit
    """

    source: str
    belief: Belief
    lengths: FloatArray
    noise: NoiseLevels | None
    doubts: tuple[Notice, ...] = ()


@dataclass(frozen=True)
class PriorKnowledge:
    """What the user knows beside the prior: link lengths, payload, and the error of the rest."""

    l1: float | None = None
    l2: float | None = None
    payload: float | None = None
    error: float | None = None

    @property
    def lengths(self) -> dict[str, float]:
        """The link lengths that are given, in m."""
        return given(l1=self.l1, l2=self.l2)


def prior_of(stated: Result | str, loaded: bool | None, knowns: PriorKnowledge) -> PriorArm:
    """The prior that is given.

    Parameters
    ----------
    stated : Result or str
        A result, its folder or file, the name of a shipped case, or a TOML file of an arm.
    loaded : bool or None
        Whether there are to be runs with the payload; None where there are if a payload is known.
    knowns : PriorKnowledge

    Raises
    ------
    ResultError
        If a result has no error bars where they are needed.
    SettingError
        If no arm has such an inertia matrix, or a payload is to be carried of which nothing is
        known.
    """
    source = stated.log.path if isinstance(stated, Result) else stated
    if isinstance(stated, str) and (Path(stated).is_dir() or Path(stated).suffix == ".json"):
        stated = read_result(stated)
    if isinstance(stated, Result):
        prior = _of_result(stated, source, loaded, knowns)
    else:
        prior = of_case(load_case(stated), source, loaded, knowns)
    value = named_values(prior.belief.shared.names, prior.belief.mean)
    wrong = wrong_inertia(value)
    if wrong is not None:
        raise SettingError(
            f"{source}: {wrong}; no arm is like that: identify it anew, or describe the arm in a "
            "TOML file"
        )
    return prior


def of_case(case: Case, source: str, loaded: bool | None, knowns: PriorKnowledge) -> PriorArm:
    """The prior of a simulated or drawn arm: masses and friction uncertain, lengths exact.

    Raises
    ------
    SettingError
        If there are to be loaded runs without a payload.
    """
    arm = replace(case.arm, **knowns.lengths)
    mass = case.payload if knowns.payload is None else knowns.payload
    x, y = case.place
    body = tuple(name for name, size in (("y_p", y), ("J_p", case.inertia)) if size)
    terms = (PHASES,) if arm.sines().any() or y else ()
    shared = _shared(Model(terms, gravity=arm.g), mass, loaded, source, knowns, body)

    def parameters(arm: Arm, mass: float) -> FloatArray:
        """Of the arm and a payload that is shaped like the case's."""
        value = named_values((*CONSTANT_NAMES, *SINES), arm.phasors())
        value |= {"m_p": mass, "l1": arm.l1, "l2": arm.l2 if x is None else x}
        value |= {"y_p": y, "J_p": case.carrying(mass).inertia}
        return vector(shared.names, value)

    more = 1 + (WRONG if knowns.error is None else knowns.error)
    mean, wrong = parameters(arm, mass), []
    for together in (("m1", "I1"), ("m2", "I2"), ("b1",), ("b2",)):
        larger = {name: more * getattr(arm, name) for name in together}
        wrong.append(parameters(replace(arm, **larger), mass))
    wrong.append(parameters(arm, more * mass))
    # the parameters are linear in each mass and friction
    belief = Belief(shared, mean, (np.array(wrong) - mean).T, box=True)
    return PriorArm(source, belief, np.array([arm.l1, arm.l2]), None)


def _shared(
    model: Model,
    mass: float | None,
    loaded: bool | None,
    source: str,
    knowns: PriorKnowledge,
    body: tuple[str, ...],
) -> Shared:
    if loaded and not mass:
        raise SettingError(
            f"{source}: it knows no payload for the loaded runs; give {flag('payload')} KG, or "
            f"{flag('runs')} 1,0"
        )
    if loaded is None:
        loaded = bool(mass)
    return Shared(model, payload=loaded, lengths=knowns.lengths, body=body if loaded else ())


def _of_result(
    result: Result, source: str, loaded: bool | None, knowns: PriorKnowledge
) -> PriorArm:
    """The prior of an identified arm: its estimates, and their covariance.

    An object of another mass is shaped like the one that was identified. What has no error bar is
    wrong by the error that the user states, at `SURE` deviations.

    Raises
    ------
    ResultError
        If a parameter has no estimate, or a constant no error bar where no error is stated.
    """
    model, doubts = model_of(result), contradictions(result, knowns.lengths)
    planned = outside(model.terms, _UNPLANNED)
    if planned != model.terms:
        titles = [TERMS[term].title for term in outside(model.terms, planned)]
        numbers = {"case": "terms", "terms": titles}
        doubts = (Notice("NOT_REACHED", numbers=numbers), *doubts)
        model = replace(model, terms=planned)
    value = values_of(result)
    exact = () if knowns.payload is None else ("m_p",)
    if knowns.payload is not None:
        if "J_p" in value:
            value["J_p"] *= knowns.payload / (value.get("m_p") or knowns.payload)
        value["m_p"] = knowns.payload
    lengths = given_lengths(result) | knowns.lengths
    value |= lengths
    body = with_error_bar(result, BODY_PARAMETERS)
    shared = _shared(model, value.get("m_p"), loaded, source, replace(knowns, **lengths), body)
    # what is estimated with the constants takes of their precision
    shared = replace(shared, delay=with_error_bar(result, DELAYS) == DELAYS)
    names = shared.names
    for name in outside(names, value):
        remedy = "identify it from logs that determine it"
        if name in ("l1", "l2"):
            remedy = f"give {flag(name)}"
        raise ResultError(f"{source}: the result has no {name}; {remedy}")
    mean = vector(names, value)
    # a root of the covariance
    known = with_error_bar(result, outside(names, exact))
    covariance = covariance_of(result, names, known)
    bare = outside(names, known)
    without = outside(bare, exact)
    if without and knowns.error is None:
        why = f"the result leaves {', '.join(without)} without error bars"
        if result.fit is None:
            why = f"the result of {flag('estimator')} {result.estimator} has no error bars"
        raise ResultError(
            f"{source}: {why}; identify from logs that determine them, or say how wrong it may be: "
            f"{flag('prior_error')}"
        )
    error = WRONG if knowns.error is None else knowns.error
    for row in map(names.index, bare):
        covariance[row, row] = (error * mean[row] / SURE) ** 2
    size = np.maximum(np.abs(mean), 1e-12)
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    spread = size[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    belief = Belief(shared, mean, spread, box=False)
    reach = np.array([value.get("l1", np.nan), value.get("l2", np.nan)])
    return PriorArm(source, belief, reach, noise_of(result), doubts)


def noise_for(
    prior: PriorArm, position: float | None, torque: float | None, log: Log | None
) -> NoiseLevels:
    """Noise that is given, else of a log, else of the logs behind the prior.

    Raises
    ------
    SettingError
        Where none is known.
    """
    measured = prior.noise if log is None else first_guess(log.theta, log.tau)
    stated, levels = {"position_noise": position, "torque_noise": torque}, []
    for (option, level), known in zip(stated.items(), measured or np.zeros((2, 2)), strict=True):
        found = known if level is None else np.full(2, level)
        if not np.all(found > 0):
            raise SettingError(
                f"{flag(option)}: {prior.source} does not tell how noisy the sensors are; give it, "
                f"or {flag('noise_from')}=LOG"
            )
        levels.append(found)
    return NoiseLevels(*levels)
