"""How often a torque reaches the errors of the paper's Table 4, and what speed and observer do to
them.

    python -m pipelines.reproduce

The paper does not state its torque, its observer's gain, nor when it reads its errors. Of random
slow torques (four harmonics a joint, at most 4 N m, 0.1 to 1.5 Hz, from rest), this prints which
share has all twelve errors within those of Table 4, with a 95 % interval (Clopper and Pearson
1934), for both cases and two gains of the observer, and the errors of their best and of their
median. Then it prints the median of the largest error over speed and pole.

======  ===================================================  ===========  ======
symbol  name                                                 shape        unit
======  ===================================================  ===========  ======
x       observer's states [θ1, θ̇1, θ̈1, θ2, θ̇2, θ̈2]      (6, B)       rad, s
L       observer's gain                                      (6, 2)
genes   amplitudes, frequencies and phases of a torque       (24, B)      N m, Hz
======  ===================================================  ===========  ======
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache

import numpy as np
from scipy.linalg import expm
from scipy.signal import place_poles
from scipy.stats import binomtest

from algid.arm import FloatArray, with_payload
from algid.signals.observers import PAPER_POLES, A, C, observer_gain
from algid.synth.cases import Case, load_case
from pipelines.search_torque import (
    BOUNDS,
    DT,
    HARMONICS,
    JUDGED,
    SAMPLES,
    estimates,
    motions,
    table4_errors,
    torques,
)

CASES = ("case1", "case2")
BATCH = 250
SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Factors on every frequency of the torque."""
POLES = (-20.0, -40.0, -80.0, -160.0, -320.0)
"""Joint 1's slow pole, rad/s; the paper's is −80."""
MAPPED = 200
"""Torques behind each cell of the map."""


def three_a_joint(poles: Sequence[float]) -> FloatArray:
    """The gain L (6, 2) that algid chooses: three poles belong to each joint."""
    return observer_gain(tuple(poles))


def placed(poles: Sequence[float]) -> FloatArray:
    """The gain L (6, 2) of `scipy.signal.place_poles`, which couples the joints."""
    with warnings.catch_warnings():
        # its iteration does not settle for these poles
        warnings.simplefilter("ignore", UserWarning)
        found = place_poles(A.T, C.T, np.array(poles))
    return np.asarray(found.gain_matrix.T)


GAINS: dict[str, Callable[[Sequence[float]], FloatArray]] = {
    "three poles a joint": three_a_joint,
    "place_poles": placed,
}


def observed(theta: FloatArray, gain: FloatArray) -> FloatArray:
    """Velocities (2, B, N) by the observer of any `gain` (6, 2), at rest before the first angles.

    The observer ẋ = (A − L C) x + L y is discretised exactly for angles that are linear between
    samples.
    """
    held = np.zeros((10, 10))
    held[:6, :6], held[:6, 6:8] = (A - gain @ C) * DT, gain * DT
    held[6:8, 8:] = np.eye(2)
    step = expm(held)
    advance, ramp = step[:6, :6], step[:6, 8:]
    now = step[:6, 6:8] - ramp
    y = theta - theta[..., :1]
    x = np.zeros((6, theta.shape[1]))
    omega = np.zeros_like(theta)
    for sample in range(1, theta.shape[2]):
        x = advance @ x + now @ y[..., sample - 1] + ramp @ y[..., sample]
        omega[..., sample] = x[[1, 4]]
    return omega


def drawn(count: int, seed: int) -> FloatArray:
    """Random torques (24, count), uniform in the box of the search."""
    low, high = np.array(BOUNDS).T
    rng = np.random.default_rng(seed)
    return np.asarray((low + (high - low) * rng.random((count, len(BOUNDS)))).T)


@cache
def _gain(name: str, slow_pole: float) -> FloatArray:
    return GAINS[name]((slow_pole, *PAPER_POLES[1:]))


def case_errors(
    case: Case, genes: FloatArray, gain: FloatArray, judged: slice = JUDGED
) -> FloatArray:
    """Table 4's errors (12, B) in percent by an observer of `gain` (6, 2), read at `judged`."""
    k = case.arm.constants()
    tau = torques(genes, DT * np.arange(SAMPLES))
    unloaded = motions(k, genes)
    loaded = motions(with_payload(k, case.arm.payload_constants(case.payload)), genes)
    with np.errstate(all="ignore"):
        x_r = estimates(unloaded, tau, None, observed(unloaded, gain), judged)
        x_m = estimates(loaded, tau, x_r[3], observed(loaded, gain), judged)
        return table4_errors(case, x_r, x_m)


def print_choices() -> None:
    """Print what gain and read-out make of the torque that each case ships with."""
    print("The torque that each case ships with: its largest error as a multiple of the paper's")
    readouts = {"median of the last 0.2 s": JUDGED, "at t = 1 s": slice(-1, None)}
    for case_name in CASES:
        case = load_case(case_name)
        assert case.torque is not None
        parts = (case.torque.amplitude, case.torque.frequency, case.torque.phase)
        genes = np.array(parts).reshape(-1, 1)
        names, paper = zip(*case.paper_error_percent.items(), strict=True)
        for name in GAINS:
            for readout, judged in readouts.items():
                error = case_errors(case, genes, _gain(name, PAPER_POLES[0]), judged)[:, 0]
                share = np.abs(error) / np.array(paper)
                worst = int(np.argmax(share))
                print(
                    f"{case_name:6} {name:20} {readout:25} {share[worst]:8.3g}  {names[worst]}: "
                    f"{error[worst]:+.3g} %"
                )
    print()


def worst_shares(
    case_name: str, genes: FloatArray, gains: Sequence[str], slow_poles: Sequence[float]
) -> FloatArray:
    """The largest error as a share of the paper's (gains, poles, B).

    Infinite where a system is singular.
    """
    case = load_case(case_name)
    k = case.arm.constants()
    loaded = with_payload(k, case.arm.payload_constants(case.payload))
    tau = torques(genes, DT * np.arange(SAMPLES))
    unloaded_motion, loaded_motion = motions(k, genes), motions(loaded, genes)
    paper = np.array(list(case.paper_error_percent.values()))[:, None]
    worst = np.empty((len(gains), len(slow_poles), genes.shape[1]))
    for row, name in enumerate(gains):
        for column, pole in enumerate(slow_poles):
            gain = _gain(name, pole)
            with np.errstate(all="ignore"):
                x_r = estimates(unloaded_motion, tau, None, observed(unloaded_motion, gain))
                x_m = estimates(loaded_motion, tau, x_r[3], observed(loaded_motion, gain))
                shares = np.abs(table4_errors(case, x_r, x_m)) / paper
            worst[row, column] = np.nan_to_num(shares, nan=np.inf).max(axis=0)
    return worst


def _random_batch(job: tuple[str, int, int]) -> FloatArray:
    case_name, count, seed = job
    return worst_shares(case_name, drawn(count, seed), tuple(GAINS), (PAPER_POLES[0],))[:, 0]


def _map_batch(job: tuple[str, float]) -> FloatArray:
    case_name, speed = job
    genes = drawn(MAPPED, seed=10**6)
    genes[2 * HARMONICS : 4 * HARMONICS] *= speed
    return worst_shares(case_name, genes, ("three poles a joint",), POLES)[0]


def print_shares(pool: ProcessPoolExecutor, count: int) -> None:
    """Print which share of `count` random torques reaches Table 4."""
    batches = -(-count // BATCH)
    print(
        f"Random torques that reach Table 4, of {batches * BATCH}; errors as multiples of the "
        "paper's"
    )
    print(f"{'case':6} {'gain':20} {'reach it':>8} {'share, 95 %':>22} {'best':>8} {'median':>8}")
    for case_name in CASES:
        jobs = [(case_name, BATCH, seed) for seed in range(batches)]
        worst = np.concatenate(list(pool.map(_random_batch, jobs)), axis=1)
        for name, row in zip(GAINS, worst, strict=True):
            reached = int((row <= 1).sum())
            interval = binomtest(reached, row.size).proportion_ci(method="exact")
            share = f"{interval.low:.2g} to {interval.high:.2g}"
            best, middle = row.min(), np.median(row)
            print(f"{case_name:6} {name:20} {reached:8d} {share:>22} {best:8.3g} {middle:8.3g}")


def print_map(pool: ProcessPoolExecutor) -> None:
    """Print the median of the largest error over the torque's speed and the observer's
    slow pole.
    """
    print(f"\nMedian of the largest error over {MAPPED} torques, as a multiple of the paper's")
    for case_name in CASES:
        heading = "".join(f"{f'{pole:g} rad/s':>12}" for pole in POLES)
        print(f"{case_name}: frequencies × \\ joint 1's slow pole")
        print(f"{'':8}{heading}")
        rows = pool.map(_map_batch, [(case_name, speed) for speed in SPEEDS])
        for speed, row in zip(SPEEDS, rows, strict=True):
            print(f"{speed:<8g}" + "".join(f"{value:12.3g}" for value in np.median(row, axis=1)))


def main() -> None:
    """Print the shares and the map."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--torques", type=int, default=10_000)
    given = parser.parse_args()
    print_choices()
    with ProcessPoolExecutor(2) as pool:
        print_shares(pool, given.torques)
        print_map(pool)


if __name__ == "__main__":
    main()
