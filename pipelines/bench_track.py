"""Count changes of payload found, false ones, and intervals that hold the truth, on draws of case
1's arm.

Usage: python -m pipelines.bench_track [--draws 300] [--hard 100]

Logs of 1 kHz with noise of 1e-3 rad and 1e-2 N m. Each draw has noise of its own and, where the
constants are identified, an identification of its own: 5 s without payload, 5 s with 0.3515 kg.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise

import numpy as np

from algid.arm import FloatArray
from algid.estimators.whitening import NoiseLevels
from algid.identification.identify import identify
from algid.log import Log
from algid.model import Model
from algid.settings import Settings
from algid.signals.segments import segments
from algid.synth.cases import load_case
from algid.synth.run import Recording, excitation, synthesise, with_schedule
from algid.synth.simulator import simulate
from algid.tracks.bins import IdentifiedArm, arm_of
from algid.tracks.payload import Track, track

CASE = load_case("case1")
DRIVE = excitation(CASE, "wide")
SIGMA_THETA, SIGMA_TAU = 1e-3, 1e-2
NEAR = 0.5  # s: a change found farther from a true one is a false one
DURATION = 4.5  # s
# N m, Coulomb; gravity asks up to 0.47 and 0.05 of the bare arm
FRICTION = np.array([[0.05], [0.02]])
Schedule = tuple[tuple[float, float], ...]

FIFTY: tuple[Schedule, ...] = (
    ((1.5, 0.05), (3.0, 0.0)),
    ((0.83, 0.35), (2.11, 0.30), (3.37, 0.35)),
    ((1.27, 0.10), (2.63, 0.05)),
)
TEN: tuple[Schedule, ...] = (((1.5, 0.01), (3.0, 0.0)), ((0.83, 0.35), (2.11, 0.34), (3.37, 0.35)))
QUICK: tuple[Schedule, ...] = (
    ((1.2, 0.05), (1.9, 0.0), (2.5, 0.05)),
    ((1.3, 0.05), (1.7, 0.02), (2.3, 0.07)),
)


@dataclass(frozen=True)
class Scene:
    """What is drawn: schedules in turn, how the arm is known, friction in the arm, an encoder
    instead of noise.
    """

    name: str
    schedules: tuple[Schedule, ...]
    identified: bool
    friction: bool = False
    modelled: bool = False
    encoder: int | None = None


SCENES = (
    Scene("50 g, constants known", FIFTY, identified=False),
    Scene("50 g, constants identified", FIFTY, identified=True),
)
HARD = (
    Scene("10 g", TEN, identified=True),
    Scene("three stretches within 2 s, 30 to 50 g", QUICK, identified=True),
    Scene("12-bit encoders instead of noise", FIFTY, identified=True, encoder=12),
    Scene("Coulomb friction, in the model", FIFTY, identified=True, friction=True, modelled=True),
    Scene("Coulomb friction, not in the model", FIFTY, identified=True, friction=True),
)


@dataclass
class Tally:
    """Delays (s) of the changes found, changes missed, false ones, and whether each stretch's
    interval held.
    """

    draws: int = 0
    delays: list[float] = field(default_factory=list)
    missed: int = 0
    false: int = 0
    inside: list[list[bool]] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

    def add(self, found: Track, schedule: Schedule) -> None:
        """Count one draw."""
        self.draws += 1
        left = [stretch.start for stretch in found.stretches[1:]]
        for moment, _ in schedule:
            nearest = min(left, key=lambda at: abs(at - moment), default=np.inf)
            if abs(nearest - moment) > NEAR:
                self.missed += 1
                continue
            left.remove(nearest)
            self.delays.append(abs(nearest - moment))
        self.false += len(left)
        edges = [0.0, *(moment for moment, _ in schedule), DURATION]
        for place, ((start, end), mass) in enumerate(
            zip(pairwise(edges), [0.0, *(mass for _, mass in schedule)], strict=True)
        ):
            own = next(s for s in found.stretches if s.end > (start + end) / 2)
            if place == len(self.inside):
                self.inside.append([])
            self.inside[place].append(own.ci95[0] < mass < own.ci95[1])
            self.widths.append(own.ci95[1] - own.m_p)


@cache
def picking(schedule: Schedule) -> Log:
    """The log of a schedule without noise."""
    return with_schedule(CASE, DRIVE, Recording(duration=DURATION), schedule)


@cache
def calibration() -> tuple[Log, Log]:
    """The logs without noise that constants are identified from."""
    return synthesise(CASE, DRIVE, Recording(duration=5.0))


def drawn(log: Log, scene: Scene, rng: np.random.Generator) -> Log:
    """The log as the scene's sensors see it."""
    tau = log.tau + SIGMA_TAU * rng.standard_normal(log.tau.shape)
    if scene.friction:
        assert log.omega is not None
        # the torque that an arm with friction needs for that motion
        tau = tau + FRICTION * np.tanh(log.omega / 0.2)
    if scene.encoder is None:
        theta = log.theta + SIGMA_THETA * rng.standard_normal(log.theta.shape)
    else:
        step = 2 * np.pi / 2**scene.encoder
        theta = step * np.round(log.theta / step)
    return replace(log, theta=theta, tau=tau, omega=None)


def arm_for(scene: Scene, log: Log, rng: np.random.Generator) -> tuple[IdentifiedArm, FloatArray]:
    """The arm as the scene knows it, and the covariance of what it knows."""
    if not scene.identified:
        noise = NoiseLevels(np.full(2, SIGMA_THETA), np.full(2, SIGMA_TAU))
        return IdentifiedArm(
            Model(), CASE.arm.constants(), CASE.arm.l1, CASE.arm.l2, noise
        ), np.zeros((9, 9))
    settings = Settings(model="coulomb") if scene.modelled else Settings()
    bare, burdened = (drawn(one, scene, rng) for one in calibration())
    result = identify(bare, burdened, settings, report=False)
    return arm_of(result, next(segments([log])))


def run(scene: Scene, draws: int) -> Tally:
    """Draw and count."""
    tally = Tally()
    for draw in range(draws):
        rng = np.random.default_rng([draw, 7])
        schedule = scene.schedules[draw % len(scene.schedules)]
        log = drawn(picking(schedule), scene, rng)
        arm, covariance = arm_for(scene, log, rng)
        found = track(lambda log=log: segments([log]), arm, covariance)  # type: ignore[misc]
        tally.add(found, schedule)
    return tally


def rows(scene: Scene, tally: Tally, asked: bool) -> list[str]:
    """Lines of the Markdown table."""
    delays = np.array(tally.delays or [np.nan])
    shares = ", ".join(f"{100 * np.mean(one):.1f}" for one in tally.inside)
    overall = 100 * np.mean([one for part in tally.inside for one in part])
    found = f"worst {delays.max():.3f} s, 95th percentile {np.percentile(delays, 95):.3f} s"
    missed = f"{tally.missed} of {len(tally.delays) + tally.missed} missed"
    held = f"{shares} %; all {overall:.1f} %; median ± {1e3 * np.median(tally.widths):.2f} g"
    within, share = ("0.5 s", "92 to 98 %") if asked else ("", "")
    return [
        f"| {scene.name}: changes found within | {within} | {found}; {missed} |",
        f"| {scene.name}: false changes a log | | {tally.false / tally.draws:.3f} |",
        f"| {scene.name}: 95 % intervals that hold the mass, by stretch | {share} | {held} |",
    ]


def rate() -> str:
    """How fast an hour is tracked."""
    arm = arm_for(SCENES[0], picking(FIFTY[0]), np.random.default_rng(0))
    t = np.arange(60_001) * 1e-3
    motion = simulate(CASE.arm.constants(), DRIVE, t)
    minute = replace(
        picking(FIFTY[0]),
        stamp_ns=np.arange(t.size) * 1_000_000,
        theta=motion.theta,
        tau=motion.tau,
        omega=None,
    )
    log = drawn(minute, SCENES[0], np.random.default_rng(1))
    start = time.perf_counter()
    track(lambda: segments([log]), *arm)
    return f"| a minute at 1 kHz, constant payload | | {time.perf_counter() - start:.2f} s |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a Markdown table of figures asked for and measured."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--draws", type=int, default=300, help="of each scene that figures are asked of"
    )
    parser.add_argument("--hard", type=int, default=100, help="of each harder scene")
    wanted = parser.parse_args(arguments)
    print("| what | asked | measured |\n|---|---|---|")
    for scenes, draws in ((SCENES, wanted.draws), (HARD, wanted.hard)):
        for scene in scenes if draws else ():
            print("\n".join(rows(scene, run(scene, draws), asked=scenes is SCENES)), flush=True)
    print(rate())


if __name__ == "__main__":
    main()
