"""The line of progress as a terminal gets it; silence everywhere else."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

import algid
from tests.processes import Outcome
from tests.terminals import on_a_terminal


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found, _ = algid.synthesise("case1", duration=2.0, torque="wide", torque_noise=1e-2, seed=1)
    path = tmp_path_factory.mktemp("progress") / "log.parquet"
    algid.write_log(path, replace(found, omega=None))
    return path


@pytest.mark.slow
def test_a_terminal_is_shown_stages_and_samples_and_is_left_clean(
    path: Path, tmp_path: Path
) -> None:
    with tempfile.TemporaryFile() as file:
        code, seen = on_a_terminal("identify", path, "-o", tmp_path, stdout=file.fileno())
        file.seek(0)
        printed = file.read().decode()
    assert code == 0, seen
    assert "reading" in seen
    assert "of 2,001 (" in seen
    assert "k1" in printed
    assert "\x1b" not in printed
    bar, _, after = seen.rpartition("wrote ")
    assert bar.endswith("\x1b[2K")  # the line is cleared
    assert "\x1b" not in after


@pytest.mark.parametrize("command", ["identify", "convert"])
def test_a_pipe_gets_none_of_it(command: str, path: Path, tmp_path: Path) -> None:
    arguments: dict[str, list[str | Path]] = {
        "identify": ["-q", path, "-o", tmp_path],
        "convert": ["-q", path, "-o", tmp_path / "log.csv"],
    }
    colour = {**os.environ, "FORCE_COLOR": "1"}  # asks for colour, not for a terminal's bars
    done = Outcome(command, *arguments[command], env=colour)
    assert (done.code, done.err) == (0, "")
