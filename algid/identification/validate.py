"""How well a result predicts logs that it was not made from, as numbers, as tables and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.arm import FloatArray
from algid.base.text import ABSENT, file_name, visible
from algid.estimators.prediction import (
    CUTOFF,
    FILTER,
    HORIZONS,
    NOTHING,
    rollouts,
    score,
)
from algid.identification.known import as_logged, model_of, reused, shift_of, torque_constants
from algid.identification.recordings import LogLike, Recordings, Role, open_source
from algid.identification.series import Predictor, torque_blocks
from algid.results import Result, TorquePrediction
from algid.table4 import finite

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile
    from algid.report.document import Table
    from algid.results.verdict import Judged

EVERY = "all logs"


def prediction(sums: FloatArray) -> TorquePrediction | None:
    """What the `sums` (9, 2) of a score say; None where every log was too short to judge.

    Of a joint without torque, shares are those of the other joint's. A joint that is hardly driven
    has little, since inertia, weight and friction make up for one another there: of its load is
    the RMSE over the torque's RMS, or that of the model's parts where it is larger. NaN is the RMSE
    of a state that no joint was in.
    """
    tau, squares, parts, left = sums[:4]
    moved, stood = sums[[4, 6]]
    count = moved + stood
    if not count.any():
        return None
    # of a joint without a motor, of the one that drives the arm
    drive, spread = (
        np.maximum(np.where(squares > 0, power, power[::-1]), 1e-300)
        for power in (squares, squares - tau**2 / count)
    )
    with np.errstate(invalid="ignore"):
        by_state = np.sqrt(sums[[5, 7, 8]] / [moved, stood, stood])
    moving, rest, held = ((finite(one), finite(other)) for one, other in by_state.tolist())
    return TorquePrediction(
        rmse=np.sqrt(left / count).tolist(),
        nrmse=np.sqrt(left / drive).tolist(),
        r2=(1 - left / spread).tolist(),
        filter=FILTER,
        bandwidth=CUTOFF,
        of_load=np.sqrt(left / np.maximum(drive, parts)).tolist(),
        rmse_moving=moving,
        rmse_rest=rest,
        rmse_held=held,
    )


def predictor_of(result: Result, name: str) -> Predictor:
    """The model of a result whose file is called `name`.

    Its coefficients raise as `torque_constants`.
    """
    model = model_of(result)
    return Predictor(
        model, lambda role: torque_constants(result, model, role, name), shift_of(result)
    )


@dataclass(frozen=True)
class Validated:
    """How well a result predicts logs.

    Parameters
    ----------
    logs : by its name the prediction of each log, None where it is too short to judge
    total : that of all logs together
    simulation : by log, then of all, a row each horizon: how far the arm simulated forward comes
        from its angles, None where there is no start or it runs away; empty where not asked for
    warnings : what its reader should know
    max_nrmse : the largest normalised RMSE allowed, if any
    judged : errors beside their limits, of a synthetic log's result
    data_lost : whether samples of a log are missing
    """

    logs: Mapping[str, TorquePrediction | None]
    total: TorquePrediction | None
    simulation: Mapping[str, list[dict[str, Any]]]
    warnings: tuple[str, ...] = ()
    max_nrmse: float | None = None
    judged: tuple[Judged, ...] = ()
    data_lost: bool = False

    def __repr__(self) -> str:
        r2 = "unknown"
        if self.total is not None:
            r2 = ", ".join(f"{one:.4f}" for one in self.total.r2)
        return f"Validated(logs: {len(self.logs)}, R² {r2})"

    @property
    def over(self) -> bool:
        """Whether something is past its limit, or missing."""
        return self.past or not all(one.passed for one in self.judged)

    @property
    def past(self) -> bool:
        """Whether the normalised RMSE of a joint is past the limit, or missing."""
        if self.max_nrmse is None:
            return False
        return self.total is None or max(self.total.nrmse) > self.max_nrmse

    def as_json(self) -> str:
        """All of it as the text of a JSON file."""
        every = [*self.logs.values(), self.total]
        *logs, total = (one and one.model_dump(mode="json") for one in every)
        content: dict[str, Any] = {"logs": dict(zip(self.logs, logs, strict=True))}
        content |= {"total": total, "over": self.over, "data_lost": self.data_lost}
        if self.judged:
            content["errors"] = [vars(one) for one in self.judged]
        if self.simulation:
            content["simulation"] = self.simulation
        return json.dumps(content, indent=2, allow_nan=False) + "\n"

    def tables(self) -> Iterator[Table]:
        """The predictions, and the simulations if there are any."""
        from algid.report.document import Table
        from algid.report.tables import prediction_table

        called = list(map(file_name, self.logs))  # where they differ
        if len(set(called)) < len(called):
            called = list(map(visible, self.logs))
        called.append(EVERY)
        yield prediction_table(dict(zip(called, [*self.logs.values(), self.total], strict=True)))
        rows: list[tuple[str, ...]] = []
        for name, horizons in zip(called, self.simulation.values(), strict=False):
            for row in horizons:
                place = (name, f"{row['horizon']:g}", str(row["starts"]))
                for joint, moved in enumerate(zip(row["rmse"], row["moved"], strict=True)):
                    cells = [ABSENT, ABSENT]
                    if row["starts"]:
                        cells = ["without bounds" if x is None else f"{x:.4g}" for x in moved]
                    rows.append((*place, str(joint + 1), *cells))
        if rows:
            headings = "Log | Horizon, s | States | Joint | RMSE, rad | Moved, rad"
            yield Table("Angles of the arm simulated forward", headings, rows)


def scores(known: Predictor, survey: Recordings) -> Iterator[FloatArray]:
    """The score of each of a survey's logs; raises as `coefficients`."""
    for log in survey.logs:
        c = known.coefficients(log.role)
        yield score(known.model, c, survey.segments(log), known.shift)


def predicted_by(known: Predictor, survey: Recordings) -> TorquePrediction | None:
    """How well the torque of all of a survey's logs together is predicted."""
    return prediction(sum(scores(known, survey), NOTHING))


def validate(known: Predictor, survey: Recordings, *, simulate: bool = False) -> Validated:
    """Predict the torque of a survey's logs and, if asked, simulate the arm from their states.

    Raises
    ------
    ResultError
        If a parameter that the prediction needs has no estimate.
    """
    scored = list(scores(known, survey))
    predictions = {log.name: prediction(one) for log, one in zip(survey.logs, scored, strict=True)}
    simulated: dict[str, FloatArray] = {}
    for log in survey.logs if simulate else ():
        moving, c = survey.segments(log), known.coefficients(log.role)
        simulated[log.name] = rollouts(known.model, c, moving, log.duration, known.shift)
    if simulate:
        simulated[EVERY] = np.sum(list(simulated.values()), axis=0)
    simulation = {}
    for name, (starts, *squares) in simulated.items():
        with np.errstate(invalid="ignore"):  # without a start a mean is no number
            means = np.sqrt(squares / starts)
        columns = zip(HORIZONS, starts[:, 0], *means, strict=True)
        simulation[name] = [
            {
                "horizon": horizon,
                "starts": int(count),
                "rmse": list(map(finite, rmse)),
                "moved": list(map(finite, moved)),
            }
            for horizon, count, rmse, moved in columns
        ]
    return Validated(predictions, prediction(sum(scored, NOTHING)), simulation)


def predicted(result: Result, log: LogLike, role: Role, profile: Profile | None) -> pl.DataFrame:
    """Motion, measured and predicted torque of a log: see `algid.Result.predict`."""
    import polars as pl

    file = result.log.path
    profile = reused(profile, result, file)
    known = predictor_of(as_logged(result, profile), file)
    source = open_source(log, role, profile)
    blocks = list(torque_blocks(Recordings([source], gravity=known.model.gravity), known))
    if not blocks:
        return pl.DataFrame()
    return pl.concat(map(pl.DataFrame, blocks), rechunk=True).drop("log")
