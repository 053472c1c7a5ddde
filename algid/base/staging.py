"""Files and folders appear whole or not at all, whenever the process that makes them is killed.

They are made under a temporary name beside their own, which is locked while in use: an unlocked
one was left by a killed process and is deleted. Where a file system has no locks, none is.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from algid.guard import tell

TEMPORARY = f".*.algid-{'[0-9a-f]' * 8}"
"""Pattern of temporary names: ``.NAME.algid-0123abcd``."""
_HERE, _NOREPLACE, _EXCHANGE = -100, 1, 2  # of linux/fcntl.h and linux/fs.h
_CANNOT = (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM)


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


def delete(place: Path) -> None:
    """Delete a file, a link or a folder, as far as it goes."""
    shutil.rmtree(place, ignore_errors=True)
    with suppress(OSError):
        place.unlink()


def delete_leftovers(folder: Path) -> None:
    """Delete what killed processes left in `folder`."""
    for place in folder.glob(TEMPORARY):
        with suppress(OSError), ExitStack() as stack:
            handle = os.open(place, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            stack.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            delete(place)


def put(temporary: Path, target: Path, *, replace: bool) -> None:
    """Give a staged file or folder its name at one stroke.

    A folder that is replaced has the temporary name then. It is never absent where the file system
    can exchange two names, as most of Linux can.

    Raises
    ------
    FileExistsError
        If something stands there and is not to be replaced.
    FileNotFoundError
        If what was staged is gone.
    OSError
        If it cannot be renamed.
    """
    if replace and temporary.is_file():
        temporary.replace(target)
        return
    there = os.path.lexists(target)
    if there and not replace:
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    try:
        if not _renamed(temporary, target, _EXCHANGE if there else _NOREPLACE):
            aside = temporary_name(target)
            if there:
                target.rename(aside)
            temporary.rename(target)
            delete(aside)
    except (FileExistsError, FileNotFoundError):
        if not (replace and os.path.lexists(temporary)):
            raise
        put(temporary, target, replace=replace)  # another process was quicker


def _renamed(one: Path, other: Path, flag: int) -> bool:
    """Rename as Linux can; False where the system or the file system cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    names = (_HERE, os.fsencode(one), _HERE, os.fsencode(other), ctypes.c_uint(flag))
    if rename is None or rename(*names) == 0:
        return rename is not None
    if (number := ctypes.get_errno()) in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(other))
