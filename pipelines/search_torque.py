"""Search the slow multi-sine torques with which the paper's method reaches the errors of its Table
4.

The paper does not state the torque behind Table 4. Its observer lags more the faster the arm
moves, so the torque decides the errors. This script seeks, for one case, four harmonics a joint
(0.1 to 1.5 Hz, at most 4 N m) that drive the unloaded and the loaded arm alike from rest, so that
the largest of the twelve errors, each as a share of the paper's, is as small as possible: CMA-ES
from the best of many Sobol points, seeded, hence repeatable. (The errors have poles wherever P_r
is singular, so that least squares gets nowhere, and differential evolution stalls at three times
the paper's.) It needs the package cma:

    pip install cma
    python -m pipelines.search_torque case1
    python -m pipelines.search_torque case2 --seed 1 --starts 1

print the [torque] tables of data/cases/. The search simulates by its own fixed-step Runge-Kutta
method over all candidates at once; what it finds is judged by `algid identify` on logs from `algid
synth`.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from scipy.stats import qmc

from algid.arm import FloatArray, forward_dynamics, with_payload
from algid.estimators.paper import columns, payload, solve_scaled, stack_rows
from algid.signals.observers import LuenbergerObserver
from algid.synth.cases import Case, load_case
from algid.synth.simulator import HANGING

DT = 1e-3
SAMPLES = 1001
SUBSTEPS = 2
JUDGED = slice(-200, None, 10)  # the last 0.2 s of the second, thinned out
HARMONICS = 4
ENOUGH = 0.9  # of the paper's errors: the search may stop
BOUNDS = (
    [(0.0, 4.0)] * (2 * HARMONICS)
    + [(0.1, 1.5)] * (2 * HARMONICS)
    + [(0.0, 2 * np.pi)] * (2 * HARMONICS)
)


def torques(genes: FloatArray, t: FloatArray) -> FloatArray:
    """Torque (2, B, M) of the candidates `genes` (24, B) at the times `t` (M,)."""
    amplitude, frequency, phase = genes.reshape(3, 2, HARMONICS, -1, 1)
    waves: FloatArray = (amplitude * np.sin(2 * np.pi * frequency * t + phase)).sum(axis=1)
    return waves


def motions(k: FloatArray, genes: FloatArray) -> FloatArray:
    """Angles (2, B, N) of the arm `k` from rest, by the classical Runge-Kutta method."""
    h = DT / SUBSTEPS
    tau = torques(genes, 0.5 * h * np.arange(2 * SUBSTEPS * (SAMPLES - 1) + 1))
    theta = np.repeat(HANGING[:, None], genes.shape[1], axis=1)
    omega = np.zeros_like(theta)
    angles = [theta]
    for step in range(SUBSTEPS * (SAMPLES - 1)):
        first, middle, last = np.moveaxis(tau[..., 2 * step : 2 * step + 3], -1, 0)
        a1 = forward_dynamics(k, theta, omega, first)
        a2 = forward_dynamics(k, theta + 0.5 * h * omega, omega + 0.5 * h * a1, middle)
        a3 = forward_dynamics(
            k, theta + 0.5 * h * (omega + 0.5 * h * a1), omega + 0.5 * h * a2, middle
        )
        a4 = forward_dynamics(k, theta + h * (omega + 0.5 * h * a2), omega + h * a3, last)
        theta = theta + h * omega + h**2 / 6 * (a1 + a2 + a3)
        omega = omega + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        if step % SUBSTEPS == SUBSTEPS - 1:
            angles.append(theta)
    return np.stack(angles, axis=-1)


def observed(theta: FloatArray) -> FloatArray:
    """Velocities (2, B, N) by the paper's observer, one candidate after the other."""
    candidates = np.moveaxis(theta, 1, 0)
    return np.stack([LuenbergerObserver(DT).velocities(angles) for angles in candidates], axis=1)


def estimates(
    theta: FloatArray,
    tau: FloatArray,
    known_k6: FloatArray | None,
    omega: FloatArray,
    judged: slice = JUDGED,
) -> FloatArray:
    """x_r (6, B), or x_m (5, B) where k6 (B,) is known: medians over the `judged` instants."""
    terms = columns(theta, omega, tau, DT)
    unknown, rhs = terms.first_joint(), terms.torque1
    if known_k6 is not None:
        unknown, rhs = np.delete(unknown, 3, axis=0), rhs - known_k6[:, None] * terms.viscous1
    rows = stack_rows(np.concatenate([unknown, rhs[None]]), DT, len(unknown))[..., judged]
    x = solve_scaled(rows[:, :-1], rows[:, -1]).x
    return np.where(np.isnan(x).any(axis=-1), np.inf, np.median(np.nan_to_num(x), axis=-1))


def errors(case: Case, genes: FloatArray) -> FloatArray:
    """Table 4's errors (12, B) in percent for the candidates `genes` (24, B)."""
    k = case.arm.constants()
    loaded = with_payload(k, case.arm.payload_constants(case.payload))
    tau = torques(genes, DT * np.arange(SAMPLES))
    unloaded_motion, loaded_motion = motions(k, genes), motions(loaded, genes)
    x_r = estimates(unloaded_motion, tau, None, observed(unloaded_motion))
    x_m = estimates(loaded_motion, tau, x_r[3], observed(loaded_motion))
    return table4_errors(case, x_r, x_m)


def table4_errors(case: Case, x_r: FloatArray, x_m: FloatArray) -> FloatArray:
    """Table 4's errors (12, B) in percent of the stages' estimates x_r (6, B) and x_m (5, B)."""
    k = case.arm.constants()
    loaded = with_payload(k, case.arm.payload_constants(case.payload))
    sum_, k1, k3, k6, k4, k2 = x_r
    _, m_p = payload(x_m, np.stack([k1, k2, k3, k4, sum_ - k3, k6]), case.arm.g)
    truth_r = np.array([k[4] + k[2], k[0], k[2], k[5], k[3], k[1]])
    truth_m = np.array([loaded[4] + loaded[2], loaded[0], loaded[2], loaded[3], loaded[1]])
    found = np.concatenate([x_r, x_m, m_p[None]])
    truth = np.concatenate([truth_r, truth_m, [case.payload]])[:, None]
    return 100 * (found / truth - 1)


def shares(case: Case, genes: FloatArray) -> FloatArray:
    """The errors (12, B) as shares of the paper's, sign kept, for the candidates
    `genes` (24, B).
    """
    paper = np.array(list(case.paper_error_percent.values()))[:, None]
    with np.errstate(all="ignore"):
        found = errors(case, genes) / paper
    return np.nan_to_num(found, nan=1e6, posinf=1e6, neginf=-1e6)


def worst_share(case: Case, genes: FloatArray) -> FloatArray:
    """The largest error as a share of the paper's (B,)."""
    worst: FloatArray = np.abs(shares(case, genes)).max(axis=0)
    return worst


def first_points(case: Case, points: int, count: int, seed: int) -> FloatArray:
    """The best `count` of `points` Sobol points (count, 24)."""
    low, high = np.array(BOUNDS).T
    drawn = low + (high - low) * qmc.Sobol(len(BOUNDS), rng=seed).random(points)
    score = np.concatenate(
        [worst_share(case, batch.T) for batch in np.split(drawn, range(256, points, 256))]
    )
    best: FloatArray = drawn[np.argsort(score)[:count]]
    return best


def evolve(case: Case, start: FloatArray, generations: int, seed: int) -> tuple[FloatArray, float]:
    """The candidate (24,) that CMA-ES reaches from `start` (24,), rounded as it will be written,
    and its share.
    """
    import cma

    low, high = np.array(BOUNDS).T
    options = {
        "bounds": [0, 1],
        "popsize": 64,
        "seed": seed + 1,
        "verbose": -9,
        "maxiter": generations,
    }
    strategy = cma.CMAEvolutionStrategy((start - low) / (high - low), 0.1, options)
    while not strategy.stop() and strategy.best.f > ENOUGH:
        candidates = np.array(strategy.ask())
        strategy.tell(candidates, worst_share(case, (low + (high - low) * candidates).T).tolist())
        if strategy.countiter % 50 == 0:
            print(
                f"generation {strategy.countiter}: worst error / paper's {strategy.best.f:.3g}",
                file=sys.stderr,
            )
    best = np.round(low + (high - low) * np.array(strategy.best.x), 4)
    return best, float(worst_share(case, best[:, None])[0])


def search(case: Case, points: int, starts: int, generations: int, seed: int) -> FloatArray:
    """The best candidate (24,) of several evolutions.

    The first that is good enough ends the search.
    """
    best: FloatArray = np.empty(0)
    best_share = np.inf
    for start in first_points(case, points, starts, seed):
        found, share = evolve(case, start, generations, seed)
        if share < best_share:
            best, best_share = found, share
        if best_share <= ENOUGH:
            break
    return best


def torque_table(genes: FloatArray) -> str:
    """The candidate (24,) as the [torque] table of a case file."""
    lines = []
    parts = dict(
        zip(("amplitude", "frequency", "phase"), genes.reshape(3, 2, HARMONICS), strict=True)
    )
    for joint in range(2):
        lines.append(f"[torque.joint{joint + 1}]")
        lines += [
            f"{name} = {[round(float(v), 4) for v in values[joint]]}"
            for name, values in parts.items()
        ]
    return "\n".join(lines)


def main() -> None:
    """Search for one case and print its torque."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", choices=["case1", "case2"])
    parser.add_argument("--points", type=int, default=2048, help="Sobol points to sift")
    parser.add_argument(
        "--starts", type=int, default=4, help="best points to evolve, one after the other"
    )
    parser.add_argument("--generations", type=int, default=400, help="from each")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    case = load_case(arguments.case)
    best = search(case, arguments.points, arguments.starts, arguments.generations, arguments.seed)
    print(torque_table(best))
    for name, error in zip(
        case.paper_error_percent, errors(case, best[:, None])[:, 0], strict=True
    ):
        print(f"# {name:12} {error:+.5f} %  paper {case.paper_error_percent[name]} %")


if __name__ == "__main__":
    main()
