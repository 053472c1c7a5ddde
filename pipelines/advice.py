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
(acrobot, pendubot), a joint held still in each of two logs, or friction of real joints. Writes
`advice.md` into the output folder.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from unittest.mock import patch

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.errors import AlgidError
from algid.base.exits import Exit
from algid.cli.app import called
from algid.results import Result, read_result
from algid.results.verdict import CAUSES, again
from algid.synth.excitation import Torque, wide_multi_sine
from algid.synth.simulator import HANGING, Driven, steered
from pipelines.accuracy_scenes import case_of

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

Pair = tuple[FloatArray, FloatArray]
Spoil = Callable[[FloatArray, FloatArray], Pair]


def _turned(off1: float = 0.0, off2: float = 0.0) -> Spoil:
    return lambda th, ta: (th - np.array([[off1], [off2]]), ta)


def _signed(angles: tuple[int, int], torques: tuple[int, int]) -> Spoil:
    return lambda th, ta: (th * np.array(angles)[:, None], ta * np.array(torques)[:, None])


SPOILS: dict[str, Spoil] = {
    "nothing": _turned(),
    "seen from behind": _signed((-1, -1), (-1, -1)),
    "torques turned": _signed((1, 1), (-1, -1)),
    "joint 2 turned": _signed((1, -1), (1, -1)),
    "zero hanging": _turned(-np.pi / 2),
    "zero upright": _turned(np.pi / 2),
    "zero upright, from behind": lambda th, ta: (-(th - np.array([[np.pi / 2], [0.0]])), -ta),
    "zero of θ1 off by 70°": _turned(np.radians(70)),
    "θ2 absolute": lambda th, ta: (np.stack([th[0], th[0] + th[1]]), ta),
}
KINDS = ("both motors", "acrobot", "pendubot", "a joint each", "real friction")


@dataclass(frozen=True)
class Outcome:
    """What a command left: its exit, what it printed, and its result where it wrote one."""

    code: int
    text: str
    result: Result | None


@dataclass(frozen=True)
class Line:
    """A row of the table."""

    cells: tuple[str, ...]
    passed: bool
    right: int
    advised: int

    def __str__(self) -> str:
        return f"| {' | '.join(self.cells)} | {'yes' if self.passed else 'NO'} |"


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


def written(folder: Path, kind: str, arm: str, title: str, spoil: Spoil) -> None:
    """The logs, with the noise of row `title` and spoiled by `spoil`, as files."""
    for log in range(_count(kind)):
        rng = np.random.default_rng([log, sum(arm.encode()), sum(title.encode())])
        t, theta, tau = driven(kind, arm, log)
        tau = np.where(tau != 0, tau + SIGMA_TAU * rng.standard_normal(tau.shape), 0.0)
        theta = theta + SIGMA_THETA * rng.standard_normal(theta.shape)
        columns = np.column_stack([t, *(row for pair in spoil(theta, tau) for row in pair)])
        header = "t,theta1,theta2,tau1,tau2"
        np.savetxt(
            folder / f"log{log}.csv", columns, delimiter=",", header=header, comments="", fmt="%.9g"
        )


def _count(kind: str) -> int:
    """Logs of an arm."""
    return 2 if kind == "a joint each" else 1


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
            code = called(words[1:])
        except AlgidError as error:
            print(error)
            code = Exit.USAGE
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
            command = shlex.split(again(outcome.result, remedy.flags))
            if remedy.complete and command not in found.values():
                found[f"{reason.code}: {' '.join(remedy.flags)}"] = command
    return found


def furthest(result: Result | None, k: FloatArray, names: tuple[str, ...]) -> float:
    """Largest error in standard deviations of what is identified; infinite without a result."""
    if result is None:
        return np.inf
    true = dict(zip(CONSTANT_NAMES, k.tolist(), strict=True))
    errors = []
    for name in names:
        one = result.parameters[name]
        if one.estimate is not None and one.std:
            errors.append(abs(one.estimate - true[name]) / one.std)
    return max(errors, default=np.inf)


def row(job: tuple[str, str, str]) -> Line:
    """One spoiled arm: its advices and what they lead to."""
    kind, arm, title = job
    k = case_of(arm).arm.constants()
    # what real joints rub is no viscous friction, and no constant of the arm
    names = CONSTANT_NAMES[:5] if kind == "real friction" else CONSTANT_NAMES
    limit = WITHIN
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        words = ["algid", "identify", *(str(folder / f"log{n}.csv") for n in range(_count(kind)))]
        words += ["--no-report", "-o", str(folder), "--accept", "DEGREES"]
        if kind in ("acrobot", "pendubot"):
            words += ["--set", f"passive={1 if kind == 'acrobot' else 2}"]
        if kind == "real friction":
            written(folder, kind, arm, title, SPOILS["nothing"])
            limit = max(WITHIN, ALIKE * furthest(run(words, folder).result, k, names))
            words.append("--force")
        written(folder, kind, arm, title, SPOILS[title])
        first = run(words, folder)
        told, right = [], 0
        for advice, command in advices(words, first).items():
            then = run(command, folder)
            if command[1] == "inspect":
                right += then.code != Exit.USAGE
                told.append(f"inspect → exit {then.code}")
                continue
            far = furthest(then.result, k, names)
            again = command in advices(command, then).values()
            right += then.code in (Exit.OK, Exit.DATA_LOST) and far <= limit and not again
            told.append(f"{advice} → exit {then.code}, {far:.2g} σ{', again' if again else ''}")
    far = furthest(first.result, k, names)
    verdict = "refused" if first.result is None else first.result.verdict.word
    passed = right == len(told) and (bool(told) or far <= limit or first.code != 0)
    read = f"exit {first.code}, {verdict}, {far:.2g} σ"
    return Line((kind, title, arm, read, "; ".join(told) or "–"), passed, right, len(told))


def lines(arms: tuple[str, ...], kinds: tuple[str, ...], processes: int) -> Iterator[Line]:
    """The table's rows."""
    jobs = [(kind, arm, title) for kind, title, arm in product(kinds, SPOILS, arms)]
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(row, jobs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="+", default=ARMS)
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/conventions"))
    given = parser.parse_args()
    text = ["| logs | spoiled | arm | as read | advices | passes |", f"|{'---|' * 6}"]
    right, advised, silent = 0, 0, 0
    for line in lines(tuple(given.arms), tuple(given.kinds), given.processes):
        text.append(str(line))
        right += line.right
        advised += line.advised
        silent += not (line.passed or line.advised)
        print(line, flush=True)
    summary = f"{right} of {advised} advices are right"
    text += ["", f"{summary}; {silent} of {len(text) - 2} rows end wrong without one."]
    print(text[-1])
    given.output.mkdir(parents=True, exist_ok=True)
    (given.output / "advice.md").write_text("\n".join([*text, ""]), encoding="utf-8")
    raise SystemExit(right < ENOUGH * advised or silent > 0)


if __name__ == "__main__":
    main()
