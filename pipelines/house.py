"""How the house stands: size, density, literals, flags, tests, and a log's way through the rooms.

Sizes are of code without indentation, comments and docstrings, as `ast` writes it. The way is
traced: `algid identify` on a short log, every call from one module of algid to another. A climb is
a call into a room above the caller's, of those in the order of the table of allowed imports; to
take the next item from a generator that was handed down counts in the second figure alone.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

from algid.cli import main
from algid.options import OPTIONS, flag
from algid.physics.terms import ALWAYS, OPTIONAL
from pipelines import bench_logs
from pipelines.house_tests import reach
from tests.test_layers import TABLE

_SAMPLES = 4000  # of the traced log, at 1 kHz
_COLUMNS = 100
_FLAG = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]+")
_FLAGS = {flag(one.name, off=off) for one in OPTIONS for off in (False, True)}


def figures() -> Iterator[tuple[str, str]]:
    """Each figure of the house, by its name."""
    code, tests = _texts("algid"), _texts("tests")
    lines, of_tests = (sum(map(_lines, texts)) for texts in (code, tests))
    lengths = [_lines(text) for text in code if _lines(text) > 2]
    helpers = sum(map(_with_one_caller, code))
    yield "files", f"{len(code)}"
    yield from _sizes(code)
    yield from _literals()
    functions = [name for text in tests for name in _functions(text) if name.startswith("test_")]
    yield "tests", f"{len(functions):,}"
    reached = reach()
    for name, part in (
        ("tests of private names", reached.private),
        ("tests that reach inside rooms", reached.inside),
    ):
        yield name, f"{part:,}, {100 * part / reached.tests:.1f} %"
    yield "lines of tests", f"{of_tests:,}"
    yield "lines, docstrings among them", f"{lines:,}"
    yield "lines of docstrings", f"{sum(map(_docstring_lines, code)):,}"
    yield "median module, lines", f"{median(lengths):.0f}"
    yield "private functions with one caller, per 1,000 lines", f"{1000 * helpers / lines:.1f}"
    yield "lines of tests to lines of code", f"{of_tests / lines:.2f}"
    calls, resumed = way()
    rooms = {room for pair in calls for room in pair}
    yield "rooms on a log's way", f"{len(rooms)} of {len(TABLE)}"
    for name, pairs in (("climbs on it", calls), ("with resumed generators", calls | resumed)):
        up = climbs(pairs)
        yield name, f"{len(up)}" + (f": {', '.join(up)}" if up else "")


def _sizes(code: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Size and density of the code, and names and classes of which there are too many."""
    bare = [ast.unparse(_bare(ast.parse(text))) for text in code]
    lines = sum(map(_lines, bare)) + len(bare)
    letters = sum(len(line.strip()) for text in bare for line in text.splitlines())
    yield "characters of code", f"{letters:,}"
    nodes = [node for text in bare for node in ast.walk(ast.parse(text))]
    comprehensions = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
    unpacked = sum(isinstance(node, ast.Starred) for node in nodes)
    unpacked += sum(node.keys.count(None) for node in nodes if isinstance(node, ast.Dict))
    for name, count in (
        ("comprehensions", sum(isinstance(node, comprehensions) for node in nodes)),
        ("conditional expressions", sum(isinstance(node, ast.IfExp) for node in nodes)),
        ("starred unpackings", unpacked),
    ):
        yield f"{name} per 1,000 lines of code", f"{1000 * count / lines:.1f}"
    source = [line for text in code for line in text.splitlines()]
    yield "lines beyond 100 columns", f"{sum(len(line) > _COLUMNS for line in source):,}"
    yield "functions with a local called found", f"{sum(map(_with_found, nodes))}"
    settings = [
        node.name for node in nodes if isinstance(node, ast.ClassDef) and _is_settings(node)
    ]
    yield "classes that hold hold and delay", f"{len(settings)}: {', '.join(settings)}"


def _bare(tree: ast.Module) -> ast.Module:
    """The tree without docstrings, also those of variables."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [one for one in body if not _is_text(one)]
            node.body = kept or [ast.Pass()]  # type: ignore[attr-defined]
    return tree


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _with_found(node: ast.AST) -> bool:
    """Whether a function stores into a name that says nothing."""
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(one, ast.Name) and one.id == "found" and isinstance(one.ctx, ast.Store)
        for one in ast.walk(node)
    )


def _is_settings(node: ast.ClassDef) -> bool:
    """Whether a class holds a hold and a delay in s; that one is estimated is no setting of it."""
    own = {
        one.target.id: ast.unparse(one.annotation)
        for one in node.body
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
    }
    return own.get("delay") == "float" and bool(own.keys() & {"hold", "torque_hold"})


def _literals() -> Iterator[tuple[str, str]]:
    """String literals that name terms and coefficients, or flags, where they do not belong."""
    every = (*ALWAYS, *OPTIONAL)
    names = {term.name for term in every} | {name for term in every for name in term.names}
    terms: Counter[str] = Counter()
    flags: Counter[str] = Counter()
    for path in sorted(Path("algid").rglob("*.py")):
        room = path.parts[1]
        tree = _bare(ast.parse(path.read_text(encoding="utf-8")))
        texts = [
            node.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ]
        if room != "physics":
            terms[str(path)] += sum(text in names for text in texts)
        if room not in ("cli", "options.py"):
            spelled = [word for text in texts for word in _FLAG.findall(text)]
            flags[str(path)] += sum(word in _FLAGS for word in spelled)
    for name, counts in (("of terms and coefficients", terms), ("of flags outside cli", flags)):
        most = ", ".join(f"{Path(path).name} {count}" for path, count in counts.most_common(6))
        yield f"literals {name}", f"{counts.total()}, most in {most}"


def _functions(text: str) -> list[str]:
    return [node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]


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


def climbs(pairs: set[tuple[str, str]]) -> list[str]:
    """Those of the pairs of rooms whose second one is above the first."""
    floor = {name: number for number, name in enumerate(TABLE)}
    return sorted(f"{one} to {other}" for one, other in pairs if floor[other] > floor[one])


def way() -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
    """Rooms that call and rooms that are called while a log is identified, its report and series
    written.

    Calls of functions, and generators that are begun or resumed.

    Raises
    ------
    SystemExit
        If the command fails.
    """
    called: set[tuple[str, str]] = set()
    resumed: set[tuple[str, str]] = set()

    def watch(frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or frame.f_back is None:
            return
        one, other = (_room(place.f_globals.get("__name__", "")) for place in (frame.f_back, frame))
        if one and other and one != other:
            generator = frame.f_code.co_flags & inspect.CO_GENERATOR
            (resumed if generator else called).add((one, other))

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
    return called, resumed


def _room(module: str) -> str | None:
    """The room in which a module of algid stands."""
    top, _, rest = module.partition(".")
    room = rest.partition(".")[0]
    return room if top == "algid" and room in TABLE else None


if __name__ == "__main__":
    for name, value in figures():
        print(f"{name:52s} {value}")
