"""Whether every advice that algid prints, applied as it is printed, ends in a right answer: a part
of `make conventions`.

Arms are simulated, their logs written as CSV files, spoiled by one mistake, and identified by the
command line. The command that is printed, and a command for every remedy of a cause, are then run
as they are typed. An advice is right where it ends in exit 0 or 4 with every constant within
`WITHIN` standard deviations of the truth, and does not ask for itself again; one to inspect the log
is, where that reads it. A row without an advice passes if the result is right, or exits with
another code. At least `ENOUGH` of the advices have to be right, and no row may end wrong without
one. Friction of real joints is no model's: there a mend has to bring back what
the log says unspoiled, where that is further off. Arms have motors at both joints, one motor
(acrobot, pendubot), a joint held still in each of two logs, or friction of real joints.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np
import polars as pl

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.errors import Exit
from algid.cli.app import run as run_command
from algid.model import RIGID
from algid.results import Result, read_result
from algid.results.verdict import CAUSES, again
from algid.synth.excitation import Torque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, steered
from pipelines import conventions
from pipelines.accuracy_scenes import case_of
from pipelines.experiment import Seen, count, experiment, grid, judged, words

ARMS = ("case1", "arm21", "arm22")
RATE, DURATION = 250.0, 8.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
WITHIN = 3.0  # σ
ENOUGH = 0.95  # of the advices
ALIKE = 1.1  # times the error of the log unspoiled: by rounding and the search of terms
COULOMB, STRIBECK, LOAD = 0.05, 0.03, 0.03  # of the torque's RMS; of the torque at the moment
WIDTH, STRIBECK_SPEED = 0.05, 0.3  # rad/s
HELD = np.array([400.0, 40.0])  # N m/rad and N m s/rad that hold a joint, by its inertia
ADVISED = re.compile(r"--set passive=\d|--set \w+\.unit=\"?deg\"?|--angle-unit deg")

SPOILS = {
    title: conventions.SPOILS[title]
    for title in (
        *("nothing", "all signs", "both torques", "joint 2", "zero hanging", "zero upright"),
        "θ2 absolute",
    )
} | {
    "zero upright, from behind": lambda a, b, s, t: (np.pi / 2 - a, -b, -s, -t),
    "zero of θ1 off by 70°": lambda a, b, s, t: (a - np.radians(70), b, s, t),
}
KINDS = ("both motors", "acrobot", "pendubot", "a joint each", "real friction")


@dataclass(frozen=True)
class Outcome:
    """What a command left: its exit, what it printed, and its result where it wrote one."""

    code: int
    text: str
    result: Result | None


def friction(torque: FloatArray, omega: FloatArray, size: FloatArray) -> FloatArray:
    """Coulomb, Stribeck and load-dependent friction (2, M) of joints of torque `size` (2,) RMS."""
    dry = COULOMB + STRIBECK * np.exp(-((omega / STRIBECK_SPEED) ** 2))
    sized = dry * size[:, None] + LOAD * np.abs(torque)
    return np.asarray(sized * np.tanh(omega / WIDTH))


def driven(kind: str, arm: str, log: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (N,), angles and logged torques (2, N) of one log of an arm, without noise."""
    own = case_of(arm).arm
    k = own.constants()
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    wide: Torque = wide_multi_sine(own, sum(arm.encode()) + 17 * log)
    size = np.sqrt(np.mean(wide(t) ** 2, axis=1))
    motors = {"acrobot": (0.0, 1.0), "pendubot": (1.0, 0.0)}.get(kind, (1.0, 1.0))
    held = 1 - log if kind == "a joint each" else None
    stiff = HELD[:, None] * np.array([k[4] + k[2], k[2]])

    def torques(times: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        asked = wide(times) * np.array(motors)[:, None]

        def at(theta: FloatArray, omega: FloatArray) -> FloatArray:
            torque = asked.copy()
            if held is not None:
                turned = theta[held] - HANGING[held]
                torque[held] = -stiff[0, held] * turned - stiff[1, held] * omega[held]
            return torque

        return at

    def controller(times: FloatArray) -> Driven:
        commanded = torques(times)
        if kind != "real friction":
            return commanded
        return lambda theta, omega: (
            commanded(theta, omega) - friction(commanded(theta, omega), omega, size)
        )

    motion = steered(k, controller, t, HANGING)
    return t, motion.theta, torques(t)(motion.theta, motion.omega)


def written(folder: Path, kind: str, arm: str, title: str, spoil: str, logs: int) -> None:
    """The logs, with the noise of row `title` and spoiled by `spoil`, as files."""
    for log in range(logs):
        rng = np.random.default_rng([log, sum(arm.encode()), sum(title.encode())])
        t, theta, tau = driven(kind, arm, log)
        tau = np.where(tau != 0, tau + SIGMA_TAU * rng.standard_normal(tau.shape), 0.0)
        theta = theta + SIGMA_THETA * rng.standard_normal(theta.shape)
        names = ("t", "theta1", "theta2", "tau1", "tau2")
        columns = dict(zip(names, (t, *SPOILS[spoil](*theta, *tau)), strict=True))
        pl.DataFrame(columns).write_csv(folder / f"log{log}.csv")


def run(words: list[str], folder: Path) -> Outcome:
    """A command of algid's, and the result that it left in `folder`."""
    printed = io.StringIO()
    code = 0
    for old in folder.glob("*.algid/result.json"):
        old.unlink()
    with (
        patch.object(sys, "argv", words),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(printed),
    ):
        try:
            code = run_command(words[1:])
        except SystemExit as end:
            code = int(end.code or 0)
    found = next(iter(folder.glob("*.algid/result.json")), None)
    return Outcome(code, printed.getvalue(), None if found is None else read_result(found))


def advices(words: list[str], outcome: Outcome) -> dict[str, list[str]]:
    """Every complete advice of an outcome: what it adds, and the command."""
    if outcome.result is None:
        flags = ADVISED.search(outcome.text)
        return {} if flags is None else {flags[0]: [*words, *shlex.split(flags[0]), "--force"]}
    found = {}
    verdict = outcome.result.verdict
    if verdict.command is not None:
        found["run first"] = shlex.split(verdict.command)
    for reason in verdict.reasons:
        for remedy in reason.remedies if reason.code in CAUSES else ():
            command = shlex.split(str(again(outcome.result, remedy)))
            if remedy.complete and command not in found.values():
                found[f"{reason.code}: {' '.join(remedy.flags)}"] = command
    return found


def furthest(result: Result | None, truth: dict[str, float]) -> float:
    """Largest error in standard deviations of what is identified; infinite without a result."""
    return max(judged(result, truth)["z"], default=np.inf) if result else np.inf


def draw(kind: str, title: str, arm: str, _: int) -> Seen:
    """One spoiled arm: its advices and what they lead to."""
    # what real joints rub is no viscous friction, and no constant of the arm
    names = RIGID if kind == "real friction" else CONSTANT_NAMES
    truth = dict(zip(names, case_of(arm).arm.constants().tolist(), strict=False))
    limit, logs = WITHIN, 2 if kind == "a joint each" else 1
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        call = ["algid", "identify", *(str(folder / f"log{n}.csv") for n in range(logs))]
        call += ["--no-report", "-o", str(folder), "--accept", "DEGREES"]
        if kind in ("acrobot", "pendubot"):
            call += ["--set", f"passive={1 if kind == 'acrobot' else 2}"]
        if kind == "real friction":
            written(folder, kind, arm, title, "nothing", logs)
            limit = max(WITHIN, ALIKE * furthest(run(call, folder).result, truth))
            call.append("--force")
        written(folder, kind, arm, title, title, logs)
        first = run(call, folder)
        right, told = [], []
        for advice, command in advices(call, first).items():
            then = run(command, folder)
            if command[1] == "inspect":
                right.append(then.code != Exit.USAGE)
                told.append(f"inspect → exit {then.code}")
                continue
            far = furthest(then.result, truth)
            again = command in advices(command, then).values()
            right.append(then.code in (Exit.OK, Exit.DATA_LOST) and far <= limit and not again)
            told.append(f"{advice} → exit {then.code}, {far:.2g} σ{', again' if again else ''}")
    far = furthest(first.result, truth)
    silent = not right and far > limit and first.code == 0
    wrong = [f"({arm}: exit {first.code}, {far:.2g} σ; {'; '.join(told)})"]
    return {"right": right, "silent": [silent], "not": [] if all(right) and not silent else wrong}


if __name__ == "__main__":
    rows = {f"{kind}, {title}": (kind, title) for kind, title in product(KINDS, SPOILS)}
    columns = {
        "advices": lambda seen: str(len(seen["right"])),
        "right": count("right"),
        "wrong without one": count("silent"),
        "which": words("not"),
    }
    every = experiment("advice", __doc__, grid(rows, ARMS), draw, columns, draws=1)
    raise SystemExit(np.mean(every["right"]) < ENOUGH or any(every["silent"]))
