"""What arms have and no term of the model is: seen in the residual, or silent: `make misfit`.

Each row is an error of the drive, in a share of the torque's RMS, unlogged, on logs of two arms
under a wide torque, by sensors with white noise; the motors overcome Coulomb friction too. It gives
how many results say that the model lacks something (REFUTED), how many are Good, how many
95 % intervals of k1 … k5 hold the truth, of all and of those that are Good, and the largest
distance of a Good one in standard deviations. The first row has no error: what it says is a false
alarm. Errors that the score test has no shape for are among them.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from algid.arm import FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.model import RIGID
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import HANGING, Driven, SimulatedMotion, steered
from pipelines.accuracy_scenes import case_of, logged
from pipelines.experiment import Seen, count, experiment, grid, judged, number, share

ARMS = ("case1", "arm22")
RATE, DURATION = 250.0, 8.0
SIGMA_THETA, SIGMA_TAU = 5e-4, 5e-3  # rad, and share of the torque's RMS
COULOMB, WIDTH = 0.05, 0.05  # of the torque's RMS, rad/s
Error = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]
"""Torque (2, M) in shares of the RMS `size` (2, 1), of angles, velocities and motors' torques."""
ERRORS: dict[str, Error] = {
    "gears that rub by the motor's torque": lambda _, w, u, size: (
        -np.abs(u) * np.tanh(w / WIDTH) / size
    ),
    "drag by the square of speed": lambda _, w, *__: -w * np.abs(w) / 50.0,
    "cogging, six a turn": lambda q, *_: np.sqrt(2) * np.sin(6 * q),
    "a cable's pull, twice a turn": lambda q, *_: np.sqrt(2) * np.sin(2 * q - 0.7),
    "friction that changes along a turn": lambda q, w, *_: (
        np.sqrt(2) * np.sin(q - 0.7) * np.tanh(w / WIDTH)
    ),
    "a belt that rubs on the other joint": lambda _, w, *__: -np.tanh((w - w[::-1]) / (2 * WIDTH)),
    "a spring from the hanging arm": lambda q, *_: HANGING[:, None] - q,
    "a driver's dead band": lambda _, __, u, size: -np.tanh(20 * u / size),
}
SHARES = (0.003, 0.01, 0.03)


def moved(name: str, error: str, share: float, seed: int) -> tuple[SimulatedMotion, FloatArray]:
    """The motion of an arm, and what its motors give (2, N) in N m."""
    arm = case_of(name).arm
    wide = wide_multi_sine(arm, seed)
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    motors = wide(t)
    size = np.sqrt(np.mean(motors**2, axis=1, keepdims=True))

    def controller(times: FloatArray) -> Driven:
        acting = wide(times)

        def torque(theta: FloatArray, omega: FloatArray) -> FloatArray:
            own = -COULOMB * np.tanh(omega / WIDTH)
            if error in ERRORS:
                own = own + share * ERRORS[error](theta, omega, acting, size)
            return np.asarray(acting + size * own)

        return torque

    return steered(arm.constants(), controller, t, HANGING), motors


def log_of(name: str, error: str, share: float, seed: int) -> Log:
    """One draw: the motors' torque is logged."""
    motion, motors = moved(name, error, share, seed)
    rng = np.random.default_rng([seed, sum(name.encode()), sum(error.encode())])
    size = np.sqrt(np.mean(motors**2, axis=1, keepdims=True))
    return logged(motion.t, motion.theta, motors, rng, (SIGMA_THETA, SIGMA_TAU * size))


def draw(error: str, share: float, name: str, seed: int) -> Seen:
    """What became of one draw, and of it again where it is Good."""
    result = identify(log_of(name, error, share, seed), report=False)
    seen = judged(result, dict(zip(RIGID, case_of(name).arm.constants(), strict=False)))
    if result.verdict.grade == "good":
        seen |= {f"{key}, Good": seen[key] for key in ("held", "z")}
    return seen


if __name__ == "__main__":
    rows = {"nothing": ("nothing", 0.0)}
    rows |= {f"{one}, {100 * size:g} %": (one, size) for one, size in product(ERRORS, SHARES)}
    columns = {
        "draws": count("draw"),
        "said": count("REFUTED"),
        "Good": count("good"),
        "held": share("held"),
        "held of Good": share("held, Good"),
        "farthest of Good, σ": number("z, Good", np.max),
        "error, %": number("error", lambda errors: np.median(np.abs(errors)), 100),
    }
    experiment("misfit", __doc__, grid(rows, ARMS), draw, columns)
