"""Results of arms whose coefficients are known, without any log."""

from __future__ import annotations

import numpy as np

from algid.arm import Arm, FloatArray
from algid.model import UNITS, Model
from algid.results import Estimate, FitSummary, LogSummary, Result, TorqueModel

UNIFORM = Arm(1.2, 0.8, 0.2, 0.15, 0.4, 0.3, 1.2 * 0.4**2 / 12, 0.8 * 0.3**2 / 12, 0.3, 0.2)
ODD = Arm(2.0, 0.7, 0.13, 0.11, 0.4, 0.3, 0.05, 0.006, 0.3, 0.2)


def values_of(arm: Arm, **more: float) -> dict[str, float]:
    """Coefficients of an arm by name, with those of further terms."""
    return {f"k{number}": float(k) for number, k in enumerate(arm.constants(), start=1)} | more


def result_of(
    value: dict[str, float],
    model: Model | None = None,
    payload: dict[str, float] | None = None,
    std: float = 1e-3,
    **settings: float,
) -> Result:
    """A result with these coefficients, `std` of each of which it is uncertain, independently."""
    model = model or Model()
    names = [*model.names, *(payload or {})]
    every = {**value, **(payload or {})}
    spread = np.array([std * abs(every[name]) for name in names])
    found = {
        name: Estimate(estimate=every[name], std=float(one), unit=UNITS[name])
        for name, one in zip(names, spread, strict=True)
    }
    shape = TorqueModel(
        terms=list(model.terms),
        coulomb_speed=model.coulomb_speed,
        stribeck_speed=model.stribeck_speed,
        chosen_by="settings",
    )
    return Result(
        version="0",
        estimator="refined",
        parameters={name: found[name] for name in model.names},
        payload={name: found[name] for name in payload or {}},
        fit=FitSummary(
            noise={},
            covariance_names=names,
            covariance=np.diag(spread**2).tolist(),
            intervals="likelihood",
            iterations=1,
            converged=True,
            model=shape,
        ),
        settings={"gravity": model.gravity, **settings},
        log=LogSummary(
            path="run--1.csv",
            sha256=None,
            role="unloaded",
            format="csv",
            rows=2,
            duration=1.0,
            rate=1.0,
            mapping={},
        ),
    )


def states(count: int = 1000) -> FloatArray:
    """θ, ω and α of random states: (3, 2, count)."""
    draw = np.random.default_rng(12)
    return np.stack(
        [
            draw.uniform(-np.pi, np.pi, (2, count)),
            draw.normal(0, 3, (2, count)),
            draw.normal(0, 20, (2, count)),
        ]
    )
