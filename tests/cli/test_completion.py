"""Every option that takes a choice completes its choices."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, Literal, get_origin

import pytest
import typer

from tests.cli.commands import app

FREE = {
    *(
        "topic",
        "gravity",
        "joints",
        "rate",
        "start",
        "end",
        "name",
        "out",
        "sources",
        "scheduler",
        "part",
        "flange",
        "memory_limit",
    ),
    *("payload_schedule", "range", "speed", "runs", "wanted", "max_error"),
}
"""Options of text that is the user's own."""
ROOT = typer.main.get_command(app)


def commands(group: Any = ROOT, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every command by its name."""
    for word, inner in group.commands.items():
        if hasattr(inner, "commands"):
            yield from commands(inner, f"{name}{word} ")
        else:
            yield name + word, inner


def choices() -> Iterator[Any]:
    """Every option and argument that takes a choice, or text that is not the user's own."""
    for name, command in commands():
        for option in command.params:
            kind = option.type_descriptor.annotation
            text = (
                kind in (str, list[str])
                and option.name not in FREE
                and (name, option.name) != ("design", "torque")
            )
            if (
                text
                or get_origin(kind) is Literal
                or (isinstance(kind, type) and issubclass(kind, Enum))
            ):
                yield pytest.param(command, option, id=f"{name} {option.name}")


def completed(command: Any, option: Any, begun: str) -> list[str]:
    context = command.make_context(command.name, [], resilient_parsing=True)
    return [one.value for one in option.shell_complete(context, begun)]


@pytest.mark.parametrize(("command", "option"), list(choices()))
def test_every_choice_completes(
    command: Any, option: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    found = completed(command, option, "")
    assert found
    assert found[0] in completed(command, option, found[0][:2])
    assert completed(command, option, "no such thing") == []


@pytest.mark.parametrize(
    ("name", "begun", "expected"),
    [
        ("angle_unit", "", ["rad", "mrad", "deg", "rev", "counts"]),
        ("torque_unit", "m", ["mN m", "mA"]),
        ("zero", "h", ["horizontal", "hanging"]),
        ("second_angle", "", ["relative", "absolute"]),
        ("set", "tau1.s", ["tau1.source=", "tau1.sign="]),
        ("set", "tau1.sign=", ["tau1.sign=1", "tau1.sign=-1"]),
        ("set", "velocity=t", ["velocity=true"]),
        ("set", "obs", ["observer="]),
        ("set", "observer=z", ["observer=zero-phase"]),
        ("accept", "DEGREES,EFFORT_Z", ["DEGREES,EFFORT_ZERO"]),
        ("model", "coulomb,ro", ["coulomb,rotor"]),
        ("estimator", "re", ["refined"]),
    ],
)
def test_what_completes(name: str, begun: str, expected: list[str]) -> None:
    command = ROOT.commands["identify"]  # type: ignore[attr-defined]
    option = next(one for one in command.params if one.name == name)
    assert completed(command, option, begun) == expected


def test_cases_and_files_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cases").mkdir()
    Path("case.toml").touch()
    command = ROOT.commands["synth"]  # type: ignore[attr-defined]
    assert completed(command, command.params[0], "cas") == ["case1", "case2", "case.toml", "cases/"]
