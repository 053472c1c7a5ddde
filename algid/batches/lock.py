"""One batch at a time on one OUT, among the processes of one machine.

Object stores have no locks: two batches that run on one URL at the same time do the same jobs
twice, and each leaves a ``jobs.parquet`` of what it knows. Every object is whole all the
same, and the next batch takes up all records.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from algid.base.errors import OutputError
from algid.base.files import refuse_links
from algid.base.stores import is_url
from algid.batches.records import FOLDER
from algid.options import flag

DYING = 2.0  # s that the processes of a killed batch may take to be gone


@contextmanager
def locked(out: str, shared: bool = False) -> Iterator[None]:
    """Hold OUT, or share it with others that share it; the system lets go of it with the process.

    The file that stands for it stays: two processes that find none would lock two.

    Raises
    ------
    OutputError
        If another batch of this machine holds it, or it cannot be made.
    """
    if is_url(out):
        yield
        return
    path = Path(out, FOLDER, "lock")
    refuse_links(Path(out), f"{FOLDER}/lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError as error:
        raise OutputError(
            f"{out}: cannot write there ({error.strerror}); choose another folder with "
            f"{flag('out')}"
        ) from error
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    until = time.monotonic() + DYING
    try:
        while True:
            try:
                fcntl.flock(handle, kind | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() > until:
                    raise OutputError(
                        f"{out}: another batch is at work there; wait for it or choose another "
                        f"{flag('out')}"
                    ) from error
                time.sleep(0.02)
        yield
    finally:
        os.close(handle)
