"""How well a torque was predicted, as a result holds it."""

from __future__ import annotations

from algid import results
from algid.estimators.prediction import PredictionFilter, PredictionScore


def prediction(found: PredictionScore) -> results.TorquePrediction | None:
    """As the result holds it; None where every log was too short to judge."""
    if found.count == 0:
        return None
    rmse, nrmse, r2, of_load = (
        [float(value) for value in pair]
        for pair in (found.rmse, found.nrmse, found.r2, found.of_load)
    )
    by = PredictionFilter()
    return results.TorquePrediction(
        rmse=(rmse[0], rmse[1]),
        nrmse=(nrmse[0], nrmse[1]),
        r2=(r2[0], r2[1]),
        filter=str(by),
        bandwidth=by.cutoff,
        of_load=(of_load[0], of_load[1]),
    )
