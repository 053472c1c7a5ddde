"""How accurate the estimators are, and whether their error bars are honest: `make accuracy`.

Both cases of the paper and random arms, 10 s at 1 kHz without and with payload, under noise and by
encoders of twelve bits. A row gives errors over the Cramér-Rao bound (RMS): of the refined estimate
parameter by parameter, and of all of them pooled, beside least squares behind the filter that is
best for each parameter and the weak form; and how many of the refined intervals hold.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators import refined, weak
from algid.estimators.problem import Problem
from pipelines import accuracy_scenes as scenes
from pipelines.cramer_rao import joint_bound
from pipelines.experiment import Seen, count, experiment, grid, number, rms, share

ARMS = ("case1", "case2", "arm1", "arm2", "arm3", "arm4", "arm5")
NOISES = {f"{sigma:g} rad": (sigma, False) for sigma in (1e-4, 1e-3, 3e-3)}
NOISES["12 bit"] = (scenes.ENCODER_STEP / np.sqrt(12), True)
SHOWN = (*CONSTANT_NAMES, "m_p")  # the parameters whose figures are asked for


@cache
def scene(name: str) -> tuple[scenes.Scene, FloatArray]:
    """A scene, and its bound (8,) for σ_θ = 1 rad; it grows with σ_θ while σ_τ = 10 σ_θ."""
    here = scenes.scene(name)
    bound = joint_bound(here.bare, here.burdened, here.truth, here.arm.g, 1e-3, 1e-2) / 1e-3
    return here, bound[:8]


def draw(name: str, sigma: float, encoder: bool, _arm: int, seed: int) -> Seen:
    """Errors of every method on one pair of logs over the bound."""
    here, bound = scene(name)
    rng = np.random.default_rng([seed, sum(name.encode())])
    bare, burdened = (
        scenes.noisy(log, sigma, 10 * sigma, encoder, rng) for log in (here.bare, here.burdened)
    )
    problem = Problem([lambda: [bare]], [lambda: [burdened]])
    found = refined.fit(problem)
    errors = (found.values[:8] - here.truth[:8]) / (sigma * bound)
    filtered = scenes.filtered_least_squares(bare, burdened, here.arm.g) - here.truth[:8]
    rough = weak.fit(problem).values[:8] - here.truth[:8]
    places = [found.names.index(one) for one in (*SHOWN, "l1", "l2")]
    held = np.abs(found.values[places] - here.truth) <= found.quantile * found.std[places]
    seen: Seen = {one: [error] for one, error in zip(SHOWN, errors.tolist(), strict=True)}
    return seen | {
        "refined": errors.tolist(),
        "weak": (rough / (sigma * bound)).tolist(),
        "filtered": [filtered / (sigma * bound)],
        "held": held.tolist(),
        "fell back": [found.estimator != "refined" or not found.converged],
    }


def best(errors: Any) -> Any:
    """The RMS over parameters, each with the filter that is best for it, of (draws, filters, 8)."""
    return np.sqrt(np.mean(np.min(np.mean(errors**2, axis=0), axis=0)))


if __name__ == "__main__":
    rows = {f"{arm}, {noise}": (arm, *NOISES[noise]) for arm, noise in product(ARMS, NOISES)}
    columns = {one: number(one, rms) for one in SHOWN}
    columns |= {
        "refined": number("refined", rms),
        "weak": number("weak", rms),
        "filtered": number("filtered", best),
        "held": share("held"),
        "fell back": count("fell back"),
    }
    experiment("accuracy", __doc__, grid(rows, range(1)), draw, columns, draws=25)
