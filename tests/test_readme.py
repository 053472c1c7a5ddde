"""The README's commands and its Python, run as they stand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def fenced(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_commands_of_the_readme_run(tmp_path: Path) -> None:
    commands = [line for block in fenced("sh") for line in block.splitlines() if line.startswith("algid ")]
    assert len(commands) >= 8
    for command in commands:
        arguments = command.split("#")[0].split()[1:]
        done = subprocess.run(
            [sys.executable, "-m", "algid", *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


def test_python_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    for block in fenced("python"):
        exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip()
