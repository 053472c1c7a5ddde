"""Whether intervals hold where joints are elastic: `python -m pipelines.elastic`.

Arms whose motors turn the links by springs (Spong 1987), simulated by a road of their own:

    B θ̈ + friction(θ̇) + p = τ,   p = K (θ − q) + D (θ̇ − q̇),   M(q) q̈ + n(q, q̇) = p

Angles are logged at the motors. Each arm is identified with no flag from one log and from four, of
a torque in open loop and of a digital PD controller. "held" are the 95 % intervals of k1 … k5 that
hold the truth, of results with exit code 0 or 3 and of those with 0 alone; "far" is the largest
distance of one of the latter in standard deviations, "found" how often elastic joints were chosen,
and "k_e held" the intervals of their stiffness. `--rigid` arms have stiff joints; none is to be
chosen. In full: `--arms 10 --rigid 200`.

======  =======================================================  ==============
symbol  name                                                     shape
======  =======================================================  ==============
S       motions that are integrated side by side                 scalar
x       angles and velocities of motors, then of links           (8, S)
B       rotors' inertia, a share in `ROTOR` of the links'        (2, S) kg m^2
K       stiffness, by the link's frequency against its motor     (2, S) N m/rad
======  =======================================================  ==============
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.identification.identify import identify
from algid.log import Log, Origin, Reading
from pipelines.accuracy_scenes import random_arm
from pipelines.race_scenes import DURATION, RATE, SIGMA_TAU, SIGMA_THETA, sines, swung

SUBSTEPS = 6
SPEEDS = (30.0, 55.0, 80.0)  # rad/s, of a link against its motor
DRIVES = ("open loop", "digital PD")
ROTOR = (0.05, 0.2)
DAMPING = 0.0  # of the critical one, by a link's inertia
COULOMB, WIDTH = 0.05, 0.05  # of the drive's RMS; rad/s
TRACKED = 12.0  # rad/s, of the controller


@dataclass(frozen=True)
class Scene:
    """An arm and a drive: rad/s of its joints, infinite if they are stiff, and the arm's seed."""

    speed: float
    drive: str
    seed: int


@dataclass(frozen=True, eq=False)
class Draw:
    """Logs of a scene with the truth: k1 … k5 (5,) as the logs show them, K and B (2,)."""

    scene: Scene
    truth: FloatArray
    stiffness: FloatArray
    rotor: FloatArray
    logs: tuple[Log, ...]


def draws(scenes: Sequence[Scene], runs: int) -> list[Draw]:
    """So many logs of each scene, all simulated side by side."""
    arms = [random_arm(100 + scene.seed)[0] for scene in scenes]
    k = np.stack([arm.constants() for arm in arms], axis=-1)
    shares = np.stack(
        [np.random.default_rng([7, scene.seed]).uniform(*ROTOR, 2) for scene in scenes], axis=-1
    )
    links = np.stack([k[4] + k[2], k[2]])
    speed = np.array([scene.speed for scene in scenes])
    K = np.where(np.isfinite(speed), np.where(np.isfinite(speed), speed, 0.0) ** 2 * links, np.inf)
    B = shares * links
    motions = [_moved(scenes, k, B, K, run) for run in range(runs)]
    found = []
    for place, scene in enumerate(scenes):
        truth = k[:5, place].copy()
        truth[4] += B[0, place]
        logs = [_logged(*motion, place, run, scene) for run, motion in enumerate(motions)]
        found.append(Draw(scene, truth, K[:, place], B[:, place], tuple(logs)))
    return found


def _moved(
    scenes: Sequence[Scene], k: FloatArray, B: FloatArray, K: FloatArray, run: int
) -> tuple[FloatArray, FloatArray]:
    """Motors' angles and torques (N, 2, S) of one run."""
    n = round(DURATION * RATE)
    fine = np.arange(2 * SUBSTEPS * n + 1) / (2 * SUBSTEPS * RATE)
    seeds = [1000 * scene.seed + run for scene in scenes]
    tau = np.stack([sines(k[:, s], seed, fine) for s, seed in enumerate(seeds)], axis=-1)
    first = np.stack([sines(k[:, s], 1000 * one.seed, fine) for s, one in enumerate(scenes)], -1)
    coulomb = COULOMB * np.sqrt(np.mean(first**2, axis=1))  # runs of an arm rub alike
    held = np.array([scene.drive == "digital PD" for scene in scenes])
    drawn = [np.random.default_rng(seed + 50) for seed in seeds]
    push = np.stack([k[4] + k[2] + 2 * k[0], k[2]]) * TRACKED**2
    stiff = ~np.isfinite(K[0])
    spring = np.where(stiff, 0.0, K)
    damper = 2 * DAMPING * np.sqrt(spring * np.stack([k[4] + k[2], k[2]]))

    def rate(x: FloatArray, torque: FloatArray) -> FloatArray:
        m, m_dot, q, q_dot = x[:2], x[2:4], x[4:6], x[6:]
        k1, k2, k3, k4, k5 = k[:5]
        w1, w2 = q_dot
        c2, s2, c12 = np.cos(q[1]), np.sin(q[1]), np.cos(q[0] + q[1])
        m11, m12, m22 = k5 + k3 + 2 * k1 * c2, k3 + k1 * c2, k3
        net = torque - k[5:7] * m_dot - coulomb * np.tanh(m_dot / WIDTH)
        passed = np.where(stiff, net, spring * (m - q) + damper * (m_dot - q_dot))
        own = np.where(stiff, B, 0.0)
        b1 = passed[0] + k1 * s2 * (2 * w1 + w2) * w2 - k4 * np.cos(q[0]) - k2 * c12
        b2 = passed[1] - k1 * s2 * w1**2 - k2 * c12
        m11, m22 = m11 + own[0], m22 + own[1]
        det = m11 * m22 - m12**2
        link = np.stack([m22 * b1 - m12 * b2, m11 * b2 - m12 * b1]) / det
        motor = np.where(stiff, link, (net - passed) / B)
        return np.concatenate([m_dot, motor, q_dot, link])

    x = np.zeros((8, len(scenes)))
    x[0] = x[4] = -np.pi / 2
    gains = push, 1.4 / TRACKED * push
    states, torques = swung(rate, x, tau, held, gains, drawn, SUBSTEPS)
    return states[:, :2], torques


def _logged(angles: FloatArray, torques: FloatArray, place: int, run: int, scene: Scene) -> Log:
    kind = DRIVES.index(scene.drive)
    rng = np.random.default_rng([scene.seed, run, kind, int(min(scene.speed, 1000.0))])
    theta, tau = angles[:, :, place].T, torques[:, :, place].T
    theta = theta + SIGMA_THETA * rng.standard_normal(theta.shape)
    tau = tau + SIGMA_TAU * rng.standard_normal(tau.shape)
    stamps = np.round(np.arange(tau.shape[1]) / RATE * 1e9).astype(np.int64)
    origin = Origin(f"{scene.drive}-{scene.seed}-{run}.csv", "csv", {}, reading=Reading())
    return Log(stamps, theta, tau, origin)


def judged(job: tuple[Draw, int]) -> Counter[str]:
    """What became of a draw's first logs; of `far`, the distance in tenths of a deviation."""
    draw, count = job
    result = identify(list(draw.logs[:count]), report=False)
    names = [f"k{number + 1}" for number in range(5)]
    seen = [(result.parameters[name], true) for name, true in zip(names, draw.truth, strict=True)]
    usable = result.complete and result.verdict.grade != "failed"
    total = Counter(draws=1, usable=usable)
    for one, true in seen:
        if one.usable and one.estimate is not None and one.std and one.half is not None:
            held = abs(one.estimate - true) <= one.half
            total.update(told=1, held=held)
            if usable:
                total.update({"told usable": 1, "held usable": held})
                far = round(10 * abs(one.estimate - true) / one.std)
                total["far"] = max(total["far"], far)
    stiffness = result.fit.stiffness if result.fit else {}
    total["found"] = bool(stiffness)
    for one, true in zip(stiffness.values(), draw.stiffness, strict=False):
        low, high = one.ci95 or (None, None)
        if low is not None and high is not None:
            total.update({"told k_e": 1, "held k_e": low <= true <= high})
    return total


def _row(words: Sequence[object], jobs: Sequence[Counter[str]]) -> str:
    far, total = 0, Counter[str]()
    for one in jobs:
        far = max(far, one.pop("far", 0))
        total.update(one)

    def share(kind: str) -> str:
        held, told = total[f"held{kind}"], total[f"told{kind}"]
        return f"{held}/{told}" + (f" = {100 * held / told:.0f} %" if told else "")

    cells = [*words, total["draws"], total["found"], share(""), total["usable"]]
    cells += [share(" usable"), f"{far / 10:.1f}", share(" k_e")]
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", type=int, default=2, help="of each stiffness and drive")
    parser.add_argument("--first", type=int, default=0, help="seed of the first arm")
    parser.add_argument("--rigid", type=int, default=4, help="draws of stiff arms")
    parser.add_argument("--speed", type=float, action="append", help="rad/s, in place of all")
    parser.add_argument("--processes", type=int, default=1, choices=(1, 2))
    given = parser.parse_args()
    print(
        "| joints, rad/s | drive | logs | draws | found | held | exit 0 | held | far | k_e held |"
    )
    print("|" + 10 * "---|", flush=True)
    every = given.speed or SPEEDS
    with ProcessPoolExecutor(given.processes) as pool:
        seeds = range(given.first, given.first + given.arms)
        for drive in DRIVES:
            for speed in every:
                made = draws([Scene(speed, drive, seed) for seed in seeds], 4)
                for count in (1, 4):
                    jobs = [(draw, count) for draw in made]
                    print(_row((speed, drive, count), list(pool.map(judged, jobs))), flush=True)
            seeds_of_stiff = range(1000, 1000 + given.rigid // 2)
            stiff = [Scene(np.inf, drive, seed) for seed in seeds_of_stiff]
            if stiff:
                made = draws(stiff, 1)
                jobs = [(draw, 1) for draw in made]
                print(_row(("stiff", drive, 1), list(pool.map(judged, jobs))), flush=True)


if __name__ == "__main__":
    main()
