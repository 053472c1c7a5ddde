"""What a terminal cannot spell and a reader that leaves do to a command: nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import begin

ALGID = [sys.executable, "-m", "algid"]


@pytest.mark.parametrize("errors_too", [False, True])
def test_a_reader_that_leaves_is_no_error_and_a_failure_stays_one(
    result: Path, errors_too: bool, tmp_path: Path
) -> None:
    reading, writing = os.pipe()
    os.close(reading)  # as head does once it has seen enough
    with (tmp_path / "errors").open("w+b") as stream:
        errors = writing if errors_too else stream.fileno()
        for code, arguments in (
            (0, ["compare", result, result]),
            (0, ["validate", result, "--max-error", "50"]),
            (1, ["validate", result, "--max-error", "1e-9"]),
            (0, ["--help"]),
        ):
            assert begin(*arguments, stdout=writing, stderr=errors)() == code, arguments
        done = subprocess.run([*ALGID, "--help"], stdout=writing, stderr=errors, check=False)
        assert done.returncode == 0
    os.close(writing)
    assert not (tmp_path / "errors").read_bytes()


def test_terminals_without_greek_see_escapes(result: Path) -> None:
    env = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "80"}
    for call, code, said in (
        (["compare", result, result], 0, b"/\\u03c3"),
        (["identify", "--help"], 0, b"Usage: algid identify"),
        (["identify", "θ.csv"], 2, b"algid: \\u03b8.csv: "),
    ):
        done = subprocess.run([*ALGID, *call], capture_output=True, env=env, check=False)
        assert done.returncode == code
        assert said in (done.stderr if code else done.stdout)


def test_windows_is_refused_in_one_line() -> None:
    code = "import sys; sys.platform = 'win32'; from algid.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "algid: it runs on Linux and macOS; on Windows, run it in WSL\n"
