"""Files and folders appear whole or not at all, whenever the process that makes them is killed.

They are made under a temporary name beside their own, which is locked while in use: an unlocked
one was left by a killed process and is deleted. Where a file system has no locks, none is.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from algid.guard import delete, tell

TEMPORARY = f".*.algid-{'[0-9a-f]' * 8}"
"""Pattern of temporary names: ``.NAME.algid-0123abcd``."""
_HERE, _EXCHANGE = -100, 2  # of linux/fcntl.h and linux/fs.h


def temporary_name(path: Path) -> Path:
    """A new name in the same folder."""
    return path.parent / f".{path.name}.algid-{secrets.token_hex(4)}"


@contextmanager
def staged(path: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """A temporary name beside `path` that `make` has made; it is deleted after the block.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    temporary = temporary_name(path)
    tell(f"+{temporary.absolute()}")  # first: the process may be killed as soon as it stands
    with ExitStack() as stack:
        stack.callback(tell, f"-{temporary.absolute()}")
        stack.callback(delete, temporary)
        while not temporary.exists():  # or not any more: unlocked, it looks like a leftover
            make(temporary)
            with suppress(OSError):  # this file system has no locks
                handle = os.open(temporary, os.O_RDONLY)
                stack.callback(os.close, handle)
                fcntl.flock(handle, fcntl.LOCK_EX)
        yield temporary


def delete_leftovers(folder: Path) -> None:
    """Delete what killed processes left in `folder`."""
    for place in folder.glob(TEMPORARY):
        with suppress(OSError), ExitStack() as stack:
            handle = os.open(place, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            stack.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            delete(place)


def put(temporary: Path, target: Path) -> None:
    """Give a staged file or folder its name at one stroke; a folder takes the place of anything.

    What a folder replaces has the temporary name then. It is never absent where the file system
    can exchange two names, as most of Linux can.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    try:
        temporary.rename(target)
    except OSError:
        if not (temporary.is_dir() and os.path.lexists(target)):
            raise
        exchange = getattr(ctypes.CDLL(None), "renameat2", None)
        names = _HERE, os.fsencode(temporary), _HERE, os.fsencode(target)
        if exchange is None or exchange(*names, ctypes.c_uint(_EXCHANGE)) != 0:
            aside = temporary_name(target)
            target.rename(aside)
            temporary.rename(target)
            delete(aside)
