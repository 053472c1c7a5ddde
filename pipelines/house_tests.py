"""Where the tests reach: through the faces of algid's rooms, or inside.

A room's face are the modules that other rooms import. A test reaches inside where it uses a module
that no other room imports, or a private name (one leading underscore) of algid: imported, or as an
attribute. What functions and variables of the test's own module use counts as the test's own; other
modules of tests and fixtures are not followed.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

_DISPLAYED = ("_repr_html_",)
"""Names with an underscore that are others' protocols."""


@dataclass(frozen=True)
class Reach:
    """How many tests there are, use private names, and reach inside a room."""

    tests: int
    private: int
    inside: int


def reach(package: Path = Path("algid"), tests: Path = Path("tests")) -> Reach:
    """Count the tests below `tests`, and those of them that reach inside rooms of `package`."""
    modules = {_name(path): path for path in sorted(package.rglob("*.py"))}
    faces = set(_faces(modules))
    count = private = inside = 0
    for path in sorted(tests.rglob("test_*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        imported = {}
        for module, name, local in _imports(tree, modules):
            kept = _is_private(name)
            if kept or (module.count(".") > 1 and module not in faces):
                imported[local] = kept
        for names, attributes in _tests(tree):
            used = [imported[name] for name in names if name in imported]
            hidden = any(used) or any(map(_is_private, attributes))
            count += 1
            private += hidden
            inside += hidden or bool(used)
    return Reach(count, private, inside)


def _faces(modules: Mapping[str, Path]) -> Iterator[str]:
    """Modules that another room than their own imports."""
    for importer, path in modules.items():
        for module, _, _ in _imports(ast.parse(path.read_text(encoding="utf-8")), modules):
            if module.split(".")[1:2] != importer.split(".")[1:2]:
                yield module


def _imports(tree: ast.AST, modules: Mapping[str, Path]) -> Iterator[tuple[str, str, str]]:
    """Each import of the package: module, name in it (empty for the module), and local name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for one in node.names:
                if one.name in modules:
                    yield one.name, "", one.asname or one.name.partition(".")[0]
        elif isinstance(node, ast.ImportFrom) and (node.module or "") in modules:
            for one in node.names:
                module, name = f"{node.module}.{one.name}", ""
                if module not in modules:
                    module, name = str(node.module), one.name
                yield module, name, one.asname or one.name


def _tests(tree: ast.Module) -> Iterator[tuple[set[str], set[str]]]:
    """Of each test the names and attributes that it and its module's helpers use."""
    helpers: dict[str, ast.AST] = {}
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            helpers[node.name] = node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for part in ast.walk(node):
                if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                    helpers[part.id] = node
    for test in ast.walk(tree):
        if isinstance(test, ast.FunctionDef) and test.name.startswith("test_"):
            names: set[str] = set()
            attributes: set[str] = set()
            _collect(test, helpers, names, attributes)
            yield names, attributes


def _collect(
    node: ast.AST, helpers: Mapping[str, ast.AST], names: set[str], attributes: set[str]
) -> None:
    """Add what a node uses, and what the helpers use that it names."""
    for part in ast.walk(node):
        if isinstance(part, ast.Attribute):
            attributes.add(part.attr)
        name = part.id if isinstance(part, ast.Name) else ""
        if isinstance(part, ast.arg):  # a fixture
            name = part.arg
        if name and name not in names:
            names.add(name)
            if name in helpers:
                _collect(helpers[name], helpers, names, attributes)


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in _DISPLAYED


def _name(path: Path) -> str:
    """The module that a file is, by its dotted name."""
    parts = path.with_suffix("").parts
    if parts[-1] == "__init__":
        parts = parts[:-1]
    return ".".join(parts)
