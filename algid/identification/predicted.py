"""How well a torque was predicted, as a result holds it."""

from __future__ import annotations

import numpy as np

from algid import results
from algid.arm import FloatArray
from algid.estimators.prediction import CUTOFF, FILTER, PredictionScore
from algid.table4 import finite


def prediction(score: PredictionScore) -> results.TorquePrediction | None:
    """As the result holds it; None where every log was too short to judge."""
    if score.count == 0:
        return None
    moving = rest = held = None
    if not np.isnan(score.by_state).all():
        moving, rest, held = map(_where_known, score.by_state)
    return results.TorquePrediction(
        rmse=_pair(score.rmse),
        nrmse=_pair(score.nrmse),
        r2=_pair(score.r2),
        filter=FILTER,
        bandwidth=CUTOFF,
        of_load=_pair(score.of_load),
        rmse_moving=moving,
        rmse_rest=rest,
        rmse_held=held,
    )


def _pair(values: FloatArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _where_known(values: FloatArray) -> tuple[float | None, float | None]:
    return finite(values[0]), finite(values[1])
