"""Calls for workers under test."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np


def add(a: int, b: int) -> int:
    """a + b."""
    return a + b


def fail() -> None:
    """Raise."""
    raise ValueError("as asked")


def die() -> None:
    """Take the worker along."""
    os.kill(os.getpid(), signal.SIGKILL)


def fill(size: int) -> int:
    """Use memory."""
    return int(np.ones(size, dtype=np.uint8).size)


def environment(name: str) -> str | None:
    """A variable of the worker's environment."""
    return os.environ.get(name)


def linger(pid_file: str) -> None:
    """Tell the worker's number, then wait for a minute."""
    import time

    Path(pid_file).write_text(str(os.getpid()))
    time.sleep(60)
