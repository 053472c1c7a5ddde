"""Six logs of an arm that a torque which no model holds drives too: open loop, and under a PD
controller, without and with its reference in the logs.

    python -m pipelines.disturbed --arms 3

The disturbance is an Ornstein-Uhlenbeck torque of 0.1 s and 30 % of the drive's RMS on each joint.
In open loop the logged torque is a multi-sine; under feedback it is kp (q_des - θ) + kd (q̇_des -
θ̇) with the weight held, so that it answers the disturbance. Each row identifies with no flag;
asked are 90 % of the intervals of k1 … k5 that hold, and a bias of 1.5 % at most, or a warning
that the torque is endogenous.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import sem

from algid.arm import Arm, FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.model import RIGID
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import HANGING
from pipelines.accuracy_scenes import random_arm, waves
from pipelines.experiment import Seen, count, experiment, grid, judged, number, rms, share, words
from pipelines.simulator import Arms, inertias, swung

DT, DURATION, LOGS = 2e-3, 10.0, 6
SHARE, PERSISTENCE = 0.3, 0.1  # of the drive's RMS; s
SIGMA = 1e-4  # rad; ten times as much in N m
SPEED = 8.0  # rad/s: of the PD loop
FIRST_ARM = 60
_FREQUENCIES = np.array([0.3, 0.7, 1.1, 1.6, 2.3])


@dataclass(frozen=True, eq=False)
class Scene:
    """Logs of one arm (angles and torques (n, 2, N)), and the reference's angles, where there is
    one.
    """

    arm: Arm
    theta: FloatArray
    tau: FloatArray
    reference: FloatArray | None = None


Control = Callable[[int, FloatArray], FloatArray]


def _driven(
    k: FloatArray, control: Control, count: int, push: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Angles and torques (2, n, N) with a disturbance `push` (N + 1, 2, n) in N m."""
    arms = Arms(k[:, None] * np.ones(LOGS))

    def rate(half: int, x: FloatArray) -> FloatArray:
        disturbance = (push[half // 2] + push[(half + 1) // 2]) / 2
        return arms.rate(x, control(half, x) + disturbance)

    states, torques = swung(rate, control, arms.hanging(), count, DT)
    return np.moveaxis(states[:, :2], 0, -1), np.moveaxis(torques, 0, -1)


def scene(number: int, *, feedback: bool, share: float = SHARE) -> Scene:
    """The arm `number` with six drives, each with a disturbance of its own."""
    arm = random_arm(FIRST_ARM + number)[0]
    k, count = arm.constants(), round(DURATION / DT)
    rng = np.random.default_rng([number, int(feedback)])
    half = DT / 2 * np.arange(2 * count + 1)
    reference = None
    if feedback:
        reference, control = _controller(k, half, rng)
    else:
        drives = [wide_multi_sine(arm, 100 * number + own)(half) for own in range(LOGS)]
        drive = np.stack(drives, axis=1)

        def control(place: int, _: FloatArray) -> FloatArray:
            return drive[:, :, place]

    # The disturbance's size follows the drive's.
    still = np.zeros((count + 1, 2, LOGS))
    size = share * np.sqrt(np.mean(_driven(k, control, count, still)[1] ** 2, axis=(1, 2)))
    keep = np.exp(-DT / PERSISTENCE)
    fresh = np.sqrt(1 - keep**2) * size[:, None] * rng.standard_normal((count, 2, LOGS))
    push = np.concatenate([still[:1], lfilter([1.0], [1.0, -keep], fresh, axis=0)])
    theta, tau = _driven(k, control, count, push)
    noise = SIGMA * rng.standard_normal((2, *theta.shape))
    signals = ((theta + noise[0]).swapaxes(0, 1), (tau + 10 * noise[1]).swapaxes(0, 1))
    wanted = None if reference is None else reference[..., : 2 * count : 2].swapaxes(0, 1)
    return Scene(arm, *signals, wanted)


def _controller(
    k: FloatArray, half: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, Control]:
    """Angles to follow (2, n, T) at half steps, and the torque (2, n) of a PD controller."""
    phase = rng.uniform(0, 2 * np.pi, (2, LOGS, _FREQUENCIES.size))
    size = rng.uniform(0.2, 0.5, phase.shape)
    wanted, rate, _ = waves(half, _FREQUENCIES, size, phase)
    wanted += HANGING[:, None, None]
    inertia = inertias(k)[:, None]

    def control(place: int, x: FloatArray) -> FloatArray:
        error, slower = wanted[:, :, place] - x[:2], rate[:, :, place] - x[2:4]
        held = np.cos(np.cumsum(wanted[:, :, place], axis=0))
        weight = np.stack([k[3] * held[0] + k[1] * held[1], k[1] * held[1]])
        return np.asarray(inertia * (SPEED**2 * error + 1.4 * SPEED * slower) + weight)

    return wanted, control


def draw(feedback: bool, reference: bool, number: int, _draw: int) -> Seen:
    """What became of an arm's logs."""
    made = scene(number, feedback=feedback)
    t, logs = np.arange(made.theta.shape[2]) * DT, []
    for n, signals in enumerate(zip(made.theta, made.tau, strict=True)):
        asked = made.reference[n] if reference and made.reference is not None else None
        logs.append(Log.from_arrays(t, *signals, reference=asked, name=f"run {n}"))
    result = identify(logs, report=False)
    seen = judged(result, dict(zip(RIGID, made.arm.constants(), strict=False)))
    return seen | {"by": [result.estimator], "bias": [float(np.mean(seen["error"]))]}


if __name__ == "__main__":
    rows = {"open loop": (False, False), "PD, no reference": (True, False)}
    rows |= {"PD, reference in the log": (True, True)}
    columns = {
        "arms": count("draw"),
        "held": share("held"),
        "bias, %": number("bias", np.mean, 100),
        "± from arm to arm": number(
            "bias", lambda bias: sem(bias) if bias.size > 1 else np.nan, 100
        ),
        "RMS error, %": number("error", rms, 100),
        "warned": count("FEEDBACK"),
        "by": words("by"),
    }
    experiment("disturbed", __doc__, grid(rows, range(9)), draw, columns, draws=1)
