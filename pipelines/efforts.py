"""What drivers call effort: told by the logs, named, and what the payload is worth then: `make
efforts`.

Of five arms, straight and with a point at the tip, each pair of logs is identified with no flag and
its torque as such a driver logs it; where a notice names a flag, once more with that. A row gives
how many were named, exit codes without and with the flag, how often the 95 % interval of m_p holds
the truth, and advice that names anything else. Writes `efforts.md` into the output folder.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from algid.api.identify import identify
from algid.arm import FloatArray, inverse_dynamics, passive_torque
from algid.base.exits import exit_of
from algid.results import Result
from algid.synth.simulator import SimulatedMotion
from pipelines.experiment import experiment
from pipelines.planar import ARMS, Row, motions, noisy, scene

NAMES = {
    "gravity-compensated": ("GRAVITY_COMPENSATED", "GRAVITY_COMPENSATED"),
    "friction-compensated": ("FRICTION_COMPENSATED",),
    "external": ("EXTERNAL_EFFORT",),
    "raw": (),
}
"""By effort the codes that name it."""


def taken(effort: str, k: FloatArray, loaded: FloatArray, motion: SimulatedMotion) -> FloatArray:
    """What a driver takes off the torque (2, N) of an arm `k` that moves with constants
    `loaded`.
    """
    if effort == "gravity-compensated":
        weight = np.where(np.isin(np.arange(7), (1, 3)), k, 0.0)
        return passive_torque(weight, motion.theta, np.zeros_like(motion.omega))
    if effort == "friction-compensated":
        return k[5:, None] * motion.omega
    if effort == "external":
        alpha = np.gradient(motion.omega, motion.t, axis=1)
        return motion.tau - inverse_dynamics(loaded - k, motion.theta, motion.omega, alpha)
    return np.zeros_like(motion.tau)


def judged(job: tuple[str, str, int]) -> Counter[str]:
    """What became of the draws of an arm."""
    effort, name, draws = job
    arm, payload = scene(name, Row())
    k, loaded = arm.constants(), arm.phasors(payload[0])[:7]
    found: Counter[str] = Counter()
    for seed in range(draws):
        rng = np.random.default_rng([seed, sum(name.encode())])
        first, second = (
            noisy(replace(one, tau=one.tau - taken(effort, k, constants, one)), rng, title)
            for title, constants, one in zip(
                ("unloaded.csv", "loaded.csv"), (k, loaded), motions(name, Row()), strict=True
            )
        )
        result = identify(first, second, report=False)
        named = [one for one in result.notices if one.code in NAMES[effort]]
        others = {one.code for one in result.notices if one.remedies} - set(NAMES[effort])
        flagged = result
        if named and named[0].remedy is not None:
            flagged = identify(first, second, report=False, **named[0].remedy.keywords)
        found.update(draws=1, named=int(bool(named)))
        found.update(f"other {code}" for code in others)
        found[f"exit {_exit(result)}"] += 1
        found[f"then {_exit(flagged)}"] += 1
        low, high = flagged.payload["m_p"].ci95 or (None, None)
        held = low is not None and high is not None and low <= payload[0] <= high
        found["held"] += int(held)
    return found


def _exit(result: Result) -> int:
    failed = result.verdict.failed or not result.complete
    return int(exit_of(failed=failed, lost=result.data_lost))


def lines(draws: int, pool: ProcessPoolExecutor) -> Iterator[str]:
    """The table, row by row."""
    yield (
        "| effort | draws | named | exit 0 without a flag | exit 0 with it | m_p held "
        "| other advice |"
    )
    yield "|---|---|---|---|---|---|---|"
    for effort in NAMES:
        total: Counter[str] = Counter()
        for found in pool.map(judged, [(effort, name, draws) for name in ARMS]):
            total.update(found)
        cells = [str(total[cell]) for cell in ("draws", "named", "exit 0", "then 0", "held")]
        others = sorted(cell for cell in total if cell.startswith("other "))
        named = [f"{total[cell]} {cell.removeprefix('other ')}" for cell in others]
        yield f"| {effort} | {' | '.join([*cells, ', '.join(named) or 'none'])} |"


if __name__ == "__main__":
    experiment("efforts", __doc__, lines, 20, "arm and effort")
