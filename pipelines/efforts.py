"""What drivers call effort: told by the logs, named, and what the payload is worth then: `make
efforts`.

Of five arms, straight and with a point at the tip, each pair of logs is identified with no flag and
its torque as such a driver logs it; where a notice names a flag, once more with that. A row gives
how many were named, exit codes without and with the flag, how often the 95 % interval of m_p holds
the truth, and advice that names anything else.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.api.identify import identify
from algid.arm import FloatArray, inverse_dynamics, passive_torque
from algid.synth.simulator import SimulatedMotion
from pipelines.experiment import Seen, count, experiment, grid, judged, share, words
from pipelines.planar import ARMS, Row, motions, noisy, scene

NAMES = {
    "gravity-compensated": "GRAVITY_COMPENSATED",
    "friction-compensated": "FRICTION_COMPENSATED",
    "external": "EXTERNAL_EFFORT",
    "raw": "",
}
"""By effort the code that names it."""


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


def draw(effort: str, name: str, seed: int) -> Seen:
    """What became of one draw, with no flag and with the one that is named."""
    arm, payload = scene(name, Row())
    k, loaded = arm.constants(), arm.phasors(payload[0])[:7]
    rng = np.random.default_rng([seed, sum(name.encode())])
    unloaded, burdened = (
        noisy(replace(one, tau=one.tau - taken(effort, k, constants, one)), rng)
        for constants, one in zip((k, loaded), motions(name, Row()), strict=True)
    )
    result = identify(unloaded, burdened, report=False)
    seen = judged(result, {})
    named = [one for one in result.notices if one.code == NAMES[effort]]
    seen["named"] = [1] * bool(named)
    seen["other"] = [*{one.code for one in result.notices if one.remedies} - {NAMES[effort]}]
    if named and named[0].remedy is not None:
        result = identify(unloaded, burdened, report=False, **named[0].remedy.settings)
    then = judged(result, {"m_p": float(payload[0])})
    return seen | {"held": then["held"], "then 0": then["exit 0"]}


if __name__ == "__main__":
    columns = {
        "draws": count("draw"),
        "named": count("named"),
        "exit 0 without a flag": count("exit 0"),
        "exit 0 with it": count("then 0"),
        "m_p held": share("held"),
        "other advice": words("other"),
    }
    rows = grid({effort: (effort,) for effort in NAMES}, ARMS)
    experiment("efforts", __doc__, rows, draw, columns, draws=20)
