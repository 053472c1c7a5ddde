"""How many small changes of the code the tests see: `make mutants`.

mutmut changes one operator, number or argument at a time in the rooms whose numbers are believed, and runs the tests
that touch the changed function, the quickest first. Of all mutants a sample is drawn room by room at a fixed seed: one
for each is worth what it would catch, and all of them would take days. Prints the share that was killed, and every
survivor as a patch, to be read: a survivor is a missing test, or a change that changes nothing.
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
from pathlib import Path

CODE = (
    *("arm", "model", "units", "check", "batch/plan"),
    *(f"{room}/*" for room in ("estimators", "signals", "track", "fleet", "inspection")),
)
TESTS = (
    *("test_arm.py", "test_check.py", "estimators", "signals", "track", "fleet", "inspection"),
    *("identification/test_identify.py", "readers/test_profile.py", "batch/test_run.py"),
)
COPIED = ("tests", "pipelines", "data", "README.md", "CHANGELOG.md", "LICENSE", "constraints.txt")
KILLED = {1, 3, 24, 36, -9, -11, -24}  # a test failed, the tests ended early, or they took far too long
Names = dict[str, int | None]


def prepare(folder: Path) -> None:
    """Make a copy of the project in `folder` that mutmut can work on."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("algid", *COPIED):
        source = Path(name)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)
    tests = [f"tests/{name}" for name in TESTS if Path("tests", name).exists()]
    options = {
        "source_paths": ["algid"],
        "only_mutate": [f"algid/{name}" if name.endswith("*") else f"algid/{name}.py" for name in CODE],
        "also_copy": list(COPIED),
        "pytest_add_cli_args": ["-p", "no:xdist", "-o", "addopts=-q -m 'not slow'", "-o", "filterwarnings="],
        "pytest_add_cli_args_test_selection": tests,
        "use_git_change_detection": False,
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in options.items()]
    text = Path("pyproject.toml").read_text(encoding="utf-8")
    (folder / "pyproject.toml").write_text(text + "\n[tool.mutmut]\n" + "\n".join(lines) + "\n", encoding="utf-8")


def found(folder: Path) -> Names:
    """Exit codes by the mutants' names; None for one that has not been tried."""
    names: Names = {}
    for path in sorted((folder / "mutants").rglob("*.py.meta")):
        names |= json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"]
    return names


def room(name: str) -> str:
    """The room of a mutant."""
    parts = name.split(".")
    return parts[1] if len(parts) > 2 else parts[0]


def sample(names: Names, count: int, seed: int) -> list[str]:
    """About `count` of the names, each room's share its share of all mutants, at least two."""
    by_room: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names):
        by_room[room(name)].append(name)
    draw = random.Random(seed)
    shares = {key: max(2, round(count * len(own) / len(names))) for key, own in by_room.items()}
    return [name for key, own in by_room.items() for name in draw.sample(own, min(shares[key], len(own)))]


def main() -> None:
    """Draw mutants, try them, print the score; exit 1 where it is below what is asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--asked", type=float, default=0.85)
    parser.add_argument("--folder", type=Path, default=Path("build/mutants"))
    options = parser.parse_args()
    prepare(options.folder)
    mutmut = [str(Path(sys.executable).with_name("mutmut"))]
    # A name that none has: the mutants are made and the tests timed, nothing more.
    subprocess.run([*mutmut, "run", "none of them"], cwd=options.folder, check=False, capture_output=True)
    drawn = sample(found(options.folder), options.count, options.seed)
    subprocess.run([*mutmut, "run", *drawn], cwd=options.folder, check=True, stdout=subprocess.DEVNULL)
    codes = found(options.folder)
    tried = [name for name in drawn if codes[name] is not None]
    killed = Counter(room(name) for name in tried if codes[name] in KILLED)
    for key, number in sorted(Counter(map(room, tried)).items()):
        print(f"{key:12} {killed[key]:3} of {number:3}")
    for name in tried:
        if codes[name] not in KILLED:
            shown = subprocess.run([*mutmut, "show", name], cwd=options.folder, capture_output=True, text=True)
            print(re.sub(r"^(?![-+@]).*\n", "", shown.stdout, flags=re.MULTILINE), end="")
            print(f"# {name}: {'no test' if codes[name] == 33 else 'survived'}\n")
    share = killed.total() / len(tried)
    print(f"killed {killed.total()} of {len(tried)}: {100 * share:.0f} % (asked {100 * options.asked:.0f} %)")
    raise SystemExit(0 if share >= options.asked else 1)


if __name__ == "__main__":
    main()
