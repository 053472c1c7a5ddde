"""What an unmodelled torque that drives the motion does to each estimator: bias and coverage in
simulation.

    python -m pipelines.disturbance

The disturbance is an Ornstein-Uhlenbeck torque of 50 ms and 30 % of the drive's RMS on each joint,
added to what the log holds. Asked of the instruments: a bias of k1 and k3 of 1 % at most where the
log tells it, the error of the mean over the draws being below `TOLD` %. All draws are integrated
side by side.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray, forward_dynamics
from algid.estimators import instruments, weak
from algid.estimators.weak import Source
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import HANGING
from pipelines.accuracy_scenes import random_arm

DT, DURATION = 1e-3, 10.0
SHARE, PERSISTENCE = 0.3, 0.05  # of the drive's RMS; s
SIGMA = 1e-4  # rad; ten times as much in N m
TOLD = 1.0  # %: a bias is judged where the mean of the draws is known so well


def logs(arm: Arm, draws: int, seed: int, share: float = SHARE) -> list[Segment]:
    """Logs of the arm under one drive and as many disturbances as draws."""
    rng = np.random.default_rng(seed)
    count = round(DURATION / DT)
    drive = wide_multi_sine(arm, seed)(DT * np.arange(2 * count + 1) / 2)[:, :, None]
    size = share * np.sqrt(np.mean(drive**2, axis=(1, 2)))
    keep = np.exp(-DT / PERSISTENCE)
    state = np.concatenate([HANGING, np.zeros(2)])[:, None] * np.ones(draws)
    push = size[:, None] * rng.standard_normal((2, draws))
    theta = np.empty((2, count, draws))
    k = arm.constants()

    def rate(x: FloatArray, tau: FloatArray) -> FloatArray:
        return np.concatenate([x[2:], forward_dynamics(k, x[:2], x[2:], tau)])

    for step in range(count):
        theta[:, step] = state[:2]
        after = keep * push + size[:, None] * np.sqrt(1 - keep**2) * rng.standard_normal((2, draws))
        start, end = drive[:, 2 * step] + push, drive[:, 2 * step + 2] + after
        middle = drive[:, 2 * step + 1] + (push + after) / 2
        a = rate(state, start)
        b = rate(state + DT / 2 * a, middle)
        c = rate(state + DT / 2 * b, middle)
        state = state + DT / 6 * (a + 2 * b + 2 * c + rate(state + DT * c, end))
        push = after
    noise = SIGMA * rng.standard_normal((2, 2, count, draws))
    angles, torques = theta + noise[0], drive[:, ::2][:, :count] + 10 * noise[1]
    return [Segment(0.0, DT, angles[:, :, draw], torques[:, :, draw]) for draw in range(draws)]


def _source(log: Segment) -> Source:
    def once() -> Iterable[Segment]:
        return [log]

    return once


def evaluate(draws: int, arms: int = 3) -> list[dict[str, Any]]:
    """Bias in % and coverage of each estimator, by arm.

    The mean statistic of Durbin, Wu and Hausman.
    """
    rows: list[dict[str, Any]] = []
    for number in range(arms):
        name, arm = (
            ("case1", load_case("case1").arm)
            if number == 0
            else (f"arm{number}", random_arm(number)[0])
        )
        sources = [_source(log) for log in logs(arm, draws, 20 + number)]
        k = arm.constants()
        starts = [weak.fit([source]) for source in sources]
        fits = {
            "weak": starts,
            "instruments": [
                instruments.fit([s], start=f) for s, f in zip(sources, starts, strict=True)
            ],
        }
        for estimator, found in fits.items():
            errors = np.array([fit.values for fit in found]) - k
            std = np.array([fit.std * fit.quantile for fit in found])
            bias = 100 * errors.mean(axis=0) / k
            own = 100 * errors.std(axis=0, ddof=1) / np.sqrt(draws) / k
            for place in (0, 2, 3, 4):
                what = (
                    f"{name}, {estimator}: bias of {CONSTANT_NAMES[place]} (± {own[place]:.2g}), %"
                )
                asked = (
                    1.0
                    if estimator == "instruments" and place in (0, 2) and own[place] < TOLD
                    else None
                )
                rows.append({"what": what, "value": float(bias[place]), "asked": asked})
            rows.append(
                {
                    "what": f"{name}, {estimator}: coverage, %",
                    "value": float(100 * np.mean(np.abs(errors) <= std)),
                    "asked": None,
                }
            )
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=32)
    for row in evaluate(parser.parse_args().draws):
        print(f"{row['what']}: {row['value']:.3g}")


if __name__ == "__main__":
    main()
