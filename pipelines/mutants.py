"""How many small changes of the code the tests see: `make mutants`.

mutmut changes one operator, number or argument at a time in the rooms whose numbers are believed,
and runs tests that touch the changed function: those of its module, then of its room, then others,
as many as `BUDGET` holds. Of all mutants a sample is drawn room by room at a fixed seed: one for
each is worth what it would catch, and all of them would take days. Prints the share that was
killed, and every survivor as a patch, to be read: a survivor is a missing test, or a change that
changes nothing.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from pipelines.mutants_trial import PYTEST

ROOMS: dict[str, tuple[str, ...]] = {
    "arm": ("test_arm.py", "golden"),
    "model": ("estimators/test_model.py", "golden"),
    "check": ("test_check.py",),
    "base": ("test_units.py", "test_compiled.py", "test_staging.py", "test_stores.py"),
    "batches": ("batches",),
    "cli": ("cli",),
    "designs": ("designs",),
    "estimators": ("estimators", "golden"),
    "exports": ("exports",),
    "fleet": ("fleet",),
    "identification": ("identification", "golden"),
    "inspection": ("inspection", "golden"),
    "physics": ("physics", "estimators/test_model.py", "golden"),
    "readers": ("readers", "golden"),
    "report": ("report", "test_verbs.py"),
    "signals": ("signals", "golden"),
    "synth": ("synth", "cli/test_ends.py"),
    "tracks": ("tracks",),
}
"""By room, the tests that are to see its mutants; those in which a mutant's code is not reached
are not run."""
USUAL = ("arm", "model", "check", "estimators", "signals", "tracks", "fleet", "inspection")
COPIED = ("tests", "pipelines", "data", "README.md", "CHANGELOG.md", "LICENSE", "constraints.txt")
BUDGET = 20.0  # s of tests for a mutant
STATS = "mutants/mutmut-stats.json"  # which tests touch what, and how long they take
LIMIT = 4  # times as much processor time as its tests took: a mutant that takes more never ends


def prepare(folder: Path, rooms: Sequence[str]) -> None:
    """Make a copy of the project in `folder` in which mutmut can work on `rooms`."""
    patterns = [
        f"algid/{name}/*" if Path("algid", name).is_dir() else f"algid/{name}.py" for name in rooms
    ]
    selection = sorted({test for name in rooms for test in ROOMS[name]})
    nothing = [name for name in patterns if not any(Path().glob(name))]
    nothing += [f"tests/{name}" for name in selection if not Path("tests", name).exists()]
    if nothing:
        raise SystemExit(f"{', '.join(nothing)}: names nothing; mend ROOMS")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("algid", *COPIED):
        source = Path(name)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)
    options = {
        "source_paths": ["algid"],
        "only_mutate": patterns,
        "also_copy": list(COPIED),
        "pytest_add_cli_args": PYTEST,
        "pytest_add_cli_args_test_selection": [f"tests/{name}" for name in selection],
        "use_git_change_detection": False,
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in options.items()]
    text = Path("pyproject.toml").read_text(encoding="utf-8")
    (folder / "pyproject.toml").write_text(
        text + "\n[tool.mutmut]\n" + "\n".join(lines) + "\n", encoding="utf-8"
    )


def chosen(tests: list[str], seconds: dict[str, float], name: str) -> list[str]:
    """Of the tests that touch a mutant those of its module first, then those of its room, within
    `BUDGET`.
    """
    module, own = name.split(".")[-2], room(name)
    named = (f"test_{module}.py", f"test_{module}s.py")
    kept: list[str] = []
    spent = 0.0

    def far(test: str) -> tuple[bool, bool, float]:
        file = test.partition("::")[0]
        return (
            not file.endswith(named),
            not file.startswith((f"tests/{own}/", f"tests/test_{own}")),
            seconds[test],
        )

    for test in sorted(tests, key=far):
        spent += seconds[test]
        if kept and spent > BUDGET:
            break
        kept.append(test)
    return kept


def names_in(folder: Path) -> list[str]:
    """The mutants' names."""
    metas = sorted((folder / "mutants").rglob("*.py.meta"))
    return [
        name
        for path in metas
        for name in json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"]
    ]


def jobs(folder: Path, drawn: list[str]) -> Iterator[tuple[str, list[str], int]]:
    """Each mutant with its tests, by name, and the seconds of processor time that they may take."""
    known = json.loads((folder / STATS).read_text(encoding="utf-8"))
    seconds = known["duration_by_test"]
    for name in drawn:
        touching = known["tests_by_mangled_function_name"].get(name.rpartition("__mutmut_")[0], [])
        tests = chosen(touching, seconds, name)
        yield name, tests, round(20 + LIMIT * sum(seconds[test] for test in tests))


def tried(folder: Path, drawn: list[str]) -> Iterator[tuple[str, str]]:
    """Each mutant with its end as soon as that is known: ``killed``, ``survived`` or
    ``no test``.

    Raises
    ------
    SystemExit
        Where the trial breaks off.
    """
    known = list(jobs(folder, drawn))
    yield from ((name, "no test") for name, tests, _ in known if not tests)
    lines = "".join(json.dumps(job) + "\n" for job in known if job[1])
    (folder / "jobs").write_text(lines, encoding="utf-8")
    trial = [sys.executable, "-m", "pipelines.mutants_trial"]
    with (folder / "jobs").open() as stdin:
        running = subprocess.Popen(
            trial, cwd=folder / "mutants", stdin=stdin, stdout=subprocess.PIPE, text=True
        )
        for line in running.stdout or ():
            name, code = line.split()
            yield name, "survived" if code == "0" else "killed"
        if running.wait():
            raise SystemExit("the trial broke off: see above")


def room(name: str) -> str:
    """The room of a mutant."""
    parts = name.split(".")
    return parts[1] if len(parts) > 2 else parts[0]


def sample(names: list[str], count: int, seed: int) -> list[str]:
    """About `count` of the names, each room's share its share of all mutants, at least two."""
    by_room: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names):
        by_room[room(name)].append(name)
    draw = random.Random(seed)
    shares = {key: max(2, round(count * len(own) / len(names))) for key, own in by_room.items()}
    return [
        name
        for key, own in by_room.items()
        for name in draw.sample(own, min(shares[key], len(own)))
    ]


def main() -> None:
    """Draw mutants, try them, print the score; exit 1 where it is below what is asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", default=USUAL, metavar="ROOM")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--asked", type=float, default=0.85)
    parser.add_argument("--folder", type=Path, default=Path("build/mutants"))
    parser.add_argument(
        "--again", action="store_true", help="draw from the mutants that FOLDER holds from before"
    )
    options = parser.parse_args()
    mutmut = [str(Path(sys.executable).with_name("mutmut"))]
    if not options.again:
        prepare(options.folder, options.rooms)
        # A name that none has: the mutants are made and the tests timed, nothing more.
        timed = subprocess.run(
            [*mutmut, "run", "none of them"], cwd=options.folder, capture_output=True, text=True
        )
        if not (options.folder / STATS).exists():
            raise SystemExit(f"{timed.stdout[-3000:]}\nthe tests fail before a mutant is tried")
    drawn = sample(names_in(options.folder), options.count, options.seed)
    ends: dict[str, str] = {}
    for name, end in tried(options.folder, drawn):
        ends[name] = end
        print(f"{len(ends)} of {len(drawn)}", end="\r", file=sys.stderr, flush=True)
        if end != "killed":
            shown = subprocess.run(
                [*mutmut, "show", name], cwd=options.folder, capture_output=True, text=True
            )
            print(re.sub(r"^(?![-+@]).*\n", "", shown.stdout, flags=re.MULTILINE), end="")
            print(f"# {name}: {end}\n", flush=True)
    killed = Counter(room(name) for name, end in ends.items() if end == "killed")
    for key, number in sorted(Counter(map(room, ends)).items()):
        print(f"{key:12} {killed[key]:3} of {number:3}")
    share = killed.total() / len(ends)
    print(
        f"killed {killed.total()} of {len(ends)}: {100 * share:.0f} % (asked "
        f"{100 * options.asked:.0f} %)"
    )
    raise SystemExit(0 if share >= options.asked else 1)


if __name__ == "__main__":
    main()
