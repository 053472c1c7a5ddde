"""How well a result predicts logs, as tables and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.base.text import ABSENT, file_name, visible
from algid.estimators.rollout import HORIZONS, RolloutScore
from algid.identification.validate import Simulation
from algid.report.document import Table
from algid.report.tables import prediction_table
from algid.results import TorquePrediction

if TYPE_CHECKING:
    from algid.check import Judged

EVERY = "all logs"


@dataclass(frozen=True)
class Validated:
    """How well a result predicts logs.

    Parameters
    ----------
    logs : by its name the prediction of each log, None where it is too short to judge
    total : that of all logs together
    simulation : the arm simulated forward, where that was asked for
    warnings : what its reader should know
    max_nrmse : the largest normalised RMSE allowed, if any
    judged : errors beside their limits, of a synthetic log's result
    """

    logs: dict[str, TorquePrediction | None]
    total: TorquePrediction | None
    simulation: Simulation | None = None
    warnings: tuple[str, ...] = ()
    max_nrmse: float | None = None
    judged: tuple[Judged, ...] = ()

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

    @property
    def predictions(self) -> dict[str, TorquePrediction | None]:
        """The prediction of each log, then of all."""
        return self.logs | {EVERY: self.total}

    @property
    def simulated(self) -> dict[str, list[dict[str, Any]]]:
        """By log, then of all, a row each horizon; empty where nothing was simulated."""
        if self.simulation is None:
            return {}
        every = self.simulation.logs | {EVERY: self.simulation.total}
        return {name: _rows(one) for name, one in every.items()}

    def as_json(self) -> str:
        """All of it as the text of a JSON file."""
        content: dict[str, Any] = {
            "logs": {name: _as_json(one) for name, one in self.logs.items()},
            "total": _as_json(self.total),
            "over": self.over,
        }
        if self.judged:
            content["errors"] = [vars(one) for one in self.judged]
        if self.simulated:
            content["simulation"] = self.simulated
        return json.dumps(content, indent=2, allow_nan=False) + "\n"

    def tables(self) -> Iterator[Table]:
        """The predictions, and the simulations if there are any."""
        called = self._called()
        yield prediction_table({called[name]: one for name, one in self.predictions.items()})
        if self.simulation is not None:
            yield self._rolled()

    def _called(self) -> dict[str, str]:
        """What tables call the logs: their files' names where those differ."""
        called = list(map(file_name, self.logs))
        if len(set(called)) < len(called):
            called = list(map(visible, self.logs))
        return dict(zip(self.logs, called, strict=True)) | {EVERY: EVERY}

    def _rolled(self) -> Table:
        rows: list[tuple[str, ...]] = []
        called = self._called()
        for name, horizons in self.simulated.items():
            for row in horizons:
                horizon, starts = f"{row['horizon']:g}", str(row["starts"])
                for joint in range(2):
                    rmse = moved = ABSENT
                    if row["starts"]:
                        rmse = _number(row["rmse"][joint])
                        moved = _number(row["moved"][joint])
                    rows.append((called[name], horizon, starts, str(joint + 1), rmse, moved))
        headings = "Log | Horizon, s | States | Joint | RMSE, rad | Moved, rad"
        return Table("Angles of the arm simulated forward", headings, rows)


def _as_json(one: TorquePrediction | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return one.model_dump(mode="json")


def _rows(one: RolloutScore) -> list[dict[str, Any]]:
    """A horizon a row; None where there is no start, or where the simulation runs away."""
    rmse, moved = one.rmse, one.distance
    rows = []
    for place, horizon in enumerate(HORIZONS):
        rows.append(
            {
                "horizon": horizon,
                "starts": int(one.count[place]),
                "rmse": list(map(_finite, rmse[place])),
                "moved": list(map(_finite, moved[place])),
            }
        )
    return rows


def _finite(value: float) -> float | None:
    if not np.isfinite(value):
        return None
    return float(value)


def _number(value: float | None) -> str:
    if value is None:
        return "without bounds"
    return f"{value:.4g}"
