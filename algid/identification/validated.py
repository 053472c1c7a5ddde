"""What a validation found, as tables and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from algid.estimators.rollout import HORIZONS, RolloutScore
from algid.identification.validate import Simulation
from algid.report.document import Column, Table
from algid.report.tables import by_state
from algid.results import TorquePrediction
from algid.text import ABSENT, file_name, significant, visible

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
    """

    logs: dict[str, TorquePrediction | None]
    total: TorquePrediction | None
    simulation: Simulation | None = None
    warnings: tuple[str, ...] = ()
    max_nrmse: float | None = None

    @property
    def over(self) -> bool:
        """Whether the normalised RMSE of a joint is past the limit, or missing."""
        if self.max_nrmse is None:
            return False
        return self.total is None or max(self.total.nrmse) > self.max_nrmse

    @property
    def predictions(self) -> dict[str, TorquePrediction | None]:
        """The prediction of each log, then of all."""
        return {**self.logs, EVERY: self.total}

    @property
    def simulated(self) -> dict[str, list[dict[str, Any]]]:
        """By log, then of all, a row each horizon; empty where nothing was simulated."""
        if self.simulation is None:
            return {}
        every = {**self.simulation.logs, EVERY: self.simulation.total}
        return {name: _rows(one) for name, one in every.items()}

    def as_json(self) -> str:
        """All of it as the text of a JSON file."""
        predictions = {
            name: None if one is None else one.model_dump(mode="json")
            for name, one in self.predictions.items()
        }
        content: dict[str, Any] = {
            "logs": predictions,
            "total": predictions.pop(EVERY),
            "over": self.over,
        }
        if self.simulated:
            content["simulation"] = self.simulated
        return json.dumps(content, indent=2, allow_nan=False) + "\n"

    def tables(self) -> Iterator[Table]:
        """The predictions, and the simulations if there are any."""
        yield self._predicted()
        if self.simulation is not None:
            yield self._rolled()

    def _called(self) -> dict[str, str]:
        """What tables call the logs: their files' names where those tell them apart."""
        short = {name: file_name(name) for name in self.logs}
        apart = len(set(short.values())) == len(short)
        return {
            **(short if apart else {name: visible(name) for name in self.logs}),
            EVERY: EVERY,
        }

    def _predicted(self) -> Table:
        rows: list[tuple[str, ...]] = []
        called = self._called()
        for name, one in self.predictions.items():
            if one is None:
                rows.append((called[name], "too short", *[ABSENT] * 3))
                continue
            for joint, figures in enumerate(zip(one.rmse, one.nrmse, one.r2, strict=True), start=1):
                rows.append((called[name], str(joint), *(significant(f, 4) for f in figures)))
        note = "" if self.total is None else f"Filter: {self.total.filter}."
        if self.total is not None and (states := by_state(self.total)):
            note += f" RMSE of all logs: {states}."
        return _table(
            "Torque prediction", ("Log", "Joint", "RMSE, N m", "RMSE / RMS", "R²"), rows, note
        )

    def _rolled(self) -> Table:
        rows: list[tuple[str, ...]] = []
        called = self._called()
        for name, horizons in self.simulated.items():
            for row in horizons:
                for joint in range(2):
                    pair = [row[kind][joint] for kind in ("rmse", "moved")]
                    known = [_number(one) if row["starts"] else ABSENT for one in pair]
                    place = (f"{row['horizon']:g}", str(row["starts"]), str(joint + 1))
                    rows.append((called[name], *place, *known))
        headings = ("Log", "Horizon, s", "States", "Joint", "RMSE, rad", "Moved, rad")
        return _table("Angles of the arm simulated forward", headings, rows)


def _table(
    title: str, headings: tuple[str, ...], rows: list[tuple[str, ...]], note: str = ""
) -> Table:
    columns = (Column(headings[0], "name"), *(Column(one, "number") for one in headings[1:]))
    return Table(title, columns, tuple(rows), note)


def _rows(one: RolloutScore) -> list[dict[str, Any]]:
    """A horizon a row; None where there is no start, or where the simulation runs away."""

    def numbers(pair: Iterable[float]) -> list[float | None]:
        return [float(value) if np.isfinite(value) else None for value in pair]

    rows = zip(HORIZONS, one.count.tolist(), one.rmse, one.distance, strict=True)
    return [
        {"horizon": horizon, "starts": int(count), "rmse": numbers(rmse), "moved": numbers(moved)}
        for horizon, count, rmse, moved in rows
    ]


def _number(value: float | None) -> str:
    return "without bounds" if value is None else f"{value:.4g}"
