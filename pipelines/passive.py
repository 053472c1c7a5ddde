"""Arms with a joint that has no motor, its bearing's friction and the pull of cables: `make
passive`.

An acrobot's first joint, or a pendubot's second, bears Coulomb friction of its bearing, and cables
pull at both joints by 2 % of the driven joint's torque, slowly and unlogged. Every draw is
identified with no flag but `--set passive`. A row gives how many converged, how many failed, how
many have k1, k2 and k3 all as nothing, and how many intervals hold the truth of those that are
told, by constant. Writes
`passive.md` into the output folder.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.identification.identify import identify
from algid.log import Log, Origin, Reading
from algid.signals.filters import correlate
from algid.synth.excitation import SampledTorque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, steered
from pipelines.accuracy_scenes import case_of
from pipelines.experiment import experiment

ARMS = ("case1", "arm21", "arm22", "arm23")
RATE, DURATION = 250.0, 10.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
CABLES = 0.02  # of the driven joint's torque, RMS
BEARING = 0.01  # of it: Coulomb friction of the passive joint
WIDTH = 0.05  # rad/s, of that friction
SLOW = 0.5  # s: how long cables keep their pull


def log_of(name: str, passive: int, seed: int) -> Log:
    """One draw: what moves the arm is the motor less friction and cables.

    The motor's torque is logged.
    """
    arm = case_of(name).arm
    rng = np.random.default_rng([seed, passive, sum(name.encode())])
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    wide = wide_multi_sine(arm, seed)
    motors = np.array([[float(passive != 1)], [float(passive != 2)]])
    size = float(np.sqrt(np.mean(wide(t)[2 - passive] ** 2)))
    pull = SampledTorque(t, CABLES * size * _slow(rng, t.size), "foh")

    def controller(times: FloatArray) -> Driven:
        acting = wide(times) * motors + pull(times)

        def torque(_theta: FloatArray, omega: FloatArray) -> FloatArray:
            rubbed = acting.copy()
            rubbed[passive - 1] -= BEARING * size * np.tanh(omega[passive - 1] / WIDTH)
            return rubbed

        return torque

    motion = steered(arm.constants(), controller, t, HANGING, corners=t)
    driven = wide(t) * motors
    reading = Reading(passive=passive, accepted=("DEGREES",))
    logged = driven + SIGMA_TAU * rng.standard_normal(driven.shape)
    logged[passive - 1] = 0.0
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(driven.shape)
    origin = Origin(f"{name}.csv", "csv", {}, reading=reading)
    return Log(np.round(t * 1e9).astype(np.int64), theta, logged, origin)


def _slow(rng: np.random.Generator, count: int) -> FloatArray:
    """Two slow signals of unit RMS (2, count)."""
    kernel = np.hanning(round(SLOW * RATE) | 1)
    white = rng.standard_normal((2, count + kernel.size - 1))
    slow = correlate(white, kernel)
    return np.asarray(slow / np.sqrt(np.mean(slow**2, axis=1, keepdims=True)))


def judged(job: tuple[str, int, int]) -> Counter[str]:
    """What became of the draws of an arm."""
    name, passive, draws = job
    true = dict(zip(CONSTANT_NAMES, case_of(name).arm.constants().tolist(), strict=True))
    found: Counter[str] = Counter()
    for seed in range(draws):
        result = identify(log_of(name, passive, seed), report=False)
        assert result.fit is not None
        found.update(draws=1, converged=result.fit.converged, failed=result.verdict.failed)
        sizes = [abs(result.parameters[k].estimate or 0.0) / true[k] for k in ("k1", "k2", "k3")]
        found["nothing"] += max(sizes) < 0.1
        for k, value in true.items():
            one = result.parameters[k]
            if not one.usable:  # too weakly excited, and said so
                continue
            low, high = one.ci95 or (None, None)
            found[k] += low is None or high is None or low <= value <= high
            found[f"told {k}"] += 1
    return found


def lines(draws: int, pool: ProcessPoolExecutor) -> Iterator[str]:
    """The table, row by row."""
    names = " | ".join(CONSTANT_NAMES)
    yield f"| joint without motor | draws | converged | failed | nothing | {names} |"
    yield f"|{'---|' * (5 + len(CONSTANT_NAMES))}"
    for passive, title in ((1, "1 (acrobot)"), (2, "2 (pendubot)")):
        total: Counter[str] = Counter()
        jobs = [(name, passive, draws) for name in ARMS]
        for (name, *_), found in zip(jobs, pool.map(judged, jobs), strict=True):
            total.update(found)
            yield _line(f"{title}, {name}", found)
        yield _line(f"{title}, all", total)


def _line(title: str, total: Counter[str]) -> str:
    cells = [total[cell] for cell in ("draws", "converged", "failed", "nothing")]
    held = [f"{total[k]}/{total[f'told {k}']}" for k in CONSTANT_NAMES]
    return f"| {title} | {' | '.join(map(str, [*cells, *held]))} |"


if __name__ == "__main__":
    experiment("passive", __doc__, lines, 50, "of four arms and kind")
