"""One batch at a time on one OUT."""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from algid.errors import OutputError
from algid.stores import is_url


@contextmanager
def locked(out: str) -> Iterator[None]:
    """Hold OUT; the system lets go of it however this process ends.

    An object store knows no locks: there the lock holds among the batches of this machine and user.

    Raises
    ------
    OutputError
        If another batch holds it, or it cannot be made.
    """
    path = _lock_file(out)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise OutputError(f"{out}: cannot write there ({error.strerror}); choose another folder with -o") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise OutputError(f"{out}: another batch is at work there; wait for it or choose another -o") from error
        yield
    finally:
        os.close(handle)


def _lock_file(out: str) -> Path:
    if not is_url(out):
        return Path(out) / ".lock"
    name = hashlib.sha256(out.encode()).hexdigest()[:24]
    return Path(tempfile.gettempdir()) / f"algid-{os.getuid()}-{name}.lock"
