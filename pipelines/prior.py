"""What a prior from CAD does to estimates and their intervals: `make prior`.

Arms drawn at random are identified from logs that excite them well, whose torque is half noise,
that hold joint 2 still and that rest; with an unlogged torque, so that the likelihood is refuted,
too. Their CAD is exact, errs by 20 % as it says (normal, each mass, centre and inertia by itself),
has every number 20 % off to a random side, or is wrong (masses a third or thrice) and says 20 % all
the same. A row gives the share of 95 % intervals of k1 … k5 that hold the truth, of those that are
measured and that are from the prior; how many of all are either; how wide measured ones are beside
those without a prior (median); how many priors are contradicted; how many results claim to be
complete.
Writes `prior.md` into the output folder.
"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray, inverse_dynamics
from algid.identification.identify import identify
from algid.log import Log, Origin, Reading
from algid.results import Result
from algid.settings import Settings
from algid.synth.excitation import SampledTorque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, simulate, steered
from pipelines.accuracy_scenes import random_arm
from pipelines.experiment import experiment

RATE, DURATION = 200.0, 4.0
SIGMA_THETA = 3e-4  # rad
NOISE, FAINT = 0.02, 0.5  # of the torque's RMS
ERROR = 20.0  # per cent, as every CAD says of itself
MOTIONS = ("rich", "faint", "joint 2 still", "rest", "rich, refuted")
CADS = ("none", "exact", "errs by 20 %", "20 % off", "wrong")
DRAWN = ("m1", "m2", "lc1", "lc2", "I1", "I2")
RIGID = CONSTANT_NAMES[:5]
PULL = 0.05  # of the torque's RMS: an unlogged torque that refutes the likelihood


def log_of(arm: Arm, motion: str, seed: int) -> Log:
    """One draw of a log."""
    rng = np.random.default_rng([seed, MOTIONS.index(motion)])
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    k = arm.constants()
    wide = wide_multi_sine(arm, seed)
    theta: FloatArray
    tau: FloatArray
    if motion == "rest":  # held in a posture
        theta = np.broadcast_to(rng.uniform(-2, 2, (2, 1)), (2, t.size))
        weight = k[1] * np.cos(theta[0] + theta[1])
        tau = np.stack([k[3] * np.cos(theta[0]) + weight, weight])
    elif motion == "joint 2 still":  # its lock bears what it must
        theta, tau = _locked(arm, t, rng)
    elif motion == "rich, refuted":
        theta, tau = _pulled(arm, wide(t), t, rng)
    else:
        moved = simulate(k, wide, t)
        theta, tau = moved.theta, moved.tau
    size = np.sqrt(np.mean(tau**2, axis=1, keepdims=True))
    noise = FAINT if motion == "faint" else NOISE
    theta = theta + SIGMA_THETA * rng.standard_normal(theta.shape)
    tau = tau + noise * size * rng.standard_normal(tau.shape)
    origin = Origin(f"arm{seed}.csv", "csv", {}, reading=Reading(accepted=("DEGREES",)))
    return Log(np.round(t * 1e9).astype(np.int64), theta, tau, origin)


def _locked(arm: Arm, t: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Angles and torques (2, N) of an arm whose second joint is held."""
    phase, size = rng.uniform(0, 6, 3), np.array([0.5, 0.3, 0.2])
    pulse = 2 * np.pi * np.array([0.4, 0.9, 1.7])
    angle = np.zeros((3, 2, t.size))
    angle[0, 1] = rng.uniform(-1, 1)
    for p, a, w in zip(phase, size, pulse, strict=True):
        angle[0, 0] += a * np.sin(w * t + p)
        angle[1, 0] += a * w * np.cos(w * t + p)
        angle[2, 0] -= a * w**2 * np.sin(w * t + p)
    return angle[0], inverse_dynamics(arm.constants(), *angle)


def _pulled(
    arm: Arm, torque: FloatArray, t: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Angles and logged torques (2, N) of an arm that an unlogged slow torque pulls at, too."""
    kernel = np.hanning(round(0.3 * RATE))
    white = rng.standard_normal((2, t.size + kernel.size - 1))
    slow = np.array([np.convolve(one, kernel, "valid") for one in white])
    slow *= PULL * np.sqrt(np.mean(torque**2, axis=1, keepdims=True)) / slow.std()
    acting = SampledTorque(t, torque + slow, "foh")

    def controller(times: FloatArray) -> Driven:
        driven = acting(times)
        return lambda _theta, _omega: driven

    return steered(arm.constants(), controller, t, HANGING, corners=t).theta, torque


def drawing(arm: Arm, cad: str, seed: int) -> Arm:
    """The arm as its CAD has it."""
    rng = np.random.default_rng([seed, 7])
    share = dict.fromkeys(DRAWN, 1.0)
    for name in DRAWN:
        if cad == "errs by 20 %":
            share[name] += ERROR / 100 * rng.standard_normal()
        elif cad == "20 % off":
            share[name] += ERROR / 100 * rng.choice((-1, 1))
    if cad == "wrong":
        for link in "12":
            factor = float(rng.choice((1 / 3, 3.0)))
            share[f"m{link}"] = share[f"I{link}"] = factor
    wrong = {name: getattr(arm, name) * max(factor, 0.1) for name, factor in share.items()}
    return replace(arm, **wrong)


def urdf(arm: Arm) -> str:
    """The arm as a URDF file has it."""

    def link(number: int) -> str:
        m, lc, inertia = (float(getattr(arm, f"{what}{number}")) for what in ("m", "lc", "I"))
        return (
            f'<link name="link{number}"><inertial><origin xyz="{lc!r} 0 0"/><mass value="{m!r}"/>'
            f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" '
            'iyz="0"/></inertial></link>'
        )

    def joint(kind: str, parent: str, child: str, place: str) -> str:
        return (
            f'<joint name="to_{child}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin {place}/><axis xyz="0 0 1"/></joint>'
        )

    return (
        f'<robot name="arm"><link name="base"/>{link(1)}{link(2)}<link name="tip"/>'
        + joint("continuous", "base", "link1", 'rpy="1.5707963267948966 0 0"')
        + joint("continuous", "link1", "link2", f'xyz="{float(arm.l1)!r} 0 0"')
        + joint("fixed", "link2", "tip", f'xyz="{float(arm.l2)!r} 0 0"')
        + "</robot>"
    )


def judged(job: tuple[str, int, str]) -> dict[str, tuple[Counter[str], list[float]]]:
    """What became of one arm with each CAD, and the widths beside those without one."""
    motion, seed, estimator = job
    arm, _ = random_arm(seed)
    true = dict(zip(RIGID, arm.constants().tolist(), strict=False))
    log, found = log_of(arm, motion, seed), {}
    alone: Result | None = None
    with tempfile.TemporaryDirectory() as folder:
        for cad in CADS:
            settings = Settings(estimator=estimator)
            if cad != "none":
                file = Path(folder) / f"{cad[:2]}.urdf"
                file.write_text(urdf(drawing(arm, cad, seed)), encoding="utf-8")
                settings = settings.but(prior=str(file), prior_error=ERROR)
            result = identify(log, settings=settings, report=False)
            counts, widths = Counter(draws=1, complete=result.complete), list[float]()
            counts["refuted"] = any(one.code == "REFUTED" for one in result.notices)
            counts["contradicted"] = any(one.code == "OTHER_ARM" for one in result.notices)
            for name, value in true.items():
                one = result.parameters[name]
                low, high = one.ci95 or (None, None)
                if low is None or high is None or not one.usable:
                    continue
                whose = "measured" if one.measured else "prior"
                counts[whose] += 1
                counts[f"held {whose}"] += low <= value <= high
                other = None if alone is None else alone.parameters[name]
                if one.measured and other is not None and other.half and one.half:
                    widths.append(one.half / other.half)
            if cad == "none":
                alone = result
            found[cad] = counts, widths
    return found


def lines(draws: int, pool: ProcessPoolExecutor) -> Iterator[str]:
    """The table, row by row."""
    yield (
        "| motion, estimator | CAD | draws | refuted | measured: hold | of all | prior: hold | "
        "of all | width | contradicted | complete |"
    )
    yield f"|{'---|' * 11}"
    for motion in MOTIONS:
        for estimator in ("refined", "weak"):
            if motion.endswith("refuted") and estimator == "weak":
                continue
            jobs = [(motion, seed, estimator) for seed in range(draws)]
            total = {cad: Counter[str]() for cad in CADS}
            widths = {cad: list[float]() for cad in CADS}
            for found in pool.map(judged, jobs):
                for cad, (counts, of_cad) in found.items():
                    total[cad].update(counts)
                    widths[cad] += of_cad
            for cad in CADS:
                cells = total[cad]
                width = f"{np.median(widths[cad]):.2f}" if widths[cad] else ""
                held = []
                for whose in ("measured", "prior"):
                    share = 100 * cells[f"held {whose}"] / max(1, cells[whose])
                    held += [f"{share:.1f} %" if cells[whose] else "", str(cells[whose])]
                yield (
                    f"| {motion}, {estimator} | {cad} | {cells['draws']} | {cells['refuted']} | "
                    f"{' | '.join(held)} | {width} | {cells['contradicted']} | "
                    f"{cells['complete']} |"
                )


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    experiment("prior", __doc__, lines, 10, "of each motion and estimator")
