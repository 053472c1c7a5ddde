"""What a batch that was killed leaves in the system's temporary folder goes with the next one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_folder_of_a_killed_batch_is_removed_by_the_next_one(tmp_path: Path) -> None:
    place = tmp_path / "tmp"
    place.mkdir()
    (tmp_path / "broken.csv").write_text("t,theta1\n0,1\n")
    foreign = place / "someone-else"
    foreign.mkdir()
    command = [
        sys.executable,
        "-m",
        "algid",
        "batch",
        str(tmp_path / "broken.csv"),
        "-o",
        str(tmp_path / "out"),
    ]
    environment = {**os.environ, "TMPDIR": str(place), "PYTHONPATH": str(Path(__file__).parents[2])}

    killed = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 60
    while not (left := _folders(place)) and time.monotonic() < until and killed.poll() is None:
        time.sleep(0.001)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert left, "the batch made no folder"

    done = subprocess.run(
        [*command, "--retry-failed"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stderr
    assert not any(folder.exists() for folder in left)
    assert foreign.exists()
    assert _folders(place) == []


def _folders(place: Path) -> list[Path]:
    return [found for found in place.glob(".algid.algid-*") if found.is_dir()]
