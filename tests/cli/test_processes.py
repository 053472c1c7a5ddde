"""A command in a fork of the tests' server does what it does in a fresh process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import FRESH, Outcome


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["--version"], 0), (["inspect", "nowhere.csv"], 2), (["inspect", "--no-such-flag"], 2)],
)
def test_a_fork_prints_and_returns_what_a_fresh_process_does(
    arguments: list[str], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(FRESH, raising=False)  # it is the fork that is tried
    env = {**os.environ, "COLUMNS": "90"}
    program = Path(sys.executable).with_name("algid")
    fresh = subprocess.run(
        [program, *arguments], capture_output=True, text=True, cwd=tmp_path, env=env, check=False
    )
    forked = Outcome(*arguments, cwd=tmp_path, env=env)
    assert (forked.code, forked.out, forked.err) == (fresh.returncode, fresh.stdout, fresh.stderr)
    assert fresh.returncode == code


@pytest.mark.parametrize("threads", ["0", "x", "-1", "100000", ""])
def test_threads_that_no_library_can_start_are_refused(threads: str) -> None:
    found = Outcome("inspect", "absent.csv", env={**os.environ, "POLARS_MAX_THREADS": threads})
    assert (found.code, found.out) == (2, "")
    assert found.err.startswith(
        "algid: POLARS_MAX_THREADS: expected a whole number from 1 to 1024, found '"
    )


def test_too_few_open_files_are_told_and_more_are_taken_where_they_may_be() -> None:
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, ({}, {})); from algid.cli "
        "import main; main()"
    )
    for limits, told in (
        (
            (16, 16),
            (
                "algid: the limit on open files: expected 32 or more, found 16; raise it with "
                "ulimit -n\n"
            ),
        ),
        ((16, 64), "algid: absent.csv: there is no such file"),
    ):
        command = [sys.executable, "-c", code.format(*limits), "inspect", "absent.csv"]
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == 2
        assert done.stderr.startswith(told)
