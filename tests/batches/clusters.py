"""A Dask cluster of this machine that ends with the test."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.batches.commands import ROOT


class Dask:
    """A scheduler and its workers, processes of this machine that end with the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.running: list[subprocess.Popen[bytes]] = []
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"

    def start(self, kind: str, *flags: str, until: str) -> subprocess.Popen[bytes]:
        """A scheduler or a worker, once it says that it is ready."""
        said = self.folder / f"{kind}{len(self.running)}.txt"
        code = f"from distributed.cli import dask_{kind}; dask_{kind}.main()"
        env: dict[str, Any] = {**os.environ, "PYTHONPATH": str(ROOT)}
        with said.open("wb") as stream:
            command = [sys.executable, "-c", code, *flags, "--no-dashboard"]
            self.running.append(
                subprocess.Popen(command, env=env, cwd=ROOT, stdout=stream, stderr=stream)
            )
        end = time.monotonic() + 60
        while until not in said.read_text():
            assert time.monotonic() < end, said.read_text()
            assert self.running[-1].poll() is None, said.read_text()
            time.sleep(0.05)
        return self.running[-1]

    def scheduler(self) -> subprocess.Popen[bytes]:
        """The scheduler, at the address that stays the same."""
        return self.start(
            "scheduler", "--host", "127.0.0.1", "--port", str(self.port), until="Scheduler at"
        )

    def worker(self) -> subprocess.Popen[bytes]:
        """A worker with one thread that nobody starts again when it dies."""
        flags = (self.address, "--nthreads", "1", "--no-nanny")
        return self.start("worker", *flags, until="Registered to")


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    """A scheduler without workers; skips where Dask is absent."""
    pytest.importorskip("distributed", reason="distributed is absent")
    cluster = Dask(tmp_path)
    try:
        cluster.scheduler()
        yield cluster
    finally:
        for process in cluster.running:
            process.kill()
            process.wait()
