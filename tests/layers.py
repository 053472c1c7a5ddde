"""Which room of the house may import which: a table, and what breaks it, read from the source
without running it.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

PURE = frozenset(
    {
        "__future__",
        "abc",
        "bisect",
        "collections",
        "contextlib",
        "dataclasses",
        "enum",
        "functools",
        "itertools",
        "math",
        "operator",
        "string",
        "typing",
        "warnings",
    }
)
"""Standard library for the mathematics: nothing that reads, writes, prints or waits."""


@dataclass(frozen=True)
class Room:
    """What a room may import: other rooms, packages, and of the standard library a list or (None)
    all of it.
    """

    rooms: frozenset[str]
    packages: frozenset[str]
    library: frozenset[str] | None = None


def room(rooms: str = "", packages: str = "", library: frozenset[str] | None = None) -> Room:
    """A room from words with blanks between them."""
    return Room(frozenset(rooms.split()), frozenset(packages.split()), library)


def breaches(sources: Mapping[str, str], table: Mapping[str, Room]) -> Iterator[str]:
    """Every import in `sources` (text by module) that `table` (room by name, lower ones first)
    does not allow.
    """
    for module, text in sources.items():
        own = _room(module)
        if own in ("", "__main__"):
            continue
        if own not in table:
            yield f"{module}: the room {own} is not in the table"
            continue
        for name in imported(text, sources):
            wrong = _misfit(own, name, sources, table[own])
            if wrong:
                yield f"{module}: {wrong}"


def _misfit(own: str, name: str, sources: Mapping[str, str], allowed: Room) -> str | None:
    top = name.partition(".")[0]
    if name == "?":
        return "an import whose name is computed or relative"
    if top == "algid":
        other = _room(name if name in sources else name.rpartition(".")[0])
        if name == "algid.__version__" or other == own or other in allowed.rooms:
            return None
        return (
            f"imports {name}"
            if other
            else f"reaches through algid for {name}: name the module it stands in"
        )
    if top in sys.stdlib_module_names:
        return (
            None
            if allowed.library is None or top in allowed.library
            else f"imports {top} of the standard library"
        )
    return None if top in allowed.packages else f"imports the package {top}"


def _room(module: str) -> str:
    """The file or folder below algid that a module belongs to; "" for algid itself."""
    return [*module.split("."), ""][1]


@cache
def parsed(text: str) -> ast.Module:
    """The syntax of a module, taken apart once for all that is asked of it."""
    return ast.parse(text)


def imported(text: str, sources: Mapping[str, str]) -> Iterator[str]:
    """What a module's text imports, anywhere in it, by exact names.

    "?" where a name is computed or relative.
    """
    for node in ast.walk(parsed(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "?" if node.level else node.module or ""
            for alias in node.names:
                exact = f"{base}.{alias.name}"
                yield exact if exact in sources or base == "algid" else base
        elif isinstance(node, ast.Call) and _imports(node.func):
            first = node.args[0] if node.args else None
            if isinstance(first, ast.JoinedStr) and isinstance(first.values[0], ast.Constant):
                first = first.values[0]  # of one room, whatever its module
                first = ast.Constant(str(first.value).rpartition(".")[0] or "?")
            yield (
                first.value
                if isinstance(first, ast.Constant) and isinstance(first.value, str)
                else "?"
            )


def _imports(function: ast.expr) -> bool:
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("__import__", "import_module")


def cycles(table: Mapping[str, Room]) -> list[str]:
    """Rooms that import one that stands no lower in the table: without any, no arrow points up."""
    places = {name: place for place, name in enumerate(table)}
    return [
        f"{name} -> {other}"
        for name, one in table.items()
        for other in one.rooms
        if places.get(other, len(places)) >= places[name]
    ]
