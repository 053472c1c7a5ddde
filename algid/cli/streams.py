"""Standard output and error that no pipe's reader and no terminal's alphabet can break."""

from __future__ import annotations

import io
import os
import sys
from typing import Any

from algid.base.errors import OutputError


class _Pipe(io.FileIO):
    """A descriptor whose reader may leave, like ``head``, or whose disk may be full.

    What is written after that goes nowhere. That a disk is full is raised, once, where there is a
    `name` to tell it by: about standard error nobody can be told.
    """

    def __init__(self, handle: int, told_as: str | None) -> None:
        super().__init__(handle, "wb", closefd=False)
        self._told_as = told_as

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            _to_nowhere(self.fileno())
            if self._told_as is not None and not isinstance(error, BrokenPipeError):
                reason = f"cannot write ({error.strerror}); send it elsewhere, or make room"
                raise OutputError(f"{self._told_as}: {reason}") from error
            return memoryview(data).nbytes


def _to_nowhere(handle: int) -> None:
    """Have what is written to a descriptor go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != handle:  # a closed one is the first that the system gives
        os.dup2(nowhere, handle)
        os.close(nowhere)


def harden_streams() -> None:
    """Let this process print to a reader that leaves, and to a terminal that lacks characters."""
    for handle, name, told_as in ((1, "stdout", "standard output"), (2, "stderr", None)):
        stream = getattr(sys, name)
        if stream is None:  # closed: else the next file to be opened would be taken for it
            _to_nowhere(handle)
            stream = open(handle, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        try:
            handle = stream.fileno()
        except (AttributeError, OSError, ValueError):  # not of this process
            continue
        stream.flush()
        if name == "stderr":  # libraries write to the descriptor itself: see `algid.guard.begin`
            handle = os.dup(handle)
        raw, lines = io.BufferedWriter(_Pipe(handle, told_as)), name == "stderr" or stream.isatty()
        text = io.TextIOWrapper(raw, stream.encoding, "backslashreplace", line_buffering=lines)
        setattr(sys, name, text)
