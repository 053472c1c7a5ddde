"""Calls for workers under test."""

from __future__ import annotations

import os
import resource
import signal
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from algid.base.staging import staged
from algid.guard import reading


def add(a: int, b: int) -> int:
    """a + b."""
    return a + b


def fail() -> None:
    """Raise."""
    raise ValueError("as asked")


def die(number: int, file: str, half: str) -> None:
    """Take the worker along while a file is read, if any, and something is half made."""
    with staged(Path(half), Path.mkdir), reading(file) if file else nullcontext():
        os.kill(os.getpid(), number)
        time.sleep(60)


def die_until(count: int, tries: str) -> int:
    """Be killed but for the `count`-th try."""
    with Path(tries).open("a+") as file:
        file.write("x")
    size = Path(tries).stat().st_size
    if size < count:
        os.kill(os.getpid(), signal.SIGKILL)
    return size


def bound() -> int:
    """Bytes of data that the worker may have."""
    return resource.getrlimit(resource.RLIMIT_DATA)[0]


def fill(size: int) -> int:
    """Use memory."""
    return int(np.ones(size, dtype=np.uint8).size)


def environment(name: str) -> str | None:
    """A variable of the worker's environment."""
    return os.environ.get(name)


def linger(pid_file: str) -> None:
    """Tell the worker's number, then wait for a minute."""
    Path(pid_file).write_text(str(os.getpid()))
    time.sleep(60)


def spin() -> NoReturn:
    """Never end."""
    while True:
        pass


class UnprintableError(Exception):
    """An exception that cannot be printed."""

    def __str__(self) -> str:
        raise RuntimeError("no words")


def raise_unprintable() -> NoReturn:
    """Raise it."""
    raise UnprintableError


class Panic(BaseException):
    """What compiled libraries raise."""


def raise_base() -> NoReturn:
    """Raise it."""
    raise Panic("as asked")


def give_unpicklable() -> Any:
    """An answer that cannot be pickled."""
    return lambda: None


def _not_here() -> NoReturn:
    raise RuntimeError("not here")


class NotHere:
    """What can be pickled and not be unpickled."""

    def __call__(self) -> None:
        """Never."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _not_here, ()


take_not_here = NotHere()
