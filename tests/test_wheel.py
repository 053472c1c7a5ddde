"""What is installed is whole: a wheel is built, put where nothing of the sources is, and tried."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import algid

ROOT = Path(algid.__file__).parents[1]


@pytest.mark.slow
def test_a_wheel_holds_all_that_its_commands_need(tmp_path: Path) -> None:
    """Templates, messages, cases, the guide and the pages' library; with the network."""
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", tmp_path, ROOT], check=True)
    (wheel,) = tmp_path.glob("algid-*.whl")
    place = tmp_path / "installed"
    subprocess.run([*pip, "install", "--no-deps", "--target", place, wheel], check=True)

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(place)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    where = run("-c", "import algid; print(algid.__file__)")
    assert Path(where.strip()).is_relative_to(place)
    for call in (
        "synth case1 --duration 2 --torque wide --format csv",
        "identify case1-unloaded.csv --estimator weak --model plain",
        "export case1-unloaded.algid --to urdf",
        "inspect case1-unloaded.csv",
        "guide warnings",
    ):
        assert run("-m", "algid", *call.split())
    library = len((tmp_path / "case1-unloaded.algid" / "report.html").read_bytes())
    assert library > 500_000  # the page carries it
