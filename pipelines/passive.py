"""Arms with a joint that has no motor, its bearing's friction and the pull of cables: `make
passive`.

An acrobot's first joint, or a pendubot's second, bears Coulomb friction of its bearing, and cables
pull at both joints by 2 % of the driven joint's torque, slowly and unlogged. Every draw is
identified with no flag but `--set passive`. A row gives how many converged, how many failed, how
many have k1, k2 and k3 all as nothing, and how many intervals hold the truth of those that are
told, by constant.
"""

from __future__ import annotations

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.signals.filters import correlate
from algid.synth.excitation import SampledTorque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, steered
from pipelines.accuracy_scenes import case_of, logged
from pipelines.experiment import Seen, count, experiment, grid, judged, share

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
    driven += SIGMA_TAU * rng.standard_normal(driven.shape) * motors
    return logged(t, motion.theta, driven, rng, (SIGMA_THETA, 0.0), passive=passive)


def _slow(rng: np.random.Generator, count: int) -> FloatArray:
    """Two slow signals of unit RMS (2, count)."""
    kernel = np.hanning(round(SLOW * RATE) | 1)
    white = rng.standard_normal((2, count + kernel.size - 1))
    slow = correlate(white, kernel)
    return np.asarray(slow / np.sqrt(np.mean(slow**2, axis=1, keepdims=True)))


def draw(passive: int, name: str, seed: int) -> Seen:
    """What became of one draw."""
    true = dict(zip(CONSTANT_NAMES, case_of(name).arm.constants(), strict=True))
    result = identify(log_of(name, passive, seed), report=False)
    seen = judged(result, true)
    assert result.fit is not None
    seen["converged"] = [result.fit.converged]
    sizes = [abs(result.parameters[k].estimate or 0.0) / true[k] for k in ("k1", "k2", "k3")]
    seen["nothing"] = [max(sizes) < 0.1]
    return seen


if __name__ == "__main__":
    rows = {"1 (acrobot)": (1,), "2 (pendubot)": (2,)}
    columns = {"draws": count("draw"), "converged": count("converged")}
    columns |= {"failed": count("failed"), "nothing": count("nothing")}
    columns |= {k: share(f"held {k}") for k in CONSTANT_NAMES}
    experiment("passive", __doc__, grid(rows, ARMS), draw, columns, draws=50)
