"""Errors that real arms have, and what `--model auto` makes of them: a part of `make accuracy`.

Each row of `real_arms.ROWS` is simulated on hidden arms, ten seconds unloaded and ten loaded, and
identified once with no flag and once with all the old flags. Asked: 88 % of the 95 % intervals of
k1 … k7 and m_p that hold the truth.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES
from algid.estimators import refined, robust
from algid.estimators.problem import Problem, WeakSettings
from algid.estimators.terms import Selection, select
from algid.model import Model
from pipelines.experiment import Seen, experiment, number, share, words
from pipelines.real_arms import ROWS, Scene, scenes

MODES = ("no flag", "all old flags")
FIRST_ARM, ARMS = 11, 4


def draw(row: str, mode: str, arm: int, seed: int, made: tuple[Scene, Scene]) -> Seen:
    """One pair of logs of a row, identified in one mode."""
    rng = np.random.default_rng([seed, arm, sum(row.encode())])
    unloaded, loaded = (one.log(rng) for one in made)
    logs = [lambda: [unloaded]], [lambda: [loaded]]
    weak = WeakSettings(bandwidth=60.0)
    flags = Selection(Model(("coulomb", "offset", "rotor")), delay=True)
    chosen = select(Problem(*logs, weak)) if mode == MODES[0] else flags
    weak = replace(weak, model=chosen.model, estimate_delay=chosen.delay)
    fit = refined.fit(Problem(*logs, weak))
    if fit.refuted and mode == MODES[0]:
        fit = robust.fit(
            Problem(*logs, replace(weak, model=chosen.shapes or chosen.model, estimate_delay=False))
        )
    names = [*CONSTANT_NAMES, "m_p"]
    places = [fit.names.index(name) for name in names]
    wanted = np.array([made[0].truth[name] for name in names])
    z = np.abs(fit.values[places] - wanted) / fit.std[places]
    error = np.abs(fit.values[places] / wanted - 1)
    dry: Seen = {}
    for kind in ("f", "s"):
        for name in (f"{kind}1", f"{kind}2"):
            if name in fit.names and made[0].truth[name]:
                place = fit.names.index(name)
                far = abs(fit.values[place] - made[0].truth[name]) / fit.std[place]
                dry.setdefault(f"{kind} held", []).append(far <= fit.quantile)
                dry.setdefault(f"{kind} far", []).append(far)
    return dry | {
        "by": [fit.estimator],
        "terms": [*chosen.model.terms, *(["delay"] if chosen.delay else [])],
        "held": (z <= fit.quantile).tolist(),
        "z": z.tolist(),
        "k": error[:-1].tolist(),
        "m_p": error[-1:].tolist(),
    }


def rows(given: Namespace) -> Iterable[tuple[str, Iterable[tuple[Any, ...]]]]:
    """Rows of errors in both modes; the arms of a row are simulated side by side."""
    seeds = tuple(range(FIRST_ARM, FIRST_ARM + (given.arms or ARMS)))
    for row, mode in product(ROWS, MODES):
        yield (
            f"{row}, {mode}",
            (
                (row, mode, arm, seed, made)
                for arm, made in zip(seeds, scenes(ROWS[row], seeds), strict=True)
                for seed in range(given.draws)
            ),
        )


if __name__ == "__main__":
    columns = {
        "estimators": words("by"),
        "held": share("held"),
        "95th percentile, σ": number("z", lambda z: np.percentile(z, 95)),
        "k: median, %": number("k", np.median, 100),
        "m_p": number("m_p", np.median, 100),
        "Coulomb held": share("f held"),
        "Stribeck held": share("s held"),
        "Stribeck farthest, σ": number("s far", np.max),
        "terms": words("terms"),
    }
    experiment("models", __doc__, rows, draw, columns, draws=4)
