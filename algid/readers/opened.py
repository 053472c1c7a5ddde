"""A file that is open and read by offset, of any format of records."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Self

from algid.errors import LogError


class OpenedFile:
    """A file that is read by offset while it is entered.

    Parameters
    ----------
    path : Path
    damaged : type of exception
        Raised where bytes are asked for that the file does not have.

    Attributes
    ----------
    size, changed_ns : int
        Bytes, and when it was changed last.
    read_bytes : int
        Bytes that were read so far.
    """

    def __init__(self, path: Path, damaged: type[Exception]) -> None:
        self.path = path
        self.size = self.changed_ns = self.read_bytes = 0
        self._damaged = damaged
        self._handle = -1

    def __enter__(self) -> Self:
        try:
            self._handle = os.open(self.path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise LogError(f"{self.path}: the log cannot be read ({error.strerror})") from error
        status = os.fstat(self._handle)
        self.size, self.changed_ns = status.st_size, status.st_mtime_ns
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._handle)

    def read(self, start: int, length: int) -> bytes:
        """The bytes at `start`; the error of damage where the file ends before."""
        if start < 0 or length < 0 or start + length > self.size:
            raise self._damaged(f"bytes {start} to {start + length} of a file of {self.size}")
        self.read_bytes += length
        content = os.pread(self._handle, length, start)
        if len(content) != length:
            raise self._damaged(f"bytes {start} to {start + length} cannot be read")
        return content
