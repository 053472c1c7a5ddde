"""What a prior from CAD does to estimates and their intervals: `make prior`.

Arms drawn at random are identified from logs that excite them well, whose torque is half noise,
that hold joint 2 still and that rest. Their CAD is exact, errs by 20 % as it says (normal, each
mass, centre and inertia by itself), has every number 20 % off to a random side, or is wrong (masses
a third or thrice) and says 20 % all the same. A row gives how many 95 % intervals of k1 … k5 hold
the truth, of those that are measured and that are from the prior; how wide measured ones are beside
those without a prior (median); how many priors are contradicted.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from algid.arm import Arm, FloatArray, inverse_dynamics
from algid.identification.identify import identify
from algid.log import Log
from algid.model import RIGID
from algid.results import Result
from algid.settings import Settings
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.accuracy_scenes import logged, random_arm, waves
from pipelines.experiment import Seen, count, experiment, grid, judged, number, share

RATE, DURATION = 200.0, 4.0
SIGMA_THETA = 3e-4  # rad
NOISE, FAINT = 0.02, 0.5  # of the torque's RMS
ERROR = 20.0  # per cent, as every CAD says of itself
MOTIONS = ("rich", "faint", "joint 2 still", "rest")
CADS = ("none", "exact", "errs by 20 %", "20 % off", "wrong")
DRAWN = ("m1", "m2", "lc1", "lc2", "I1", "I2")


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
    else:
        moved = simulate(k, wide, t)
        theta, tau = moved.theta, moved.tau
    size = np.sqrt(np.mean(tau**2, axis=1, keepdims=True))
    noise = FAINT if motion == "faint" else NOISE
    return logged(t, theta, tau, rng, (SIGMA_THETA, noise * size))


def _locked(arm: Arm, t: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Angles and torques (2, N) of an arm whose second joint is held."""
    phase, size = rng.uniform(0, 6, 3), np.array([0.5, 0.3, 0.2])
    motion = np.zeros((3, 2, t.size))
    motion[:, 0] = waves(t, np.array([0.4, 0.9, 1.7]), size, phase)
    motion[0, 1] = rng.uniform(-1, 1)
    return motion[0], inverse_dynamics(arm.constants(), *motion)


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
    links = ((1, arm.m1, arm.lc1, arm.I1), (2, arm.m2, arm.lc2, arm.I2))
    parts = [
        f'<link name="link{number:g}"><inertial><origin xyz="{lc!r} 0 0"/><mass value="{m!r}"/>'
        f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
        for number, m, lc, inertia in np.array(links).tolist()
    ]
    parts += [
        f'<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin {place}/><axis xyz="0 0 1"/></joint>'
        for kind, parent, child, place in (
            ("continuous", "base", "link1", 'rpy="1.5707963267948966 0 0"'),
            ("continuous", "link1", "link2", f'xyz="{float(arm.l1)!r} 0 0"'),
            ("fixed", "link2", "tip", f'xyz="{float(arm.l2)!r} 0 0"'),
        )
    ]
    return f'<robot name="arm"><link name="base"/>{"".join(parts)}<link name="tip"/></robot>'


def identified(log: Log, arm: Arm, estimator: str, cad: str, seed: int) -> Result:
    """The result with the prior of a CAD, or without one."""
    settings = Settings(estimator=estimator)
    if cad == "none":
        return identify(log, settings=settings, report=False)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arm.urdf"
        file.write_text(urdf(drawing(arm, cad, seed)), encoding="utf-8")
        settings = settings.but(prior=str(file), prior_error=ERROR)
        return identify(log, settings=settings, report=False)


def draw(motion: str, estimator: str, cad: str, seed: int, _draw: int) -> Seen:
    """What became of one arm, and how wide its intervals are beside those without a prior."""
    arm, _ = random_arm(seed)
    log = log_of(arm, motion, seed)
    result = identified(log, arm, estimator, cad, seed)
    seen = judged(result, dict(zip(RIGID, arm.constants(), strict=False)))
    alone = result if cad == "none" else identified(log, arm, estimator, "none", seed)
    for name in RIGID:
        one, other = result.parameters[name], alone.parameters[name]
        seen[f"held {'measured' if one.measured else 'prior'}"] += seen[f"held {name}"]
        if one.measured and other.usable and other.half and one.half:
            seen["width"].append(one.half / other.half)
    return seen


if __name__ == "__main__":
    rows = {", ".join(way): way for way in product(MOTIONS, ("refined", "weak"), CADS)}
    columns = {
        "draws": count("draw"),
        "measured: hold": share("held measured"),
        "prior: hold": share("held prior"),
        "width": number("width", np.median),
        "contradicted": count("OTHER_ARM"),
        "exit 0": count("exit 0"),
    }
    experiment("prior", __doc__, grid(rows, range(24)), draw, columns, draws=1)
