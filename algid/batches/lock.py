"""One batch at a time on one OUT, among the processes of one machine.

Object stores have no locks: two machines that run batches on one URL at the same time do the same
jobs twice, and each leaves a ``jobs.parquet`` of what it knows. Every object is whole all the
same, and the next batch takes up all records.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from algid.errors import OutputError
from algid.options import flag
from algid.stores import is_url, public

LOCK = ".lock"
DYING = 2.0  # s that the processes of a killed batch may take to be gone


@contextmanager
def locked(out: str) -> Iterator[None]:
    """Hold OUT; the system lets go of it however this process ends.

    Raises
    ------
    OutputError
        If another batch of this machine holds it, or it cannot be made.
    """
    path = lock_file(out)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = _held(path)
    except BlockingIOError as error:
        raise OutputError(
            f"{out}: another batch is at work there; wait for it or choose another {flag('out')}"
        ) from error
    except OSError as error:
        raise OutputError(
            f"{out}: cannot write there ({error.strerror}); choose another folder with "
            f"{flag('out')}"
        ) from error
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def lock_file(out: str) -> Path:
    """The file that stands for OUT: in it, or in the temporary folder where OUT is no folder."""
    if not is_url(out):
        return Path(out) / LOCK
    name = hashlib.sha256(public(out).encode()).hexdigest()[:24]
    return Path(tempfile.gettempdir()) / f"algid-{os.getuid()}-{name}.lock"


def _held(path: Path) -> int:
    """A handle that holds the file; one that its last holder removed meanwhile is made anew.

    Processes of a batch that was killed hold it until they are gone.

    Raises
    ------
    OSError
        If it cannot be opened, or another batch holds it: then a `BlockingIOError`.
    BlockingIOError
        As above.
    """
    until = time.monotonic() + DYING
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        except FileNotFoundError:
            pass
        except BlockingIOError:
            if time.monotonic() > until:
                os.close(handle)
                raise
            time.sleep(0.02)
        except OSError:
            os.close(handle)
            raise
        os.close(handle)
