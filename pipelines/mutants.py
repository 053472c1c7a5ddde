"""How many small changes of the code the tests see: `make mutants`.

mutmut's operators change one operator, number, text or argument of a function. Of all such mutants
of a room a sample is drawn at a fixed seed: all of them would take days. Each is tried on the
room's tests, first on those that reach its line, until one fails or `BUDGET` is spent. Prints the
share that was killed by room, and every survivor as a patch, to be read: a survivor is a missing
test, or a change that changes nothing.
"""

from __future__ import annotations

import argparse
import difflib
import json
import random
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from libcst import Arg, MetadataWrapper, Module, parse_module
from libcst.metadata import ParentNodeProvider, PositionProvider
from mutmut.mutation.file_mutation import Mutation, MutationVisitor
from mutmut.mutation.mutators import mutation_operators
from mutmut.mutation.pragma_handling import IgnoredCode

FRONT = ("cli", "test_api.py", "test_verbs.py")
GOLDEN = ("golden",)
ROOMS: dict[str, tuple[str, ...]] = {
    "api": (
        *FRONT, "test_example.py", "fleet/test_command.py", "identification/test_validate.py",
        "inspection/test_commands.py",
    ),
    "arm": ("test_arm.py", *GOLDEN),
    "base": (
        "test_arrow.py", "test_compiled.py", "test_credentials.py", "test_quantiles.py",
        "test_significance.py", "test_staging.py", "test_stores.py", "test_units.py", "readers",
    ),
    "batches": ("batches",),
    "cli": FRONT,
    "designs": ("designs",),
    "estimators": (
        "estimators", "identification/test_same_log.py", "identification/test_validate.py", *GOLDEN,
    ),
    "exports": ("exports",),
    "fleet": ("fleet",),
    "identification": (
        "identification", "cli/test_commands.py", "designs/test_believed.py", *GOLDEN,
    ),
    "inspection": ("inspection", "identification/test_efforts.py"),
    "model": ("estimators/test_model.py", "estimators/test_acceleration.py", *GOLDEN),
    "notices": ("test_notices.py", "test_check.py", *FRONT),
    "options": FRONT,
    "physics": ("physics", "estimators/test_model.py", *GOLDEN),
    "profile": (*FRONT, "inspection/test_commands.py"),
    "readers": ("readers",),
    "report": ("report", "test_verbs.py"),
    "results": ("report", "identification/test_outcome.py", "test_check.py", "test_api.py",
        "test_tampered.py"),
    "settings": FRONT,
    "signals": ("signals", *GOLDEN),
    "synth": ("synth", "cli/test_ends.py"),
    "tracks": ("tracks",),
}  # fmt: skip
"""By room, the tests that are to see its mutants. Small rooms may be joined: `cli+settings`."""
USUAL = ("arm", "model", "estimators", "signals", "tracks", "fleet", "inspection")
COPIED = ("algid", "tests", "pipelines", "data", "README.md", "CHANGELOG.md", "LICENSE",
    "constraints.txt", "pyproject.toml")  # fmt: skip
TRIAL = (sys.executable, "-m", "pipelines.mutants_trial")
BUDGET = 20.0  # s of tests for a mutant
LIMIT = 4  # times as much processor time as its tests took: a mutant that takes more never ends


@dataclass(frozen=True)
class Mutant:
    """A change of one file; `name` is path, line and the number among the file's changes."""

    path: Path
    lines: range
    name: str
    module: Module
    change: Mutation

    @property
    def text(self) -> str:
        """The whole file as it is with the change."""
        whole: Any = self.module.deep_replace(self.change.original_node, self.change.mutated_node)
        return str(whole.code)

    @property
    def patch(self) -> str:
        """What changes, with a line about it."""
        both = (self.module.code.splitlines(), self.text.splitlines())
        return "\n".join(list(difflib.unified_diff(*both, lineterm="", n=1))[2:])


def mutants(path: Path) -> Iterator[Mutant]:
    """All mutants of a file's functions, save those without `zip`'s own check of lengths."""
    wrapper = MetadataWrapper(parse_module(path.read_text(encoding="utf-8")))
    positions = wrapper.resolve(PositionProvider)
    parents = wrapper.resolve(ParentNodeProvider)
    visitor = MutationVisitor(mutation_operators, IgnoredCode(set(), set(), set()))
    module = wrapper.visit(visitor)
    for number, change in enumerate(visitor.mutations):
        parent = parents[change.original_node]
        checks = isinstance(parent, Arg) and parent.keyword and parent.keyword.value == "strict"
        if change.contained_by_top_level_function is not None and not checks:
            place = positions[change.original_node]
            lines = range(place.start.line, place.end.line + 1)
            yield Mutant(path, lines, f"{path}:{lines[0]}:{number}", module, change)


def files(room: str) -> list[Path]:
    """The files of a room, or of several that are joined.

    Raises
    ------
    SystemExit
        Where there are none.
    """
    found: list[Path] = []
    for name in room.split("+"):
        own = sorted(Path("algid", name).rglob("*.py")) + sorted(Path("algid").glob(f"{name}.py"))
        if name not in ROOMS or not own:
            raise SystemExit(f"{name}: no room; mend ROOMS")
        found += own
    return found


def tests_of(room: str) -> list[str]:
    """The tests of a room.

    Raises
    ------
    SystemExit
        Where one is absent.
    """
    tests = [f"tests/{test}" for name in room.split("+") for test in ROOMS[name]]
    if absent := [test for test in tests if not Path(test).exists()]:
        raise SystemExit(f"{', '.join(absent)}: no such test; mend ROOMS")
    return list(dict.fromkeys(tests))


def chosen(mutant: Mutant, seconds: dict[str, float], lines: dict[str, list[str]]) -> list[str]:
    """Of the room's tests those that reach the mutant's lines first, then those that reach its
    file, then those beside them: what is reached on import, by a fixture or by another process is
    told of one test or of none. Quick ones come first, of many cases of a test some.
    """
    reach = {test for line in mutant.lines for test in lines.get(str(line), ())}
    file = {test for tests in lines.values() for test in tests}
    beside = {test.partition("::")[0] for test in file}
    order, cases = list[tuple[bool, bool, bool, float, str]](), Counter[str]()
    for test in sorted(seconds, key=seconds.__getitem__):
        own, name = test.partition("::")[0], test.partition("[")[0]
        cases[name] += 1
        far = (test not in reach, test not in file, own not in beside)
        order.append((*far, seconds[test] * cases[name], test))
    kept: list[str] = []
    spent = 0.0
    for *_, test in sorted(order):
        spent += seconds[test]
        if kept and spent > BUDGET:
            break
        kept.append(test)
    return kept


def recorded(folder: Path, tests: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The seconds of each test, by room, and the tests that reach each line of the rooms' files.

    Raises
    ------
    SystemExit
        Where the tests fail without a mutant.
    """
    sources = [str(path) for room in tests for path in files(room)]
    every = sorted({test for own in tests.values() for test in own})
    asked = json.dumps({"tests": every, "sources": sources})
    done = subprocess.run([*TRIAL, asked], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stdout[-3000:] + done.stderr[-1000:])
    known: dict[str, Any] = json.loads((folder / "reached.json").read_text(encoding="utf-8"))
    return known


def tried(
    folder: Path, drawn: list[Mutant], seconds: dict[str, float], lines: dict[str, Any]
) -> Iterator[tuple[Mutant, str]]:
    """Each mutant with its end as soon as that is known.

    Raises
    ------
    SystemExit
        Where the tests fail without a mutant, or the trial breaks off.
    """
    by_name = {mutant.name: mutant for mutant in drawn}
    with (folder / "jobs").open("w", encoding="utf-8") as jobs:
        for mutant in drawn:
            tests = chosen(mutant, seconds, lines.get(str(mutant.path), {}))
            job = {
                "name": mutant.name,
                "path": str(mutant.path),
                "text": mutant.text,
                "tests": tests,
                "limit": round(20 + LIMIT * sum(seconds[test] for test in tests)),
            }
            if mutant is drawn[0]:  # the same tests without a change
                text = mutant.module.code
                jobs.write(json.dumps(job | {"name": "nothing", "text": text}) + "\n")
            jobs.write(json.dumps(job) + "\n")
    with (folder / "jobs").open() as stdin:
        running = subprocess.Popen(
            TRIAL, cwd=folder, stdin=stdin, stdout=subprocess.PIPE, text=True
        )
        for line in running.stdout or ():
            name, end = line.split()
            if name in by_name:
                yield by_name[name], end
            elif end != "survived":
                running.terminate()
                raise SystemExit("tests fail in a fork without a mutant")
        if running.wait():
            raise SystemExit("the trial broke off: see above")


def main() -> None:
    """Draw mutants, try them, print the score; exit 1 where it is below what is asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", default=USUAL, metavar="ROOM")
    parser.add_argument("--count", type=int, default=100, help="mutants of a room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--asked", type=float, default=0.85)
    parser.add_argument("--folder", type=Path, default=Path("build/mutants"))
    parser.add_argument("--only", nargs="+", default=(), help="names of those that are to be tried")
    parser.add_argument("--tests", nargs="+", default=(), help="instead of the room's")
    options = parser.parse_args()
    shutil.rmtree(options.folder, ignore_errors=True)
    options.folder.mkdir(parents=True)
    for name in COPIED:
        source = Path(name)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, options.folder / name)
    tests = {room: list(options.tests) or tests_of(room) for room in options.rooms}
    below, known = False, recorded(options.folder, tests)
    for room in options.rooms:
        every = [mutant for path in files(room) for mutant in mutants(path)]
        drawn = random.Random(options.seed).sample(every, min(options.count, len(every)))
        if options.only:
            drawn = [mutant for mutant in every if mutant.name in options.only]
        ends: Counter[str] = Counter()
        own = tuple(tests[room])
        seconds = {test: took for test, took in known["seconds"].items() if test.startswith(own)}
        for mutant, end in tried(options.folder, drawn, seconds, known["lines"]):
            ends[end] += 1
            print(f"{ends.total()} of {len(drawn)}", end="\r", file=sys.stderr, flush=True)
            if end != "killed":
                print(f"# {mutant.name}: {end}\n{mutant.patch}\n", flush=True)
        share = 1 - ends["survived"] / ends.total()
        below |= share < options.asked
        print(
            f"{room}: killed {ends['killed']} and hung {ends['hung']} of {ends.total()}, drawn of "
            f"{len(every)} by seed {options.seed}: {100 * share:.0f} % (asked "
            f"{100 * options.asked:.0f} %)",
            flush=True,
        )
    raise SystemExit(below)


if __name__ == "__main__":
    main()
