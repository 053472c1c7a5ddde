"""The size of the house beside its budget: syntax nodes, code lines and files, and how many ideas.

A node is one of `ast.walk`: neither long lines nor short names change it. Code lines are those of
`ast.unparse` without docstrings. Ideas are counted by the names and loops that carry them, options
and commands by what `--help` prints.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from algid.notices import messages

BUDGETS = {
    "input, output, batches": (57_000, 50),
    "face": (57_000, 58),
    "core": (102_000, 80),
    "algid": (216_000, 190),
    "tests": (215_000, None),
    "pipelines": (62_000, None),
}
"""Syntax nodes and files that a part of the house may have."""

PARTS = {
    "input, output, batches": """readers writers batches log files stores staging
    limits runtime faults compiled names ros2 arrow guard""",
    "core": """physics model arm signals estimators identification tracks designs synth
    significance quantiles criteria methods table4""",
}
"""Rooms of a part; what stands in neither belongs to the face."""

IDEAS = {
    "reweighting loops": r"for _ in range\(\w*(?i:reweight)",
    "leave-one-outs": r"(?i)^\w+\.\w*left_out$",
    "Runge-Kuttas": r"/ 6(\.0)? \* \(",
    "sandwiches": r"^combine\.sandwich$",
    # Whiteness (`innovations.judge`) and repeats decide what error bars rest on, and test no model.
    "tests of the model": r"\.exceeds_noise\(|= _score\(",
    "choosers of terms": r"^terms\.run$",
}
"""By idea, a pattern of `module.function` or of the source of each function of the core that holds
it: one each is enough."""


@dataclass
class Size:
    """Syntax nodes, code lines and files."""

    nodes: int = 0
    lines: int = 0
    files: int = 0

    def add(self, other: Size) -> None:
        """Count another size in."""
        self.nodes += other.nodes
        self.lines += other.lines
        self.files += other.files


def size(text: str) -> Size:
    """The size of one file."""
    tree = ast.parse(text)
    nodes = sum(1 for _ in ast.walk(tree))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            code = [one for one in body if not _is_text(one)]
            node.body = code or [ast.Pass()]  # type: ignore[attr-defined]
    return Size(nodes, ast.unparse(tree).count("\n") + 1, 1)


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def room_of(path: Path) -> str:
    """The room of a file below `algid/`; one of `base` is counted where it came from."""
    parts = path.parts[1:] if path.parts[0] == "base" else path.parts
    return parts[0].removesuffix(".py")


def part_of(room: str) -> str:
    """The part of the house to which a room of `algid/` belongs."""
    return next((part for part, rooms in PARTS.items() if room in rooms.split()), "face")


def sizes(root: Path = Path()) -> dict[str, Size]:
    """The size of each room of `algid/`, of each part, and of `algid`, `tests` and `pipelines`."""
    found: dict[str, Size] = {}
    for top in ("algid", "tests", "pipelines"):
        for path in sorted((root / top).rglob("*.py")):
            own = size(path.read_text(encoding="utf-8"))
            names = [top]
            if top == "algid":
                room = room_of(path.relative_to(root / top))
                names += [part_of(room), f"algid/{room}"]
            for name in names:
                found.setdefault(name, Size()).add(own)
    return found


def ideas(root: Path = Path("algid")) -> Iterator[tuple[str, int]]:
    """Each idea, and how many functions of the core hold it."""
    texts = [
        (f"{path.stem}.{node.name}", ast.unparse(node))
        for path in sorted(root.rglob("*.py"))
        if part_of(room_of(path.relative_to(root))) == "core"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    ]
    for idea, pattern in IDEAS.items():
        yield idea, sum(any(re.search(pattern, text) for text in both) for both in texts)


def commands_and_options() -> tuple[int, int]:
    """Commands of `algid`, and the different long options of them all."""

    def helped(*words: str) -> str:
        call = [sys.executable, "-m", "algid", *words, "--help"]
        return subprocess.run(call, capture_output=True, text=True, check=True).stdout

    commands = re.findall(r"^  ([a-z]+) {2,}\S", helped().partition("Commands:")[2], re.M)
    rows = [row for one in commands for row in re.findall(r"^  (--?[a-z].*)$", helped(one), re.M)]
    flags = {flag for row in rows for flag in re.findall(r"(?:^|, |/)(--[a-z][\w-]*)", row)}
    return len(commands), len(flags - {"--help"})


def main() -> None:
    """Print the table."""
    found = sizes()
    print(f"{'room':28s} {'nodes':>8s} {'budget':>8s} {'lines':>7s} {'files':>6s} {'budget':>7s}")
    totals = [name for name in BUDGETS if name in found]
    rooms = sorted((name for name in found if name not in BUDGETS), key=lambda n: -found[n].nodes)
    for name in totals + rooms:
        one, (nodes, files) = found[name], BUDGETS.get(name, (None, None))
        asked, asked_files = (f"{n:,}" if n else "" for n in (nodes, files))
        print(
            f"{name:28s} {one.nodes:8,} {asked:>8s} {one.lines:7,} {one.files:6,} {asked_files:>7s}"
        )
    print()
    commands, options = commands_and_options()
    for name, count, allowed in (
        *((idea, count, 1) for idea, count in ideas()),
        ("codes of notices", len(messages()), 70),
        ("commands", commands, 12),
        ("options", options, 60),
    ):
        print(f"{name:28s} {count:8,} {allowed:8,}")


if __name__ == "__main__":
    main()
