"""The real arm of the accuracy benchmark: torque prediction, each run from the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.interpolate import CubicSpline

from algid.estimators import refined, weak
from algid.estimators.prediction import cross_validate
from algid.estimators.selection import Selection, select
from algid.estimators.weak import Source
from algid.model import Model
from algid.signals.segments import Segment

# N m; the parameters published with the data reach 0.149 and 0.085 behind the same filter
ASKED = (
    0.123,
    0.078,
)
AIM = (0.118, 0.072)


def run(path: Path) -> Segment:
    """One run on an even time base, angles in algid's convention."""
    table = pl.read_csv(path)
    t = table["time"].to_numpy()
    keep = np.append(True, np.diff(t) > 0)
    theta = np.stack([table["pos_meas1"].to_numpy() - np.pi / 2, table["pos_meas2"].to_numpy()])
    tau = np.stack([table["tau_meas1"].to_numpy(), table["tau_meas2"].to_numpy()])
    dt = float(np.median(np.diff(t[keep])))
    even = t[keep][0] + dt * np.arange(int((t[-1] - t[keep][0]) / dt))
    return Segment(
        0.0,
        dt,
        CubicSpline(t[keep], theta[:, keep], axis=1)(even),
        CubicSpline(t[keep], tau[:, keep], axis=1)(even),
    )


def evaluate(folder: Path) -> list[dict[str, Any]]:
    """RMSE by joint of each model, and what the differentiator's bandwidth does to k2."""
    runs = [run(path) for path in sorted((folder / "C1_sysid").glob("*.csv"))]
    sources: list[Source] = [lambda log=log: [log] for log in runs]  # type: ignore[misc]
    given = [
        Selection(Model(terms), delay=False)
        for terms in ((), ("coulomb", "offset"), ("coulomb", "rotor"))
    ]
    rows: list[dict[str, Any]] = []
    for chosen in (select(sources, (), weak.WeakSettings(bandwidth=60.0)), *given):
        settings = weak.WeakSettings(
            model=chosen.model, bandwidth=60.0, estimate_delay=chosen.delay
        )
        fit = refined.fit(sources, settings=settings)
        score = cross_validate(fit, sources)
        assert score is not None
        terms = " + ".join([*chosen.model.terms, *(["delay"] if chosen.delay else [])]) or "viscous"
        for joint in range(2):
            what = (
                f"{terms} (chosen by {chosen.chosen_by}): RMSE of joint {joint + 1}, N m (aim "
                f"{AIM[joint]:.3f})"
            )
            rows.append({"what": what, "value": float(score.rmse[joint]), "asked": ASKED[joint]})
    rows.append(_bandwidth(sources))
    return rows


def _bandwidth(sources: list[Source]) -> dict[str, Any]:
    model = Model(("coulomb", "rotor"))
    fits = [
        weak.fit(sources, settings=weak.WeakSettings(model=model, bandwidth=hertz))
        for hertz in (10.0, 30.0)
    ]
    change = abs(fits[1].values[1] - fits[0].values[1]) / fits[1].std[1]
    return {
        "what": "change of k2 from 10 Hz to 30 Hz of bandwidth, σ",
        "value": float(change),
        "asked": 1.0,
    }
