"""Arms whose centres of mass lie off the links' lines, and payloads that are bodies: `make planar`.

Five arms, each link's centre of mass 0, 10 or 30° off its line, carry a payload of radius of
gyration 0, 2, 5 or 15 cm, on link 2's line and 20° off it. Every pair of logs is identified with no
flag. A row gives how many of the 95 % intervals hold the truth, by parameter, and how many results
failed. Phases and inertias of 1 to 3 of their own standard deviations, where the logs choose one or
the other, are rows of their own; the last ones are given lengths, true ones and some 3, 5 and 9 %
off, which LENGTH_CONTRADICTED accuses: estimates have to hold without. The first table has what
phases and body cost: standard deviations with them over those without, on a straight arm, of algid,
of algid as the logs choose, and of the Cramér-Rao bound, which shares nothing with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from math import radians

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.estimators import refined
from algid.estimators.body import with_body_of
from algid.estimators.fit import Fit
from algid.estimators.problem import Problem, WeakSettings
from algid.identification.identify import identify
from algid.log import Log
from algid.model import Model
from algid.notices import has_code
from algid.results import Result
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import case_of, logged
from pipelines.cramer_rao import Truth, information_on
from pipelines.experiment import Seen, count, experiment, grid, judged, share

ARMS = ("case1", "case2", "arm21", "arm22", "arm23")
RATE, DURATION = 250.0, 6.0
SIGMAS = 3e-4, 1e-2  # rad, N m
CHOSEN = 6  # draws of an arm that show what the logs' own choice costs
APART = 1000  # between the seeds of one row and of the next, so that none share their noise
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
    given: tuple[str, ...] = ()
    wrong: float = 0.0
    """Lengths that are given, and what share they are too long."""

    @property
    def title(self) -> str:
        """Its cells."""
        if self.small:
            return f"{self.small:g} σ | {self.small:g} σ | 0°"
        cells = f"{self.centre:g}° | {100 * self.radius:g} cm | {self.off:g}°"
        return cells + "".join(f", {one} {self.wrong:+.0%}" for one in self.given)


WRONG = 0.05, -0.05, 0.03, -0.03, 0.09, -0.09
"""By what shares lengths are off."""
ROWS = (
    *(Row(*each) for each in product((0.0, 10.0, 30.0), (0.0, 0.02, 0.05, 0.15), (0.0, 20.0))),
    *(Row(small=size) for size in (1.0, 2.0, 3.0)),
    *(Row(given=each) for each in (("l1",), ("l2",), ("l1", "l2"))),
    *(Row(given=(one,), wrong=off) for off in WRONG for one in ("l1", "l2")),
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
    """The motion of the arm without and with its payload, as wide as its straight arm takes."""
    arm, payload = scene(name, row)
    m_p, _, x, y, J = payload.tolist()
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    unloaded, loaded = (
        simulate(k, wide_multi_sine(case_of(name).arm, sum(name.encode()) + number), t)
        for number, k in enumerate((arm.phasors(), arm.phasors(m_p, x, y, J)))
    )
    return unloaded, loaded


def drawn(name: str, row: Row, seed: int) -> Result:
    """The result of one draw."""
    rng = np.random.default_rng([seed, sum(name.encode())])
    unloaded, loaded = (noisy(motion, rng) for motion in motions(name, row))
    true = truth(*scene(name, row))
    given = {one: float((1 + row.wrong) * true[one]) for one in row.given}
    return identify(unloaded, loaded, Settings.model_validate(given), report=False)


def noisy(motion: SimulatedMotion, rng: np.random.Generator) -> Log:
    """One draw of a log."""
    return logged(motion.t, motion.theta, motion.tau, rng, SIGMAS)


def draw(row: Row, name: str, number: int) -> Seen:
    """One draw; what a result leaves out is nothing, exactly."""
    result = drawn(name, row, APART * ROWS.index(row) + number)
    seen = judged(result, truth(*scene(name, row)))
    seen["accused"] = [1] * has_code(result.notices, "LENGTH_CONTRADICTED")
    return seen


def costs() -> Iterator[str]:
    """Standard deviations with phases and the body, over those of the straight arm with a point."""
    shown = (*CONSTANT_NAMES, "m_p")
    yield f"| arm | {' | '.join(shown)} |"
    yield f"|{'---|' * (1 + len(shown))}"
    for name in ARMS:
        chosen = []
        for seed in range(CHOSEN):
            rng = np.random.default_rng([seed, sum(name.encode())])  # the noise of `drawn`
            logs = [_segment(motion, rng) for motion in motions(name, Row())]
            plain = _deviations(_fitted(logs, Model()))
            found = drawn(name, Row(), seed).estimates
            chosen.append([(found[one].std or np.inf) / plain[one] for one in shown])
        general = with_body_of(_fitted(logs, Model(("phases",))), ("y_p", "J_p"))
        every = _deviations(general)
        least = bounds(name)
        for title, ratios in (
            (name, [every[one] / plain[one] for one in shown]),
            (f"{name}, as chosen", np.mean(chosen, axis=0)),
            (f"{name}, the bound", [least[one] for one in shown]),
        ):
            yield f"| {title} | {' | '.join(f'{ratio:.3f}' for ratio in ratios)} |"


def _deviations(fit: Fit) -> dict[str, float]:
    return dict(zip(fit.names, fit.std.tolist(), strict=True))


def bounds(name: str) -> dict[str, float]:
    """What phases and the body cost by the Cramér-Rao bound: its least σ with them over without."""
    arm, payload = scene(name, Row())
    p = np.concatenate([arm.phasors(), payload])
    total = np.zeros((p.size, p.size))
    for motion, loaded in zip(motions(name, Row()), (False, True), strict=True):
        truth = Truth(motion.t, motion.theta, motion.omega, motion.tau)

        def constants(q: FloatArray, *, loaded: bool = loaded) -> FloatArray:
            return _burdened(q, arm.g) if loaded else q[:10]

        total += information_on(truth, p, constants, *SIGMAS)
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
    log = noisy(motion, rng)
    return Segment(0.0, 1 / RATE, log.theta, log.tau)


if __name__ == "__main__":
    print("\n".join(costs()), flush=True)
    rows = grid({row.title: (row,) for row in ROWS}, ARMS)
    columns = {"draws": count("draw"), "failed": count("failed"), "accused": count("accused")}
    columns |= {name: share(f"held {name}") for name in (*NAMES, *PAYLOAD)}
    experiment("planar", __doc__, rows, draw, columns, draws=40)
