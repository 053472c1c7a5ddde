"""How well a result predicts the torque of logs that it was not made from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from algid.arm import FloatArray
from algid.estimators.prediction import PredictionScore, score
from algid.estimators.rollout import RolloutScore, rollouts
from algid.identification.known import model_of, shift_of, torque_constants
from algid.identification.predicted import prediction
from algid.identification.recordings import Recordings, Role
from algid.model import Model
from algid.results import Result, TorquePrediction
from algid.signals.shift import AT_ONCE, TorqueShift


@dataclass(frozen=True)
class Validation:
    """The prediction of each log, None where it is too short to judge, and of all together."""

    logs: dict[str, TorquePrediction | None]
    total: TorquePrediction | None


@dataclass(frozen=True)
class Predictor:
    """A model to be judged on logs: torque, coefficients by role, and the logged torque's shift."""

    model: Model
    coefficients: Callable[[Role], FloatArray]
    shift: TorqueShift = AT_ONCE


@dataclass(frozen=True)
class Simulation:
    """How far simulations come from the angles of each log, and of all together."""

    logs: dict[str, RolloutScore]
    total: RolloutScore


def predictor_of(result: Result, name: str) -> Predictor:
    """The model of a result whose file is called `name`.

    Its coefficients raise as `torque_constants`.
    """
    model = model_of(result)
    return Predictor(
        model, lambda role: torque_constants(result, model, role, name), shift_of(result)
    )


def validate(known: Predictor, survey: Recordings) -> Validation:
    """Predict the torque of a survey's logs.

    Raises
    ------
    ResultError
        If a parameter that the prediction needs has no estimate.
    """
    predictions: dict[str, TorquePrediction | None] = {}
    total = PredictionScore()
    for log in survey.logs:
        one = score(known.model, known.coefficients(log.role), survey.segments(log), known.shift)
        predictions[log.name] = prediction(one)
        total += one
    return Validation(predictions, prediction(total))


def simulate(known: Predictor, survey: Recordings) -> Simulation:
    """Simulate the arm forward from states of a survey's logs; raises as `validate`."""
    scores: dict[str, RolloutScore] = {}
    total = RolloutScore()
    for log in survey.logs:
        duration = survey.summary(log).duration
        one = rollouts(
            known.model, known.coefficients(log.role), survey.segments(log), duration, known.shift
        )
        scores[log.name] = one
        total += one
    return Simulation(scores, total)
