"""One list of options: command line, profile, Python and messages take it from there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from typer.main import get_command

import algid
from algid.notices import Remedy
from algid.options import BY_SET, flag
from tests.cli.commands import app

ROOT = Path(algid.__file__).parent
WRITES_FLAGS = {ROOT / "options.py", ROOT / "moved.py", *(ROOT / "cli").rglob("*.py")}


def flags() -> set[str]:
    """The flags of all commands."""
    commands = get_command(app).commands  # type: ignore[attr-defined]
    return {word for one in commands.values() for option in one.params for word in option.opts}


def _texts(tree: ast.AST) -> list[str]:
    """The strings of a module but its docstrings, with ``{`` for what is formatted into one."""
    passed = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    texts = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [getattr(part, "value", "") for part in node.values]
            texts.append("".join(part if isinstance(part, str) else "{" for part in parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            texts += [node.value] if id(node) not in passed else []
    return texts


def test_no_flag_is_spelled_where_it_could_be_named() -> None:
    known = {word for word in flags() if word.startswith("--")} - {"--help", "--format"}
    spelled = [
        (path.name, word)
        for path in sorted(ROOT.rglob("*.py"))
        if path not in WRITES_FLAGS
        for text in _texts(ast.parse(path.read_text(encoding="utf-8")))
        for word in re.findall(r"(?<![\w(-])--(?:[a-z][a-z0-9-]+|{)", text)
        if word in {*known, "--{"} and word != text
    ]
    assert spelled == []


def test_every_option_that_a_message_names_is_one() -> None:
    named = [
        node.args[0].value
        for path in ROOT.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "flag"
        and isinstance(node.args[0], ast.Constant)
    ]
    assert len(named) > 50
    known = flags() | {f"--set {name}" for name in BY_SET} | {"--report"}
    assert {flag(str(name)) for name in named} <= known


def test_a_flag_is_written_from_the_name() -> None:
    assert flag("torque_hold") == "--torque-hold"
    assert flag("report", off=True) == "--no-report"
    assert flag("out") == "-o"
    assert flag("window") == "--set window"


def test_a_profiles_velocity_is_not_the_option_of_that_name() -> None:
    assert Remedy({"velocity": False}).flags == ("--set", "velocity=false")
    assert Remedy({"velocity": "measured"}).flags == ("--velocity", "measured")
