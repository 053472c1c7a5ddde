"""How well `algid track` finds changes of payload under a controller, and whether its intervals
hold the truth.

    python -m pipelines.accuracy_track [--scenes plain,rising] [--draws 1] [--seed 3]

Arms follow a slow multi-sine under a PD controller with the bare arm's weight fed forward, at 1
kHz. Each log has constants of its own, identified from 10 s without payload and 10 s with one,
under the same controller and friction. Each draw has a motion of its own, and each scene's noise is
its own, so that scenes do not repeat one another's luck. Asked: false and missed changes, medians
of errors in time, brackets that hold the true time, and masses inside their 95 % intervals.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from algid.api.identify import identify
from algid.arm import Arm, FloatArray
from algid.log import Log
from algid.settings import Settings
from algid.signals.segments import segments
from algid.synth.cases import load_case
from algid.tracks.bins import arm_of
from algid.tracks.payload import Track, track
from pipelines.controlled import Controller, Motions, Plan, controlled

RATE = 1000.0
LEARNT = 10.0  # s, of the logs that the arm is identified from
BANDWIDTH = 2 * np.pi * 4.0  # rad/s, of the controller
MIDDLE = np.array([-np.pi / 2, 0.3])  # rad, of the motion
NEAR = 0.5  # s: a change found farther from a true one is a false one
STRONG = Arm(4.0, 2.5, 0.2, 0.16, 0.4, 0.35, 0.055, 0.026, 0.4, 0.3)
Schedule = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Scene:
    """Logs of `changes` changes each, every `spacing` s.

    Friction is a share of the arm's weight's torque.
    """

    name: str
    spacing: float
    changes: int
    logs: int
    coulomb: float = 0.0
    rising: float = 0.0
    small: float = 0.1
    arm: str = "case1"
    false: float | None = None
    missed: float | None = None
    masses: bool = False
    brackets: bool = False


SCENES = {
    "plain": Scene("PD", 3.0, 5, 20, false=1, missed=1, masses=True, brackets=True),
    "coulomb": Scene(
        "PD, Coulomb 8 %", 3.0, 5, 20, coulomb=0.08, false=1, missed=1, masses=True, brackets=True
    ),
    "strong": Scene(
        "arm of 6.5 kg, Coulomb 8 %",
        3.0,
        5,
        20,
        coulomb=0.08,
        arm="strong",
        false=1,
        missed=1,
        masses=True,
        brackets=True,
    ),
    "rising": Scene(
        "PD, friction from 5 to 10 % during the log",
        3.0,
        5,
        20,
        coulomb=0.05,
        rising=0.05,
        false=1,
        missed=1,
        brackets=True,
    ),
    "every 2.4 s": Scene("a change each 2.4 s", 2.4, 15, 2, missed=0, false=0),
    "every 2.0 s": Scene("a change each 2.0 s", 2.0, 18, 2, missed=0, false=0),
    "every 1.6 s": Scene("a change each 1.6 s", 1.6, 22, 2, missed=0, false=0),
    "every 1.0 s": Scene("a change each 1.0 s", 1.0, 36, 2, missed=7),
}


def arm_named(name: str) -> tuple[Arm, FloatArray, FloatArray]:
    """The arm, and the noise of its angles (2,) in rad and torques (2,) in N m."""
    if name == "case1":
        return load_case("case1").arm, np.full(2, 1e-3), np.full(2, 1e-2)
    return STRONG, np.full(2, 1e-4), np.full(2, 2e-2)


def controller_of(arm: Arm) -> Controller:
    """A PD controller of 4 Hz."""
    k = arm.constants()
    inertia = np.array([k[4] + k[2] + 2 * k[0], k[2]])
    return Controller(np.diag(inertia * BANDWIDTH**2), np.diag(1.4 * inertia * BANDWIDTH))


def plan_of(arm: Arm, duration: float, seed: int) -> Plan:
    """Four sines of 0.2 to 1.5 Hz a joint, the bare arm's weight fed forward."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 1.5, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    w, size = 2 * np.pi * frequency[..., None], 0.35 / (1 + frequency[..., None])
    t = np.arange(2 * round(duration * RATE) + 1) / (2 * RATE)
    angle = w * t + phase[..., None]
    theta = MIDDLE[:, None] + np.sum(size * np.sin(angle), axis=1)
    k = arm.constants()
    second = k[1] * np.cos(theta[0] + theta[1])
    weight = np.stack([k[3] * np.cos(theta[0]) + second, second])
    return Plan(theta, np.sum(size * w * np.cos(angle), axis=1), weight)


def schedule_of(scene: Scene, arm: Arm, rng: np.random.Generator) -> Schedule:
    """Changes at random times about each `spacing`, by 0.1 to 0.5 of link 2's mass, never below
    nothing.
    """
    mass, found = 0.0, []
    for place in range(scene.changes):
        moment = scene.spacing * (place + 1 + 0.15 * rng.uniform(-1, 1))
        step = arm.m2 * rng.uniform(scene.small, 0.5)
        down = mass >= step and rng.random() < 0.6
        mass = mass - step if down else mass + step
        found.append((float(moment), float(mass)))
    return tuple(found)


def masses(schedules: Sequence[Schedule], duration: float) -> FloatArray:
    """Payload (N, B) from each sample on."""
    t = np.arange(round(duration * RATE) + 1) / RATE
    found = np.zeros((t.size, len(schedules)))
    for draw, schedule in enumerate(schedules):
        for moment, mass in schedule:
            found[t >= moment, draw] = mass
    return found


def friction(arm: Arm, start: float, rise: float, duration: float) -> FloatArray:
    """Coulomb friction (N, 2, 1) as a share of the weight's torque that rises during the log."""
    k = arm.constants()
    share = start + rise * np.linspace(0, 1, round(duration * RATE) + 1)
    return share[:, None, None] * np.array([k[3] + k[1], k[1]])[:, None]


def sensed(
    motions: Motions, draw: int, arm: tuple[Arm, FloatArray, FloatArray], rng: np.random.Generator
) -> Log:
    """A draw as its sensors log it."""
    _, theta, tau = arm
    angles, torques = motions.theta[:, :, draw], motions.tau[:, :, draw]
    return Log.from_arrays(
        motions.t,
        angles + theta[:, None] * rng.standard_normal(angles.shape),
        torques + tau[:, None] * rng.standard_normal(torques.shape),
    )


def draws(name: str, seed: int) -> Iterator[tuple[Schedule, float, Log, Log, Log]]:
    """Schedule, duration, tracked, bare and burdened log of each of a scene's logs."""
    scene = SCENES[name]
    made = arm_named(scene.arm)
    arm = made[0]
    rng = np.random.default_rng([seed, *name.encode()])
    schedules = [schedule_of(scene, arm, rng) for _ in range(scene.logs)]
    duration = scene.spacing * (scene.changes + 1)
    controller = controller_of(arm)
    tracked = controlled(
        arm,
        plan_of(arm, duration, seed),
        controller,
        masses(schedules, duration),
        friction(arm, scene.coulomb, scene.rising, duration),
        RATE,
        rng,
    )
    payload = np.array([0.0, 0.5 * arm.m2]) * np.ones((round(LEARNT * RATE) + 1, 1))
    first = controlled(
        arm,
        plan_of(arm, LEARNT, seed + 1),
        controller,
        payload,
        friction(arm, scene.coulomb, 0.0, LEARNT),
        RATE,
        rng,
    )
    for draw, schedule in enumerate(schedules):
        yield (
            schedule,
            duration,
            sensed(tracked, draw, made, rng),
            sensed(first, 0, made, rng),
            sensed(first, 1, made, rng),
        )


@dataclass
class Tally:
    """What was counted."""

    changes: int = 0
    missed: int = 0
    false: int = 0

    def __post_init__(self) -> None:
        self.late: list[float] = []
        self.held: list[bool] = []
        self.inside: list[bool] = []
        self.z: list[float] = []

    def add(self, found: Track, schedule: Schedule, duration: float) -> None:
        left = found.changes.tolist()
        self.changes += len(schedule)
        for moment, _ in schedule:
            nearest = min(left, key=lambda row: abs(row[0] - moment), default=None)
            if nearest is None or abs(nearest[0] - moment) > NEAR:
                self.missed += 1
                continue
            left.remove(nearest)
            self.late.append(abs(nearest[0] - moment))
            self.held.append(nearest[1] <= moment <= nearest[2])
        self.false += len(left)
        ends = [0.0, *(moment for moment, _ in schedule), duration]
        for (start, end), mass in zip(
            pairwise(ends), [0.0, *(m for _, m in schedule)], strict=True
        ):
            own = next(
                s for s in found.stretches if s.end > (start + end) / 2 or s is found.stretches[-1]
            )
            self.inside.append(own.ci95[0] <= mass <= own.ci95[1])
            self.z.append((own.m_p - mass) / own.std)


def run(name: str, seeds: Sequence[int], verbose: bool = False) -> Tally:
    """Track each log of a scene and count."""
    tally, lengths = Tally(), arm_named(SCENES[name].arm)[0]
    logs = chain.from_iterable(draws(name, seed) for seed in seeds)
    for schedule, duration, log, bare, burdened in logs:
        result = identify(bare, burdened, Settings(), report=False, l1=lengths.l1, l2=lengths.l2)
        arm, covariance = arm_of(result, next(segments([log])))
        found = track(lambda log=log: segments([log]), arm, covariance)  # type: ignore[misc]
        own = Tally()
        own.add(found, schedule, duration)
        tally.add(found, schedule, duration)
        if verbose:
            print(
                "terms",
                result.settings.get("model"),
                "colour",
                round(found.colour, 2),
                "missed",
                own.missed,
                "false",
                own.false,
                "held",
                f"{np.mean(own.held):.2f}",
                "late",
                np.round(own.late, 3),
                "z",
                np.round(own.z, 1),
                flush=True,
            )
            if own.missed or own.false:
                print(
                    "   true",
                    np.round([m for m, _ in schedule], 2),
                    "found",
                    np.round(found.changes[:, 0], 2),
                    flush=True,
                )
    return tally


def row(scene: Scene, tally: Tally) -> str:
    """A line of the table."""

    def beside(value: float, asked: float | None) -> str:
        return f"{value:g}" if asked is None else f"{value:g} (≤ {asked:g})"

    late = float(np.median(tally.late)) if tally.late else float("nan")
    held, inside = (
        100 * np.mean(tally.held) if tally.held else float("nan"),
        100 * np.mean(tally.inside),
    )
    return (
        f"| {scene.name} | {tally.changes} | {beside(tally.false, scene.false)} | "
        f"{beside(tally.missed, scene.missed)} "
        f"| {late:.3f} (≤ 0.05) | {held:.0f}{' (≥ 90)' if scene.brackets else ''} "
        f"| {inside:.1f}{' (92 to 98)' if scene.masses else ''} | "
        f"{np.sqrt(np.mean(np.square(tally.z))):.2f} |"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a Markdown table of figures asked for and measured."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--draws", type=int, default=1, help="motions of each scene")
    parser.add_argument("--seed", type=int, default=3, help="of the first motion")
    parser.add_argument("--verbose", action="store_true")
    wanted = parser.parse_args(arguments)
    print(
        "| scene | changes | false | missed | median error, s | brackets that hold, % | masses in "
        "95 %, % | z RMS |"
    )
    print("|---|---|---|---|---|---|---|---|")
    seeds = range(wanted.seed, wanted.seed + wanted.draws)
    for name in wanted.scenes.split(","):
        began = time.monotonic()
        print(
            row(SCENES[name], run(name, seeds, wanted.verbose)),
            f"<!-- {time.monotonic() - began:.0f} s -->",
            flush=True,
        )


if __name__ == "__main__":
    main()
