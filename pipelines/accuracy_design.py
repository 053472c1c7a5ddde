"""Whether a design's error bars come true behind a digital controller: design, follow, identify.

    python -m pipelines.accuracy_design [--draws 12] [--scenes hold,noise]

A PD controller at 1 kHz holds its torque from sample to sample; the arm has Coulomb friction of 5
% of its weight's torque; the encoders' noise is fed back. Each scene is identified without flags.
Asked: errors over predicted deviations of an RMS of 0.9 to 1.15 and intervals that hold the truth
in 92 to 98 %.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from algid.arm import Arm, FloatArray
from algid.designs.belief import Belief, asked_for
from algid.designs.campaign import Campaign, Design, plan
from algid.designs.information import Experiment
from algid.designs.limits import Limits
from algid.designs.prior import KnownBefore, of_case
from algid.estimators.whitening import NoiseLevels
from algid.identification.identify import identify
from algid.log import Log
from algid.settings import Settings
from algid.synth.cases import Case
from pipelines.accuracy_scenes import case_of
from pipelines.controlled import Controller, Motions, Plan, controlled

RATE, DURATION = 1000.0, 10.0
NOISE = NoiseLevels(np.full(2, 1e-3), np.full(2, 1e-2))
HANGING = np.array([-np.pi / 2, 0.0])
STIFFNESS = 2 * np.pi * 4.0  # rad/s, the controller's bandwidth


@dataclass(frozen=True)
class Scene:
    """What the controller and the arm have that the design does not know."""

    name: str
    digital: bool = True
    coulomb: float = 0.0
    fed_back: bool = False
    settings: Mapping[str, Any] = field(default_factory=dict)


SCENES = {
    "ideal": Scene("continuous", digital=False),
    "hold": Scene("torque held for a sample"),
    "coulomb": Scene("held, Coulomb 5 %", coulomb=0.05),
    "noise": Scene("held, encoder noise fed back", fed_back=True),
    "both": Scene("held, Coulomb 5 %, noise fed back", coulomb=0.05, fed_back=True),
}


def designed(case: Case, coulomb: float) -> Design:
    """The motion of 10 s within ± 1.2 rad, 3 rad/s and twice the weight's torque.

    Friction of `coulomb` times the weight's torque is believed in, as after a first identification.
    """
    k = case.constants(case.payload)
    weight = np.array([k[3] + k[1], k[1]])
    limits = Limits(
        low=HANGING - 1.2,
        high=HANGING + 1.2,
        speed=np.full(2, 3.0),
        acceleration=np.full(2, np.inf),
        torque=2 * weight,
        height=-np.inf,
        lengths=np.array([case.arm.l1, case.arm.l2]),
    )
    belief = of_case(case, case.name, True, KnownBefore()).belief
    if coulomb:
        belief = with_friction(belief, coulomb * weight_of(case))
    experiment = Experiment(belief.shared, (1, 1), NOISE, RATE)
    asked = asked_for(belief, None, case.name)
    return plan(Campaign(experiment, belief, limits, asked, DURATION))


def weight_of(case: Case) -> FloatArray:
    """Torques (2,) that hold the bare arm level."""
    k = case.arm.constants()
    return np.array([k[3] + k[1], k[1]])


def with_friction(belief: Belief, size: FloatArray) -> Belief:
    """The belief with Coulomb friction of `size` (2,), which is as it is believed to be."""
    model = replace(belief.shared.model, terms=("coulomb",))
    shared = replace(belief.shared, model=model)
    places = [shared.names.index(name) for name in belief.shared.names]
    mean, spread = (
        np.zeros(len(shared.names)),
        np.zeros((len(shared.names), belief.spread.shape[1])),
    )
    mean[places], spread[places] = belief.mean, belief.spread
    mean[[shared.names.index(name) for name in ("f1", "f2")]] = size
    return Belief(shared, mean, spread, belief.box)


def plan_of(design: Design, loaded: bool) -> Plan:
    """The design as a controller reads it, half samples between by cubics."""
    from scipy.interpolate import make_interp_spline

    motion = design.motion
    signals = np.concatenate([motion.theta, motion.omega, design.torque[loaded]])
    fine = np.arange(2 * design.t.size - 1) / (2 * RATE)
    at = make_interp_spline(design.t, signals.T, k=5)(fine).T
    return Plan(at[:2], at[2:4], at[4:])


def followed(
    scene: Scene, arm: Arm, design: Design, payload: float, draws: int, rng: np.random.Generator
) -> Motions:
    """The motions of all draws."""
    k = arm.constants()
    inertia = np.array([k[4] + k[2] + 2 * k[0], k[2]])
    controller = Controller(
        np.diag(inertia * STIFFNESS**2),
        np.diag(2 * 0.7 * inertia * STIFFNESS),
        scene.digital,
        NOISE.theta if scene.fed_back else 0.0,
    )
    masses = np.full((design.t.size, draws), payload)
    weight = np.array([k[3] + k[1], k[1]])
    friction = scene.coulomb * weight[:, None]
    return controlled(arm, plan_of(design, bool(payload)), controller, masses, friction, RATE, rng)


def logged(scene: Scene, motions: Motions, draw: int, rng: np.random.Generator) -> Log:
    """What sensors log: the angles that the controller saw, where it saw their noise."""
    theta, tau = motions.theta[:, :, draw], motions.tau[:, :, draw]
    seen = (
        motions.seen[:, :, draw]
        if scene.fed_back
        else theta + NOISE.theta[:, None] * rng.standard_normal(theta.shape)
    )
    return Log.from_arrays(
        motions.t, seen, tau + NOISE.tau[:, None] * rng.standard_normal(tau.shape)
    )


@dataclass
class Errors:
    """Errors over predicted and over reported deviations (D, Q), and which intervals
    hold (D, Q).
    """

    names: tuple[str, ...]
    predicted: FloatArray
    reported: FloatArray
    held: FloatArray


def run(scene: Scene, case: Case, design: Design, draws: int, seed: int, verbose: bool) -> Errors:
    """Identify each draw and set its errors over what was predicted and reported."""
    arm, rng = case.arm, np.random.default_rng(seed)
    both = [followed(scene, arm, design, mass, draws, rng) for mass in (0.0, case.payload)]
    names = design.names
    plain = [f"k{place}" for place in range(1, 8)]
    truth = dict(zip(plain, arm.constants(), strict=True))
    truth |= {"m_p": case.payload, "l1": arm.l1, "l2": arm.l2}
    truth |= dict(zip(("f1", "f2"), scene.coulomb * weight_of(case), strict=True))
    predicted, reported, held = [], [], []
    for draw in range(draws):
        bare, loaded = (logged(scene, motions, draw, rng) for motions in both)
        result = identify(bare, loaded, Settings(**scene.settings), report=False)
        found = [result.estimates[name] for name in names]
        true = np.array([truth[name] for name in names])
        errors = np.array([one.estimate for one in found]) - true
        std = np.array([one.std for one in found])
        predicted.append(errors / design.std)
        reported.append(errors / std)
        low, high = np.array([one.ci95 for one in found]).T
        held.append((low <= true) & (true <= high))
        if verbose:
            over = np.round(reported[-1], 1), np.round(std / design.std, 2)
            print("  ", sorted(result.parameters), *over, result.verdict, flush=True)
    return Errors(names, np.array(predicted), np.array(reported), np.array(held))


def rms(z: FloatArray) -> float:
    return float(np.sqrt(np.mean(z**2)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=12)
    parser.add_argument("--arm", default="case1")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--hold", default=None, help="of the torque, as --torque-hold takes it")
    parser.add_argument("--verbose", action="store_true")
    wanted = parser.parse_args(arguments)
    case = case_of(wanted.arm)
    designs: dict[float, Design] = {}
    print("| scene | RMS over predicted (0.9 to 1.15) | over reported | coverage, % (92 to 98) |")
    print("|---|---|---|---|")
    for name in wanted.scenes.split(","):
        scene = SCENES[name]
        if wanted.hold:
            scene = replace(scene, settings={"torque_hold": wanted.hold})
        if scene.coulomb not in designs:
            designs[scene.coulomb] = designed(case, scene.coulomb)
        design = designs[scene.coulomb]
        found = run(scene, case, design, wanted.draws, 11, wanted.verbose)
        print(
            f"| {scene.name} | {rms(found.predicted):.2f} | {rms(found.reported):.2f} "
            f"| {100 * np.mean(found.held):.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
