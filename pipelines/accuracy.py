"""How accurate the estimators are, and whether their error bars are honest: `make accuracy`.

Writes `accuracy.md` and `accuracy.json` into the output folder. `--draws 100` is
the full run; `--quick` makes it short. Every figure stands beside the one asked for.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators import refined, weak
from algid.estimators.fit import Fit
from algid.estimators.problem import Problem, WeakSettings
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.synth.cases import load_case
from algid.synth.excitation import SampledTorque
from algid.synth.simulator import simulate
from pipelines import accuracy_scenes as scenes
from pipelines.accuracy_report import markdown
from pipelines.cramer_rao import joint_bound

SCENES = ("case1", "case2", "arm1", "arm2", "arm3", "arm4", "arm5")
NOISES = (1e-4, 1e-3, 3e-3)
SHOWN = (*CONSTANT_NAMES, "m_p")  # the parameters whose figures are asked for
METHODS = ("filtered", "paper", "weak", "refined")
Row = dict[str, Any]

_scenes: dict[str, scenes.Scene] = {}


def install(made: dict[str, scenes.Scene]) -> None:
    """Hand the motions to a process, so that each is integrated once."""
    _scenes.update(made)


def scene_of(name: str) -> scenes.Scene:
    return _scenes[name]


def fit_pair(fit: Callable[..., Fit], bare: Segment, burdened: Segment) -> Fit:
    return fit([lambda: [bare]], [lambda: [burdened]])


def _draw(job: tuple[str, float, bool, int]) -> dict[str, Any]:
    """Estimates of every method on one pair of logs.

    The refined and the weak one with their error bars.
    """
    name, sigma, encoder, seed = job
    here = scene_of(name)
    rng = np.random.default_rng([seed, sum(name.encode())])
    bare, burdened = (
        scenes.noisy(log, sigma, 10 * sigma, encoder, rng) for log in (here.bare, here.burdened)
    )
    fits = {
        "refined": fit_pair(refined.fit, bare, burdened),
        "weak": fit_pair(weak.fit, bare, burdened),
    }
    found: dict[str, Any] = {"filtered": scenes.filtered_least_squares(bare, burdened, here.arm.g)}
    found["paper"] = scenes.paper(bare, burdened, here.arm.g)
    for method, fit in fits.items():
        found[method] = fit.values[:8]
        found[f"{method} inside"] = here.held_by(fit)
    found["fell back"] = np.array(
        fits["refined"].estimator != "refined" or not fits["refined"].converged
    )
    return found


def noise_rows(pool: ProcessPoolExecutor, draws: int) -> list[Row]:
    """Every arm and noise: RMS over the bound, bias over σ, coverage, and the methods side by
    side.
    """
    jobs = [(name, sigma, encoder) for name in SCENES for sigma, encoder in _noises()]
    drawn = list(
        pool.map(_draw, [(*job, seed) for job in jobs for seed in range(draws)], chunksize=4)
    )
    bounds = dict(zip(SCENES, pool.map(bound, SCENES), strict=True))
    return [
        _noise_row(*job, drawn[index * draws : (index + 1) * draws], bounds[job[0]])
        for index, job in enumerate(jobs)
    ]


def _noises() -> list[tuple[float, bool]]:
    return [*((sigma, False) for sigma in NOISES), (scenes.ENCODER_STEP / np.sqrt(12), True)]


def bound(name: str) -> FloatArray:
    """The bound (10,) for σ_θ = 1 rad; it grows with σ_θ while σ_τ = 10 σ_θ."""
    here = scene_of(name)
    return joint_bound(here.bare, here.burdened, here.truth, here.arm.g, 1e-3, 1e-2) / 1e-3


def _noise_row(
    name: str, sigma: float, encoder: bool, drawn: list[dict[str, Any]], bound: FloatArray
) -> Row:
    here = scene_of(name)
    truth, sigmas = here.truth[:8], sigma * bound[:8]
    errors = {method: np.array([draw[method] for draw in drawn]) - truth for method in METHODS}
    rms = {method: np.sqrt(np.mean(error**2, axis=0)) for method, error in errors.items()}
    rms["filtered"] = rms["filtered"].min(axis=0)  # the best cutoff of each parameter
    bias = errors["refined"].mean(axis=0) / np.maximum(errors["refined"].std(axis=0), 1e-300)
    return {
        "arm": name,
        "turns": here.turns.round(1).tolist(),
        "sigma_theta": sigma,
        "encoder": encoder,
        "rms_over_bound": {method: (value / sigmas).tolist() for method, value in rms.items()},
        "rms_percent": {
            method: (100 * value / np.abs(truth)).tolist() for method, value in rms.items()
        },
        "bias_over_sigma": bias.tolist(),
        "coverage": float(np.mean([draw["refined inside"] for draw in drawn])),
        "weak_coverage": float(np.mean([draw["weak inside"] for draw in drawn])),
        "fell_back": int(np.sum([draw["fell back"] for draw in drawn])),
        "pooled_over_bound": {
            method: float(np.sqrt(np.mean((rms[method] / sigmas) ** 2))) for method in METHODS
        },
    }


def table4_rows() -> list[Row]:
    """Errors without noise against the paper's Table 4: largest share of a hundredth of the
    paper's error.
    """
    rows = []
    for name in ("case1", "case2"):
        here, case = scene_of(name), load_case(name)
        rng = np.random.default_rng(0)
        fit = fit_pair(
            refined.fit,
            *(scenes.noisy(log, 0.0, 0.0, False, rng) for log in (here.bare, here.burdened)),
        )
        estimated, true = (_table4(fit, beta) for beta in (fit.values, here.truth))
        for row, paper_error in case.paper_error_percent.items():
            error = 100 * abs(estimated[row] / true[row] - 1)
            rows.append(
                {
                    "case": name,
                    "row": row,
                    "error_percent": error,
                    "paper_error_percent": paper_error,
                }
            )
    return rows


def _table4(fit: Fit, beta: FloatArray) -> dict[str, float]:
    k = dict(zip(CONSTANT_NAMES, fit.shared.coefficients(beta, loaded=False), strict=True))
    m = dict(zip(CONSTANT_NAMES, fit.shared.coefficients(beta, loaded=True), strict=True))
    return {
        **{name: float(k[name]) for name in ("k1", "k2", "k3", "k4", "k6")},
        "k5+k3": float(k["k5"] + k["k3"]),
        "k5+k3+z1+z2": float(m["k5"] + m["k3"]),
        "k1+z3": float(m["k1"]),
        "k3+z2": float(m["k3"]),
        "k4+z4": float(m["k4"]),
        "k2+z5": float(m["k2"]),
        "m_p": float(beta[7]),
    }


def timing_rows(draws: int) -> list[Row]:
    """A delay of 5 ms, estimated and ignored; a torque that is held between its samples."""
    here = scene_of("case1")
    errors = [_delayed(here, seed) for seed in range(draws)]
    found = np.array([error[0] for error in errors])
    k = here.arm.constants()
    held = _held(here)
    return [
        {
            "what": "delay of 5 ms: error, ms",
            "value": float(1e3 * np.abs(found[:, 7] - 5e-3).max()),
            "asked": 0.1,
        },
        {
            "what": "friction bias with it estimated, %",
            "value": float(100 * np.abs(found[:, 5:7].mean(axis=0) / k[5:7] - 1).max()),
            "asked": 0.1,
        },
        {"what": "friction bias with it ignored, %", "value": float(errors[0][1]), "asked": None},
        {
            "what": "friction bias of a held torque, hold known, %",
            "value": held["zoh"],
            "asked": 0.05,
        },
        {
            "what": "friction bias of a held torque, hold ignored, %",
            "value": held["foh"],
            "asked": None,
        },
    ]


def _delayed(here: scenes.Scene, seed: int) -> tuple[FloatArray, float]:
    log = scenes.noisy(here.bare, 1e-4, 1e-3, False, np.random.default_rng(seed))
    late = replace(
        log, theta=log.theta[:, :-5], tau=log.tau[:, 5:]
    )  # the logged torque acts 5 ms after its stamp
    estimated = refined.fit(Problem([lambda: [late]], settings=WeakSettings(estimate_delay=True)))
    ignored = refined.fit(Problem([lambda: [late]])).values[5:7] / here.arm.constants()[5:7] - 1
    return estimated.values, float(100 * np.abs(ignored).max())


def _held(here: scenes.Scene) -> dict[str, float]:
    k = here.arm.constants()
    t = here.bare.t
    motion = simulate(k, SampledTorque(t, here.bare.tau, "zoh"), t)
    log = Segment(0.0, 1 / scenes.RATE, motion.theta, here.bare.tau)
    bias = {}
    for hold in ("zoh", "foh"):
        fit = refined.fit(
            Problem([lambda: [log]], settings=WeakSettings(shift=TorqueShift(hold == "zoh")))
        )
        bias[hold] = float(100 * np.abs(fit.values[5:7] / k[5:7] - 1).max())
    return bias


def cost_rows() -> list[Row]:
    """Seconds of one core for logs of 10 s to 1000 s, and the slope in a log-log fit."""
    here = scene_of("case1")
    rng = np.random.default_rng(0)
    lengths, seconds = (1, 3, 10, 30, 100), []
    tens = [scenes.noisy(here.bare, 1e-3, 1e-2, False, rng) for _ in range(lengths[-1])]
    for count in lengths:
        repeats = max(1, 10 // count)
        begin = time.process_time()
        for _ in range(repeats):
            refined.fit(Problem([partial(_first, tens, count)]))
        seconds.append((time.process_time() - begin) / repeats)
    slope = np.polyfit(np.log(lengths), np.log(seconds), 1)[0]
    rows: list[Row] = [
        {"what": f"{10 * n} s of log, s", "value": s, "asked": None}
        for n, s in zip(lengths, seconds, strict=True)
    ]
    rows[0]["asked"] = 0.5
    return [
        *rows,
        {"what": "slope of cost in a log-log fit, at most", "value": float(slope), "asked": 1.1},
    ]


def _first(logs: list[Segment], count: int) -> list[Segment]:
    return logs[:count]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/accuracy"))
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--quick", action="store_true", help="six draws instead")
    given = parser.parse_args()
    draws = 6 if given.quick else given.draws
    given.output.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(2) as pool:
        install(dict(zip(SCENES, pool.map(scenes.scene, SCENES), strict=True)))
    with ProcessPoolExecutor(2, initializer=install, initargs=(_scenes,)) as pool:
        noise = noise_rows(pool, draws)
    found = {
        "draws": draws,
        "noise": noise,
        "table4": table4_rows(),
        "timing": timing_rows(min(draws, 20)),
        "cost": cost_rows(),
    }
    (given.output / "accuracy.json").write_text(json.dumps(found, indent=1))
    text = markdown(found)
    (given.output / "accuracy.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
