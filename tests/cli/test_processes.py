"""A command in a fork of the tests' server does what it does in a fresh process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import FRESH, Outcome


@pytest.mark.skipif(FRESH in os.environ, reason=f"{FRESH}: a fork of loaded packages is unsafe")
@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["--version"], 0), (["inspect", "nowhere.csv"], 2), (["inspect", "--no-such-flag"], 2)],
)
def test_a_fork_prints_and_returns_what_a_fresh_process_does(
    arguments: list[str], code: int, tmp_path: Path
) -> None:
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


@pytest.mark.parametrize(
    "swallowing",
    [
        "ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))()",
        "type('Gone', (), {'__del__': lambda self: signal.raise_signal(signal.SIGTERM)})()",
    ],
)
def test_a_signal_that_comes_where_no_exception_leaves_stops_all_the_same(swallowing: str) -> None:
    code = f"""
import ctypes, signal, time
import algid.cli, algid.cli.app

def command(arguments):
    {swallowing}
    time.sleep(20)

algid.cli.app.called = lambda arguments: command
algid.cli.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stdout) == (128 + signal.SIGTERM, "")
    assert done.stderr == "algid: stopped; nothing half-written is left\n"
