"""How well a result predicts the torque of logs that it was not made from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from algid.arm import FloatArray, payload_constants, with_payload
from algid.errors import ResultError
from algid.estimators.prediction import PredictionScore, Shift, score
from algid.estimators.rollout import RolloutScore, rollouts
from algid.identification.by_likelihood import model_of
from algid.identification.outcome import prediction
from algid.identification.source import Role, Survey
from algid.model import Model
from algid.results import Result, TorquePrediction
from algid.settings import Settings


@dataclass(frozen=True)
class Validation:
    """The prediction of each log, None where it is too short to judge, and of all together."""

    logs: dict[str, TorquePrediction | None]
    total: TorquePrediction | None


@dataclass(frozen=True)
class Predictor:
    """A model that is judged on logs: its torque, its coefficients for a log of a role, when a logged torque acts."""

    model: Model
    coefficients: Callable[[Role], FloatArray]
    shift: Shift = 0.0


@dataclass(frozen=True)
class Simulation:
    """How far simulations come from the angles of each log, and of all together."""

    logs: dict[str, RolloutScore]
    total: RolloutScore


def predictor_of(result: Result, name: str) -> Predictor:
    """The model of a result whose file is called `name`; its coefficients raise as `torque_constants`."""
    settings, model, delay = Settings.of(result.settings), model_of(result), result.parameters.get("delay")
    shift = partial(settings.torque_shift, found_delay=None if delay is None else delay.estimate)
    return Predictor(model, lambda role: torque_constants(result, model, role, name), shift)


def validate(known: Predictor, survey: Survey) -> Validation:
    """Predict the torque of a survey's logs.

    Raises
    ------
    ResultError
        If a parameter that the prediction needs has no estimate.
    """
    found: dict[str, TorquePrediction | None] = {}
    total = PredictionScore()
    for log in survey.logs:
        one = score(known.model, known.coefficients(log.role), survey.segments(log), known.shift)
        found[log.name] = prediction(one)
        total += one
    return Validation(found, prediction(total))


def simulate(known: Predictor, survey: Survey) -> Simulation:
    """Simulate the arm forward from states of a survey's logs; raises as `validate`."""
    found: dict[str, RolloutScore] = {}
    total = RolloutScore()
    for log in survey.logs:
        duration = survey.summary(log).duration
        one = rollouts(known.model, known.coefficients(log.role), survey.segments(log), duration, known.shift)
        found[log.name] = one
        total += one
    return Simulation(found, total)


def torque_constants(result: Result, model: Model, role: Role, file: str) -> FloatArray:
    """Coefficients of the model's columns for a log of that role, from the result of that file.

    Raises
    ------
    ResultError
        If one of them has no estimate.
    """
    values = {name: found.estimate for name, found in {**result.parameters, **result.payload}.items()}
    wanted = [*model.names, *(("m_p", "l1", "l2") if role == "loaded" else ())]
    values |= {name: length for name in ("l1", "l2") if (length := result.settings.get(name)) is not None}
    missing = next((name for name in wanted if values.get(name) is None), None)
    if missing is not None:
        raise ResultError(f"{file}: the result has no {missing}; identify it from logs that tell it")
    known = {name: float(value) for name, value in values.items() if value is not None}
    if role == "loaded":
        z = payload_constants(known["m_p"], known["l1"], known["l2"], model.gravity)
        k = with_payload(np.array([known.get(f"k{number}", 0.0) for number in range(1, 8)]), z)
        known |= {f"k{number + 1}": float(value) for number, value in enumerate(k)}
    return np.array([known[name] for name in model.names])
