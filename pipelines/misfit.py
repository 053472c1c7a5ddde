"""What arms have and no term of the model is: seen in the residual, or silent: `make misfit`.

Each row is an error of the drive, in a share of the torque's RMS, unlogged, on logs of two arms
under a wide torque, by sensors with white noise; the motors overcome Coulomb friction too. It gives
how many results say that the model lacks something (REFUTED), how many are Good, how many
95 % intervals of k1 … k5 hold the truth, of all and of those that are Good, and the largest
distance of a Good one in standard deviations. The first row has no error: what it says is a false
alarm. Errors that the score test has no shape for are among them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from algid.arm import FloatArray
from algid.identification.identify import identify
from algid.log import Log, Origin, Reading
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import HANGING, Driven, SimulatedMotion, steered
from pipelines.accuracy_scenes import case_of
from pipelines.experiment import experiment

ARMS = ("case1", "arm22")
RATE, DURATION = 250.0, 8.0
SIGMA_THETA, SIGMA_TAU = 5e-4, 5e-3  # rad, and share of the torque's RMS
COULOMB, WIDTH = 0.05, 0.05  # of the torque's RMS, rad/s
Error = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]
"""Torque (2, M) in shares of the RMS `size` (2, 1), of angles, velocities and motors' torques."""


def _gears(_q: FloatArray, w: FloatArray, u: FloatArray, size: FloatArray) -> FloatArray:
    return -np.abs(u) * np.tanh(w / WIDTH) / size


def _drag(_q: FloatArray, w: FloatArray, _u: FloatArray, _size: FloatArray) -> FloatArray:
    return -w * np.abs(w) / 50.0


def _cogging(q: FloatArray, _w: FloatArray, _u: FloatArray, _size: FloatArray) -> FloatArray:
    return np.sqrt(2) * np.sin(6 * q)


def _cable(q: FloatArray, _w: FloatArray, _u: FloatArray, _size: FloatArray) -> FloatArray:
    return np.sqrt(2) * np.sin(2 * q - 0.7)


def _bearing(q: FloatArray, w: FloatArray, _u: FloatArray, _size: FloatArray) -> FloatArray:
    return np.sqrt(2) * np.sin(q - 0.7) * np.tanh(w / WIDTH)


def _belt(_q: FloatArray, w: FloatArray, _u: FloatArray, _size: FloatArray) -> FloatArray:
    return -np.tanh((w - w[::-1]) / (2 * WIDTH))


ERRORS: dict[str, Error] = {
    "gears that rub by the motor's torque": _gears,
    "drag by the square of speed": _drag,
    "cogging, six a turn": _cogging,
    "a cable's pull, twice a turn": _cable,
    "friction that changes along a turn": _bearing,
    "a belt that rubs on the other joint": _belt,
}
SHARES = (0.003, 0.01, 0.03)
ROWS: tuple[tuple[str, float], ...] = (
    ("nothing", 0.0),
    *((name, share) for name in ERRORS for share in SHARES),
)


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
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(motors.shape)
    tau = motors + SIGMA_TAU * size * rng.standard_normal(motors.shape)
    origin = Origin(f"{name}.csv", "csv", {}, reading=Reading(accepted=("DEGREES",)))
    return Log(np.round(motion.t * 1e9).astype(np.int64), theta, tau, origin)


def judged(job: tuple[str, str, float, int]) -> Counter[str]:
    """What became of the draws of an arm."""
    name, error, share, draws = job
    true = case_of(name).arm.constants()
    total: Counter[str] = Counter()
    for seed in range(draws):
        result = identify(log_of(name, error, share, seed), report=False)
        codes = {notice.code for notice in result.notices}
        good = result.verdict.grade == "good"
        total.update(draws=1, said=bool(codes & {"REFUTED"}), good=good)
        for number in range(5):
            one = result.parameters[f"k{number + 1}"]
            if not one.usable or one.estimate is None or not one.std or one.ci95 is None:
                continue
            held = one.ci95[0] <= true[number] <= one.ci95[1]
            total.update(told=1, held=held)
            if good:
                total.update({"told good": 1, "held good": held})
                far = abs(one.estimate - true[number]) / one.std
                total["far"] = max(total["far"], round(10 * far))
    return total


def lines(draws: int, pool: ProcessPoolExecutor) -> Iterator[str]:
    """The table, row by row."""
    yield "| error | share | draws | said | Good | held | held of Good | farthest of Good, σ |"
    yield f"|{'---|' * 8}"
    for error, share in ROWS:
        jobs = [(name, error, share, draws) for name in ARMS]
        total: Counter[str] = Counter()
        farthest = 0
        for of_arm in pool.map(judged, jobs):
            farthest = max(farthest, of_arm.pop("far", 0))
            total.update(of_arm)
        cells = [
            f"{100 * share:g} %",
            str(total["draws"]),
            str(total["said"]),
            str(total["good"]),
            f"{total['held']}/{total['told']}",
            f"{total['held good']}/{total['told good']}",
            f"{farthest / 10:.1f}",
        ]
        yield f"| {error} | {' | '.join(cells)} |"


if __name__ == "__main__":
    experiment("misfit", __doc__, lines, 10, "arm and row")
