"""How well a torque was predicted, as a result holds it."""

from __future__ import annotations

import numpy as np

from algid import results
from algid.arm import FloatArray
from algid.estimators.prediction import PredictionFilter, PredictionScore
from algid.table4 import finite


def prediction(found: PredictionScore) -> results.TorquePrediction | None:
    """As the result holds it; None where every log was too short to judge."""
    if found.count == 0:
        return None
    rmse, nrmse, r2, of_load = (
        [float(value) for value in pair]
        for pair in (found.rmse, found.nrmse, found.r2, found.of_load)
    )
    by = PredictionFilter()
    states = found.standing
    known = bool(np.any(states.moving + states.rest))
    return results.TorquePrediction(
        rmse=(rmse[0], rmse[1]),
        nrmse=(nrmse[0], nrmse[1]),
        r2=(r2[0], r2[1]),
        filter=str(by),
        bandwidth=by.cutoff,
        of_load=(of_load[0], of_load[1]),
        rmse_moving=_pair(states.rmse_moving) if known else None,
        rmse_rest=_pair(states.rmse_rest) if known else None,
        rmse_held=_pair(states.rmse_held) if known else None,
    )


def _pair(values: FloatArray) -> tuple[float | None, float | None]:
    return finite(values[0]), finite(values[1])
