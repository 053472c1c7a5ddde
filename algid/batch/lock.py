"""One batch at a time on one OUT."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import socket
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from algid.errors import OutputError
from algid.stores import ObjectStore, is_url, open_store

LOCK = ".lock"
STALE = 300.0  # s without a sign of life
SIGN_OF_LIFE = 60.0  # s
SETTLE = 1.0  # s


@contextmanager
def locked(out: str) -> Iterator[None]:
    """Hold OUT; on this machine the system lets go of it however this process ends.

    Raises
    ------
    OutputError
        If another batch holds it, or it cannot be made.
    """
    with _locked_here(out):
        store = open_store(out) if is_url(out) else None
        if not isinstance(store, ObjectStore):
            yield
            return
        with _locked_there(store, out):
            yield


@contextmanager
def _locked_here(out: str) -> Iterator[None]:
    """Hold OUT among the processes of this machine."""
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
        return Path(out) / LOCK
    name = hashlib.sha256(out.encode()).hexdigest()[:24]
    return Path(tempfile.gettempdir()) / f"algid-{os.getuid()}-{name}.lock"


@contextmanager
def _locked_there(store: ObjectStore, out: str) -> Iterator[None]:
    """Hold OUT among machines by an object that names its owner and is written anew every `SIGN_OF_LIFE`.

    No lock in the strict sense: pyarrow offers no write on condition. Whoever writes looks again after `SETTLE`, and
    the last writer stays. Two batches hold OUT where more than `SETTLE` passes in one of them between its look and
    its write, where clocks of machines differ by `STALE`, or where one was halted for as long and goes on.
    """
    owner = {"owner": uuid.uuid4().hex, "host": socket.gethostname(), "process": os.getpid()}
    _refuse(_holder(store), out)
    _sign(store, owner)
    time.sleep(SETTLE)
    if (holder := _holder(store)).get("owner") != owner["owner"]:
        _refuse(holder, out)
    ended = threading.Event()
    living = threading.Thread(target=_live, args=(store, owner, ended), daemon=True)
    living.start()
    try:
        yield
    finally:
        ended.set()
        living.join()
        if _holder(store).get("owner") == owner["owner"]:
            store.remove(LOCK)


def _live(store: ObjectStore, owner: dict[str, Any], ended: threading.Event) -> None:
    while not ended.wait(SIGN_OF_LIFE):
        with suppress(OutputError):  # the store may be out of reach for a while
            _sign(store, owner)


def _sign(store: ObjectStore, owner: dict[str, Any]) -> None:
    store.write(LOCK, json.dumps(owner | {"time": time.time()}).encode())


def _holder(store: ObjectStore) -> dict[str, Any]:
    try:
        found = json.loads(store.read(LOCK) or b"{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _refuse(holder: dict[str, Any], out: str) -> None:
    """Refuse where the holder lives; one of this machine does not, since its lock here is gone."""
    age = time.time() - float(holder.get("time", 0))
    if age > STALE or holder.get("host") == socket.gethostname():
        return
    raise OutputError(
        f"{out}: a batch on {holder.get('host')} (process {holder.get('process')}) was at work there {age:.0f} s ago; "
        f"wait for it, or for {STALE / 60:.0f} minutes after its death, or choose another -o"
    )
