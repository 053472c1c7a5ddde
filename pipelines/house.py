"""How the house stands: files, lines, helpers with one caller, tests to code, and a log's way through the rooms.

The way is traced: `algid identify` on a short log, every call from one module of algid to another.
A climb is a call into a room above the caller's, of those in the order of the table of allowed
imports; to take the next item from a generator that was handed down is none.
"""

from __future__ import annotations

import ast
import inspect
import io
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

from algid.cli import main
from pipelines import bench_logs
from tests.test_layers import TABLE

_SAMPLES = 4000  # of the traced log, at 1 kHz


def figures() -> Iterator[tuple[str, str]]:
    """Each figure of the house, by its name."""
    code, tests = _texts("algid"), _texts("tests")
    lines, of_tests = (sum(map(_lines, texts)) for texts in (code, tests))
    lengths = [_lines(text) for text in code if _lines(text) > 2]
    helpers = sum(map(_with_one_caller, code))
    yield "files", f"{len(code)}"
    yield "lines, docstrings among them", f"{lines:,}"
    yield "lines of docstrings", f"{sum(map(_docstring_lines, code)):,}"
    yield "median module, lines", f"{median(lengths):.0f}"
    yield "private functions with one caller, per 1,000 lines", f"{1000 * helpers / lines:.1f}"
    yield "lines of tests to lines of code", f"{of_tests / lines:.2f}"
    calls = _calls()
    rooms = {room for pair in calls for room in pair}
    floor = {name: number for number, name in enumerate(TABLE)}
    climbs = sorted(f"{one} to {other}" for one, other in calls if floor[other] > floor[one])
    yield "rooms on a log's way", f"{len(rooms)} of {len(TABLE)}"
    yield "climbs on it", f"{len(climbs)}" + (f": {', '.join(climbs)}" if climbs else "")


def _texts(folder: str) -> list[str]:
    return [path.read_text(encoding="utf-8") for path in sorted(Path(folder).rglob("*.py"))]


def _lines(text: str) -> int:
    return text.count("\n")


def _docstring_lines(text: str) -> int:
    found = 0
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and ast.get_docstring(node) is not None
        ):
            found += (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
    return found


def _with_one_caller(text: str) -> int:
    """Private functions and methods that their module names once.

    What a decorator hands on is called by others.
    """
    nodes = list(ast.walk(ast.parse(text)))
    named = Counter(node.id for node in nodes if isinstance(node, ast.Name))
    named += Counter(node.attr for node in nodes if isinstance(node, ast.Attribute))
    private = [
        node.name
        for node in nodes
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("_")
        and not node.decorator_list
    ]
    return sum(not name.startswith("__") and named[name] == 1 for name in private)


def _calls() -> set[tuple[str, str]]:
    """Rooms that call and rooms that are called while a log is identified, its report and series written."""
    found: set[tuple[str, str]] = set()

    def watch(frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or frame.f_back is None or frame.f_code.co_flags & inspect.CO_GENERATOR:
            return
        one, other = (_room(place.f_globals.get("__name__", "")) for place in (frame.f_back, frame))
        if one and other and one != other:
            found.add((one, other))

    with TemporaryDirectory() as folder:
        log = bench_logs.parquet(Path(folder, "log.parquet"), _SAMPLES)
        threading.setprofile(watch)
        sys.setprofile(watch)
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                sys.argv = ["algid", "identify", str(log), "-o", folder]
                main()
        except SystemExit as end:
            if end.code:
                raise
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
    return found


def _room(module: str) -> str | None:
    """The room in which a module of algid stands."""
    top, _, rest = module.partition(".")
    room = rest.partition(".")[0]
    return room if top == "algid" and room in TABLE else None


if __name__ == "__main__":
    for name, value in figures():
        print(f"{name:52s} {value}")
