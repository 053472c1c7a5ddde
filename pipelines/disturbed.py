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

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import Arm, FloatArray, forward_dynamics
from algid.identification.identify import identify
from algid.log import Log, Origin
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import HANGING
from pipelines.accuracy_scenes import random_arm

DT, DURATION, LOGS = 2e-3, 10.0, 6
SHARE, PERSISTENCE = 0.3, 0.1  # of the drive's RMS; s
SIGMA = 1e-4  # rad; ten times as much in N m
NAMES = ("k1", "k2", "k3", "k4", "k5")
WARNINGS = ("FEEDBACK",)
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


def scene(number: int, *, feedback: bool, share: float = SHARE) -> Scene:
    """The arm `number` with six drives, each with a disturbance of its own."""
    arm = random_arm(FIRST_ARM + number)[0]
    rng = np.random.default_rng([number, int(feedback)])
    half = DT / 2 * np.arange(2 * round(DURATION / DT) + 1)
    if feedback:
        reference, controlled = _controller(arm, half, rng)
        return _simulated(arm, controlled, share, rng, reference[..., ::2])
    drives = [wide_multi_sine(arm, 100 * number + own)(half) for own in range(LOGS)]
    drive = np.stack(drives, axis=1)

    def control(place: int, _: FloatArray) -> FloatArray:
        return drive[:, :, place]

    return _simulated(arm, control, share, rng, None)


Control = Callable[[int, FloatArray], FloatArray]


def _controller(arm: Arm, half: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, Control]:
    """Angles to follow (2, n, T) at half steps, and the torque (2, n) of a PD controller."""
    phase = rng.uniform(0, 2 * np.pi, (2, LOGS, _FREQUENCIES.size))
    size = rng.uniform(0.2, 0.5, phase.shape)
    turn = 2 * np.pi * _FREQUENCIES
    angle = phase[..., None] + turn[:, None] * half
    wanted = np.sum(size[..., None] * np.sin(angle), axis=2) + HANGING[:, None, None]
    rate = np.sum((size * turn)[..., None] * np.cos(angle), axis=2)
    k = arm.constants()
    inertia = np.array([k[4] + k[2] + 2 * k[0], k[2]])[:, None]

    def control(place: int, x: FloatArray) -> FloatArray:
        error, slower = wanted[:, :, place] - x[:2], rate[:, :, place] - x[2:]
        held = np.cos(np.cumsum(wanted[:, :, place], axis=0))
        weight = np.stack([k[3] * held[0] + k[1] * held[1], k[1] * held[1]])
        return inertia * (SPEED**2 * error + 1.4 * SPEED * slower) + weight

    return wanted, control


def _simulated(
    arm: Arm, control: Control, share: float, rng: np.random.Generator, reference: FloatArray | None
) -> Scene:
    """Runge-Kutta's fourth order over all logs side by side.

    The disturbance's size follows the drive's.
    """
    k, count = arm.constants(), round(DURATION / DT)
    size = share * np.sqrt(np.mean(_driven(k, control, count)[1] ** 2, axis=(1, 2)))
    return _with_noise(arm, *_driven(k, control, count, size, rng), rng, reference)


def _driven(
    k: FloatArray,
    control: Control,
    count: int,
    size: FloatArray | None = None,
    rng: np.random.Generator | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Angles and torques (2, n, N) with a disturbance of `size` (2,) N m."""
    state = np.concatenate([HANGING, np.zeros(2)])[:, None] * np.ones(LOGS)
    theta, tau = np.empty((2, LOGS, count)), np.empty((2, LOGS, count))
    keep = np.exp(-DT / PERSISTENCE)
    push = np.zeros((2, LOGS))

    def rate(x: FloatArray, place: int, extra: FloatArray) -> FloatArray:
        return np.concatenate([x[2:], forward_dynamics(k, x[:2], x[2:], control(place, x) + extra)])

    for step in range(count):
        theta[:, :, step], tau[:, :, step] = state[:2], control(2 * step, state)
        after = push
        if size is not None and rng is not None:
            fresh = np.sqrt(1 - keep**2) * rng.standard_normal((2, LOGS))
            after = keep * push + size[:, None] * fresh
        a = rate(state, 2 * step, push)
        b = rate(state + DT / 2 * a, 2 * step + 1, (push + after) / 2)
        c = rate(state + DT / 2 * b, 2 * step + 1, (push + after) / 2)
        d = rate(state + DT * c, 2 * step + 2, after)
        state = state + DT / 6 * (a + 2 * b + 2 * c + d)
        push = after
    return theta, tau


def _with_noise(
    arm: Arm,
    theta: FloatArray,
    tau: FloatArray,
    rng: np.random.Generator,
    reference: FloatArray | None,
) -> Scene:
    noise = SIGMA * rng.standard_normal((2, *theta.shape))
    angles, torques = theta + noise[0], tau + 10 * noise[1]
    wanted = None if reference is None else reference[..., : theta.shape[2]].swapaxes(0, 1)
    return Scene(arm, angles.swapaxes(0, 1), torques.swapaxes(0, 1), wanted)


def logs_of(made: Scene, *, reference: bool = False) -> list[Log]:
    """The scene's logs, with the reference if they shall hold it."""
    stamps = np.round(np.arange(made.theta.shape[2]) * DT * 1e9).astype(np.int64)
    found = []
    for n, (theta, tau) in enumerate(zip(made.theta, made.tau, strict=True)):
        asked = made.reference[n] if reference and made.reference is not None else None
        found.append(Log(stamps, theta, tau, Origin(f"run {n}", "csv", {}), reference=asked))
    return found


def evaluate(
    arms: int, *, feedback: bool, reference: bool = False, share: float = SHARE
) -> list[dict[str, object]]:
    """Coverage and mean bias of k1 … k5, and how often a warning says that the torque is
    endogenous.
    """
    inside, errors, warned, estimators = [], [], 0, []
    for number in range(arms):
        made = scene(number, feedback=feedback, share=share)
        result = identify(logs_of(made, reference=reference), report=False)
        truth = dict(zip(NAMES, made.arm.constants()[:5].tolist(), strict=True))
        warned += any(one.code in WARNINGS for one in result.notices if not one.note)
        estimators.append(result.estimator)
        for name in NAMES:
            found = result.parameters[name]
            low, high = found.ci95 or (None, None)
            if found.estimate is not None and low is not None and high is not None:
                inside.append(low <= truth[name] <= high)
                errors.append(100 * (found.estimate / truth[name] - 1))
    where = "PD + reference" if reference else "PD" if feedback else "open loop"
    return [
        {"what": f"{where}, {100 * share:g} %: coverage, %", "value": 100 * float(np.mean(inside))},
        {"what": f"{where}: mean bias, %", "value": float(np.mean(errors))},
        {"what": f"{where}: its error from arm to arm, %", "value": _error_of_mean(errors, arms)},
        {"what": f"{where}: RMS error, %", "value": float(np.sqrt(np.mean(np.square(errors))))},
        {"what": f"{where}: warned, of {arms}", "value": warned},
        {"what": f"{where}: estimators", "value": ", ".join(estimators)},
    ]


def _error_of_mean(errors: list[float], arms: int) -> float:
    """Standard error of the mean over arms, whose five constants err together."""
    by_arm = [float(np.mean(part)) for part in np.array_split(errors, arms)]
    return float(np.std(by_arm, ddof=1) / np.sqrt(arms)) if arms > 1 else float("nan")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", type=int, default=4)
    parser.add_argument("--share", type=float, default=SHARE)
    given = parser.parse_args()
    for feedback, reference in ((False, False), (True, False), (True, True)):
        for row in evaluate(given.arms, feedback=feedback, reference=reference, share=given.share):
            value = row["value"]
            shown = format(value, ".3g") if isinstance(value, float) else value
            print(f"{row['what']}: {shown}", flush=True)


if __name__ == "__main__":
    main()
