"""Calls for workers under test."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from pathlib import Path
from typing import Any, NoReturn

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


def spin() -> NoReturn:
    """Never end."""
    while True:
        pass


def temporary_file() -> str:
    """Leave a file in the temporary folder."""
    return tempfile.mkstemp()[1]


def raise_its_own_cause() -> NoReturn:
    """Raise an exception whose chain is a circle."""
    error = ValueError("as asked")
    raise error from error


def raise_a_long_chain() -> NoReturn:
    """Raise an exception with thousands of causes."""
    error = ValueError("0")
    for number in range(1, 5001):
        following = ValueError(str(number))
        following.__cause__ = error
        error = following
    raise error


class UnpicklableError(Exception):
    """An exception that holds what cannot be pickled."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.held = lambda: None


def raise_unpicklable() -> NoReturn:
    """Raise it."""
    raise UnpicklableError("as asked")


class UnprintableError(Exception):
    """An exception that cannot be printed."""

    def __str__(self) -> str:
        raise RuntimeError("no words")


def raise_unprintable() -> NoReturn:
    """Raise it."""
    raise UnprintableError


def raise_huge() -> NoReturn:
    """Raise an exception of many words."""
    raise ValueError("x" * (1 << 26))


class Panic(BaseException):
    """What compiled libraries raise."""


def raise_base() -> NoReturn:
    """Raise it."""
    raise Panic("as asked")


def leave() -> NoReturn:
    """Try to end the process."""
    sys.exit(3)


def interrupt() -> NoReturn:
    """Raise what Ctrl-C does."""
    raise KeyboardInterrupt


def give_unpicklable() -> Any:
    """An answer that cannot be pickled."""
    return lambda: None


def _not_here() -> NoReturn:
    raise RuntimeError("not here")


class NotHere:
    """What can be pickled and not be unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _not_here, ()


def give_what_cannot_be_unpacked() -> NotHere:
    """An answer that can be pickled and not be unpickled."""
    return NotHere()
