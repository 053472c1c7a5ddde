"""One list of options: command line, profile, Python and messages take it from there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from typer.main import get_command

import algid
from algid.notices import Remedy
from algid.options import FLAGS, OPTIONS, PROFILE, SETTINGS, flag, options_of, range_of
from algid.profile import Profile
from tests.cli.commands import NAMES, app

ROOT = Path(algid.__file__).parent
WRITES_FLAGS = {ROOT / "options.py", *(ROOT / "cli").rglob("*.py")}


def shown_by(command: str) -> dict[str, object]:
    """The options of a command by the names of their entries."""
    declared = get_command(app).commands[command].params  # type: ignore[attr-defined]
    return {
        option.opts[-1].removeprefix("--").replace("-", "_"): option
        for option in declared
        if option.param_type_name == "option"
    }


@pytest.mark.parametrize("command", NAMES)
def test_every_option_of_a_command_is_an_entry_that_it_takes(command: str) -> None:
    everywhere = {one.name for one in options_of("all")}
    own = {one.name for one in options_of(command)}
    shared = {one.name for taker in (SETTINGS, PROFILE) for one in options_of(taker)}
    shown = shown_by(command)
    assert own <= set(shown) <= own | everywhere | shared
    for name, option in shown.items():
        assert flag(name) in option.opts  # type: ignore[attr-defined]
        if name in own:
            bounds = (getattr(option, "min", None), getattr(option, "max", None))
            known = next(one.range for one in options_of(command) if one.name == name)
            assert bounds == (known or (None, None))


def test_every_taker_is_one() -> None:
    assert {taker for one in OPTIONS for taker in one.of} <= {*NAMES, SETTINGS, PROFILE, "all"}


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
    flags = {word for name in FLAGS for word in (flag(name), flag(name, off=True))} - {"-o"}
    spelled = [
        (path.name, word)
        for path in sorted(ROOT.rglob("*.py"))
        if path not in WRITES_FLAGS
        for text in _texts(ast.parse(path.read_text(encoding="utf-8")))
        for word in re.findall(r"(?<![\w(-])--(?:[a-z][a-z0-9-]+|{)", text)
        if word in {*flags, "--{"}
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
    assert set(named) <= set(FLAGS)
    with pytest.raises(KeyError, match="no_such"):
        flag("no_such")


def test_a_flag_is_written_from_the_name() -> None:
    assert flag("torque_hold") == "--torque-hold"
    assert flag("report", off=True) == "--no-report"
    assert flag("out") == "-o"
    assert range_of("design", "rate") != range_of("synth", "rate")
    with pytest.raises(KeyError, match="model has no range"):
        range_of(SETTINGS, "model")


def test_every_option_of_a_log_is_a_field_of_a_profile_or_stands_for_some() -> None:
    fields = set(Profile.model_fields)
    for one in options_of(PROFILE):
        assert set(one.channels) <= fields
        assert one.name in fields or one.channels or one.name in {"profile", "set"}


def test_a_profiles_velocity_is_not_the_option_of_that_name() -> None:
    assert Remedy({"velocity": False}).flags == ("--set", "velocity=false")
    assert Remedy({"velocity": "measured"}).flags == ("--velocity", "measured")
