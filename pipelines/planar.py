"""Arms whose centres of mass lie off the links' lines, and payloads that are bodies: `make planar`.

Five arms, each link's centre of mass 0, 10 or 30° off its line, carry a payload of radius of
gyration 0, 2, 5 or 15 cm, on link 2's line and 20° off it. Every pair of logs is identified with no
flag. The first table has what phases and body cost: standard deviations with them over those
without, on a straight arm, of algid, of algid as the logs choose, and of the Cramér-Rao bound,
which shares nothing with it.
A row of the second gives how many of the 95 % intervals hold the truth, by parameter, how many
results failed, and what `track` says of a third log with that result: whether its interval holds
the mass, and changes of payload, of which there are none. A cell that right
intervals give once in a thousand is marked. Phases and inertias of 1 to 3 of their own standard
deviations, where the logs choose one or the other, are its last rows. Draws go round all rows, and
`planar.md` in the output folder is written after each row: a run that is cut off leaves a table.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from math import radians
from pathlib import Path

import numpy as np
from scipy.stats import binom

from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.base.errors import ResultError
from algid.estimators import refined
from algid.estimators.body import with_body_of
from algid.estimators.fit import Fit
from algid.estimators.problem import Problem, WeakSettings
from algid.identification.identify import identify
from algid.log import Log, Origin, Reading
from algid.model import Model
from algid.results import Result
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from algid.tracks.run import track_log
from pipelines.accuracy_scenes import case_of
from pipelines.cramer_rao import Truth, information_on

ARMS = ("case1", "case2", "arm21", "arm22", "arm23")
RATE, DURATION = 250.0, 6.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
ROUND = 2  # draws of an arm and row in each round
CHOSEN = 6  # draws of an arm that show what the logs' own choice costs
APART = 1000  # between the seeds of one row and of the next, so that none share their noise
TRACKED = 3  # of an arm's draws of a row that `track` follows too
CHANCE = 1e-3  # that a cell of right intervals is marked
NAMES = (*CONSTANT_NAMES, "k1s", "k2s", "k4s")
PAYLOAD = ("m_p", "l1", "l2", "y_p", "J_p")


@dataclass(frozen=True)
class Row:
    """How far centres of mass are off (°), the payload's radius of gyration (m) and
    direction (°).
    """

    centre: float = 0.0
    radius: float = 0.0
    off: float = 0.0
    small: float = 0.0
    """Phases and inertia are so many of their own standard deviations (`SMALL`)."""

    @property
    def title(self) -> str:
        """Its cells."""
        if self.small:
            return f"{self.small:g} σ | {self.small:g} σ | 0°"
        return f"{self.centre:g}° | {100 * self.radius:g} cm | {self.off:g}°"


ROWS = (
    *(Row(*each) for each in product((0.0, 10.0, 30.0), (0.0, 0.02, 0.05, 0.15), (0.0, 20.0))),
    *(Row(small=size) for size in (1.0, 2.0, 3.0)),
)
SMALL = {
    "case1": (0.1, 4.2e-3),
    "case2": (0.045, 3.4e-3),
    "arm21": (0.01, 3.0e-3),
    "arm22": (0.0084, 5.6e-3),
    "arm23": (0.0084, 2.9e-3),
}
"""Standard deviations of a phase in ° and a radius of gyration in m, from logs of `Row()`."""


def scene(name: str, row: Row) -> tuple[Arm, FloatArray]:
    """The arm of a row, and m_p, l1, x, y, J of its payload."""
    case = case_of(name)
    if row.small:
        phase, radius = SMALL[name]
        row = Row(row.small * phase, row.small**0.5 * radius)
    arm = replace(case.arm, delta1=radians(row.centre), delta2=radians(row.centre))
    radius = min(row.radius, 0.9 * arm.l2)  # no object reaches past joint 2
    place = arm.l2 * np.exp(1j * radians(row.off))
    own = case.payload * radius**2
    return arm, np.array([case.payload, arm.l1, place.real, place.imag, own])


def truth(arm: Arm, payload: FloatArray) -> dict[str, float]:
    """Every parameter's true value by name."""
    return dict(zip((*NAMES, *PAYLOAD), [*arm.phasors(), *payload], strict=True))


@cache
def motions(name: str, row: Row) -> tuple[SimulatedMotion, SimulatedMotion]:
    """The motion of the arm without and with its payload."""
    return _moved(name, row, 0, loaded=False), _moved(name, row, 1, loaded=True)


@cache
def followed(name: str, row: Row) -> SimulatedMotion:
    """Another motion with the payload, for `track`."""
    return _moved(name, row, 2, loaded=True)


def _moved(name: str, row: Row, number: int, *, loaded: bool) -> SimulatedMotion:
    """The arm of a row under the torque of that `number`, as wide as its straight arm takes."""
    arm, payload = scene(name, row)
    m_p, _, x, y, J = payload.tolist()
    k = arm.phasors(m_p, x, y, J) if loaded else arm.phasors()
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    return simulate(k, wide_multi_sine(case_of(name).arm, sum(name.encode()) + number), t)


def noisy(motion: SimulatedMotion, rng: np.random.Generator, name: str) -> Log:
    """One draw of a log; a joint may turn as often as it will."""
    origin = Origin(name, "csv", {}, reading=Reading(accepted=("DEGREES",)))
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(motion.theta.shape)
    tau = motion.tau + SIGMA_TAU * rng.standard_normal(motion.tau.shape)
    return Log(np.round(motion.t * 1e9).astype(np.int64), theta, tau, origin)


def drawn(name: str, row: Row, seed: int) -> Result:
    """The result of one draw."""
    rng = np.random.default_rng([seed, sum(name.encode())])
    unloaded, loaded = motions(name, row)
    logs = noisy(unloaded, rng, "unloaded.csv"), noisy(loaded, rng, "loaded.csv")
    return identify(*logs, report=False)


def judged(job: tuple[str, Row, range]) -> Counter[str]:
    """By parameter whether its interval holds the truth; what is left out is nothing, exactly."""
    name, row, seeds = job
    found: Counter[str] = Counter()
    true = truth(*scene(name, row))
    for number in seeds:
        seed = APART * ROWS.index(row) + number
        result = drawn(name, row, seed)
        found.update(draws=1, failed=int(result.verdict.failed))
        for parameter, value in true.items():
            estimate = result.estimates.get(parameter)
            if estimate is None:
                continue
            low, high = estimate.ci95 or (None, None)
            found[f"told {parameter}"] += 1
            found[f"held {parameter}"] += low is None or high is None or low <= value <= high
        if number < TRACKED:
            found.update(_tracked(name, row, seed, result, true["m_p"]))
    return found


def _tracked(name: str, row: Row, seed: int, result: Result, mass: float) -> dict[str, int]:
    """What `track` says of a third log: nothing where the result lacks what it needs."""
    rng = np.random.default_rng([seed, sum(name.encode()), 2])
    log = noisy(followed(name, row), rng, "followed.csv")
    try:
        found = track_log(log, result).track
    except ResultError:
        return {"refused": 1}
    first = found.stretches[0]
    held = int(first.ci95[0] <= mass <= first.ci95[1])
    return {"told track": 1, "held track": held, "changes": len(found.stretches) - 1}


def rounds(draws: int, rows: tuple[Row, ...], processes: int) -> Iterator[list[str]]:
    """The table of coverage after every row of a round, with as many draws of each arm."""
    totals: dict[Row, Counter[str]] = {row: Counter() for row in rows}
    with ProcessPoolExecutor(processes) as pool:
        for first in range(0, draws, ROUND):
            seeds = range(first, min(first + ROUND, draws))
            jobs = [(name, row, seeds) for row in rows for name in ARMS]
            for (name, row, _), found in zip(jobs, pool.map(judged, jobs), strict=True):
                totals[row].update(found)
                if name == ARMS[-1]:
                    yield table(totals)


def table(totals: Mapping[Row, Counter[str]]) -> list[str]:
    """The table of coverage."""
    shown = (*NAMES, *PAYLOAD, "track")
    heads = ["centres", "radius", "direction", "draws", "failed", *shown, "changes"]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    every = sum(totals.values(), Counter[str]())
    titled = [*((row.title, total) for row, total in totals.items()), ("all | all | all", every)]
    for title, total in titled:
        cells = [str(total["draws"]), str(total["failed"])]
        cells += [_cell(total[f"held {name}"], total[f"told {name}"]) for name in shown]
        lines.append(f"| {title} | {' | '.join([*cells, str(total['changes'])])} |")
    return lines


def _cell(held: int, told: int) -> str:
    """Intervals that hold the truth, of how many, and the mark."""
    if not told:
        return "–"
    low, high = binom.interval(1 - CHANCE, told, 0.95)
    return f"{held}/{told}" + ("" if low <= held <= high else " !")


def costs() -> Iterator[str]:
    """Standard deviations with phases and the body, over those of the straight arm with a point."""
    shown = (*CONSTANT_NAMES, "m_p")
    yield f"| arm | {' | '.join(shown)} |"
    yield f"|{'---|' * (1 + len(shown))}"
    for name in ARMS:
        rng = np.random.default_rng(0)
        logs = [_segment(motion, rng) for motion in motions(name, Row())]
        plain = _fitted(logs, Model())
        general = with_body_of(_fitted(logs, Model(("phases",))), ("y_p", "J_p"))
        ratios = [
            general.std[general.names.index(one)] / plain.std[plain.names.index(one)]
            for one in shown
        ]
        yield f"| {name} | {' | '.join(f'{ratio:.3f}' for ratio in ratios)} |"
        chosen = np.mean([_chosen(name, seed) for seed in range(CHOSEN)], axis=0)
        yield f"| {name}, as chosen | {' | '.join(f'{ratio:.3f}' for ratio in chosen)} |"
        least = bounds(name)
        yield f"| {name}, the bound | {' | '.join(f'{least[one]:.3f}' for one in shown)} |"


def _chosen(name: str, seed: int) -> FloatArray:
    """Standard deviations of a straight arm's result over those of the straight model: (8,)."""
    rng = np.random.default_rng([seed, sum(name.encode())])  # the noise of `drawn`
    logs = [_segment(motion, rng) for motion in motions(name, Row())]
    plain, result = _fitted(logs, Model()), drawn(name, Row(), seed)
    own = [result.estimates[one].std or np.inf for one in (*CONSTANT_NAMES, "m_p")]
    return np.array(own) / [plain.std[plain.names.index(one)] for one in (*CONSTANT_NAMES, "m_p")]


def bounds(name: str) -> dict[str, float]:
    """What phases and the body cost by the Cramér-Rao bound: its least σ with them over without."""
    arm, payload = scene(name, Row())
    p = np.concatenate([arm.phasors(), payload])
    total = np.zeros((p.size, p.size))
    for motion, loaded in zip(motions(name, Row()), (False, True), strict=True):
        truth = Truth(motion.t, motion.theta, motion.omega, motion.tau)

        def constants(q: FloatArray, *, loaded: bool = loaded) -> FloatArray:
            return _burdened(q, arm.g) if loaded else q[:10]

        total += information_on(truth, p, constants, SIGMA_THETA, SIGMA_TAU)
    names = [*NAMES, *PAYLOAD]
    straight = [names.index(one) for one in names if one not in ("k1s", "k2s", "k4s", "y_p", "J_p")]
    every = np.sqrt(np.diag(np.linalg.inv(total)))
    plain = np.sqrt(np.diag(np.linalg.inv(total[np.ix_(straight, straight)])))
    return {
        names[place]: float(every[place] / own) for place, own in zip(straight, plain, strict=True)
    }


def _burdened(q: FloatArray, g: float) -> FloatArray:
    """Constants and sine parts (10,) of q: the bare arm's (10,), then m_p, l1, x, y, J."""
    m, l1, x, y, J = q[10:]
    added = [m * l1 * x, m * g * x, m * (x**2 + y**2) + J, m * g * l1, m * l1**2, 0, 0]
    return np.asarray(q[:10] + np.array([*added, m * l1 * y, m * g * y, 0 * y]))


def _fitted(logs: list[Segment], model: Model) -> Fit:
    unloaded, loaded = logs
    return refined.fit(Problem([lambda: [unloaded]], [lambda: [loaded]], WeakSettings(model)))


def _segment(motion: SimulatedMotion, rng: np.random.Generator) -> Segment:
    log = noisy(motion, rng, "log")
    return Segment(0.0, 1 / RATE, log.theta, log.tau)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=40, help="of each arm and row")
    parser.add_argument("--rows", type=int, nargs="*", help="numbers of rows, by default all")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/planar"))
    given = parser.parse_args()
    rows = ROWS if given.rows is None else tuple(ROWS[number] for number in given.rows)
    given.output.mkdir(parents=True, exist_ok=True)
    price = list(costs())
    print("\n".join(price), flush=True)
    for lines in rounds(given.draws, rows, given.processes):
        print(lines[-1], flush=True)
        text = "\n".join([*price, "", *lines, ""])
        (given.output / "planar.md").write_text(text, encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
