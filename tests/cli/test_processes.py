"""A command in a fork of the tests' server does what it does in a fresh process."""

from __future__ import annotations

import os
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
