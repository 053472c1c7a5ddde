"""Files and folders under construction: named after what they become, and held until they are that.

A process holds what it makes. The system lets go of it however the process ends, so that what
nobody holds is what a killed process left. Where a file system cannot hold, nothing is removed.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from algid.guard import tell

MARK = ".algid-"
"""Separates a temporary name's target from its eight digits: ``.NAME.algid-0123abcd``."""
OLD = ".algid-old-"
"""Likewise, of a result that makes room for its successor where the two cannot be exchanged."""
MOST_TRIES = 100
_LEFT = re.compile(
    rf"\.(?P<name>.*)(?P<kind>{re.escape(OLD)}|{re.escape(MARK)})[0-9a-f]{{8}}", re.DOTALL
)


@contextmanager
def under_construction(path: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """A name beside `path` that `make` has made, held within the block, and gone after it.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    temporary, handle = _made(path, make)
    try:
        yield temporary
    finally:
        try:
            os.close(handle)
        finally:
            remove(temporary)
            tell(f"-{temporary.absolute()}")


def new_file(path: Path) -> None:
    """Make an empty file that nobody else may read; raises `FileExistsError` where one stands."""
    path.touch(mode=0o600, exist_ok=False)


def new_folder(path: Path) -> None:
    """Make a folder; raises `FileExistsError` where something stands."""
    path.mkdir(mode=0o755)


def own_folder(path: Path) -> None:
    """The same, that nobody else may look into."""
    path.mkdir(mode=0o700)


def _made(path: Path, make: Callable[[Path], None]) -> tuple[Path, int]:
    """What `make` has made, and the hold on it.

    Another one where a sweep was quicker than the hold.

    Raises
    ------
    OSError
        Where it is busy each time, or cannot be made.
    BlockingIOError
        Where its folder is gone and another sweep holds the rest.
    FileNotFoundError
        Where its folder is gone.
    """
    for _ in range(MOST_TRIES):
        temporary = beside(path)
        tell(f"+{temporary.absolute()}")  # before it is made: its end may come as soon as it stands
        try:
            make(temporary)
            return temporary, held(temporary)
        except (BlockingIOError, FileNotFoundError):
            remove(temporary)
            tell(f"-{temporary.absolute()}")
            if not path.parent.is_dir():
                raise
        except BaseException:
            remove(temporary)
            tell(f"-{temporary.absolute()}")
            raise
    raise OSError(errno.EBUSY, os.strerror(errno.EBUSY), str(path))


def beside(path: Path, mark: str = MARK) -> Path:
    """A new name in the same folder, which tells what it is for."""
    return path.parent / f".{path.name}{mark}{secrets.token_hex(4)}"


def held(place: Path) -> int:
    """A handle that holds a file or folder, where its file system can.

    Raises
    ------
    FileNotFoundError
        If there is none of that name, or not any more.
    BlockingIOError
        If another process holds it.
    """
    handle = os.open(place, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        _lock(handle)
        if not os.path.samestat(os.fstat(handle), place.lstat()):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(place))
    except BaseException:
        os.close(handle)
        raise
    return handle


def _lock(handle: int) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # this file system cannot hold
        pass


def remove(place: Path) -> None:
    """Remove a file, a folder or a link, as far as it goes.

    a signal that comes meanwhile is raised after it.
    """
    try:
        _remove(place)
    except BaseException:
        _remove(place)
        raise


def _remove(place: Path) -> None:
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place, ignore_errors=True)
    else:
        with suppress(OSError):
            place.unlink()


def folders_below(root: Path) -> Iterator[tuple[str, list[str]]]:
    """A folder and those in it, each with the names of its other entries and algid's remains.

    Links are not followed, and what cannot be looked at is passed over. ``os.walk`` of Python 3.11
    ends at a thousand.
    """
    pending = [str(root)]
    while pending:
        folder = pending.pop()
        names, inner = [], []
        try:
            with os.scandir(folder) as entries:
                for one in entries:
                    if one.is_dir(follow_symlinks=False) and not _LEFT.fullmatch(one.name):
                        inner.append(f"{folder}/{one.name}")
                    else:
                        names.append(one.name)
        except OSError:
            continue
        yield folder, names
        pending += inner


def remove_left(folder: Path, name: str | None = None) -> None:
    """Remove what killed processes of this user have left in `folder`, of `name` or of anything.

    A result that was to make room and has no successor goes back to its place.
    """
    for left in _left_in(folder, name):
        with suppress(OSError):
            if os.lstat(left.path).st_uid == os.getuid():
                _take_away(left)


class _Left:
    """A possible remain: its path, the name it was made for, and whether it is an old result."""

    def __init__(self, folder: Path, entry: str, match: re.Match[str]) -> None:
        self.path = folder / entry
        self.target = folder / match["name"]
        self.old = match["kind"] == OLD


def _left_in(folder: Path, name: str | None) -> list[_Left]:
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if MARK in entry.name]
    except OSError:
        return []
    left = []
    for entry in names:
        match = _LEFT.fullmatch(entry)
        if match and name in (None, match["name"]):
            left.append(_Left(folder, entry, match))
    return left


def _take_away(found: _Left) -> None:
    """Remove what no process holds.

    Raises `OSError` where one does, or where nothing can be held.
    """
    handle = os.open(found.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if found.old and not os.path.lexists(found.target):
            found.path.rename(found.target)
        else:
            remove(found.path)
    finally:
        os.close(handle)


def put_file_in_place(temporary: Path, target: Path, *, replace: bool) -> None:
    """Give a file its name at one stroke.

    Raises
    ------
    FileExistsError
        If something stands there and is not to be replaced.
    OSError
        If the file cannot be renamed.
    """
    if replace:
        temporary.replace(target)
        return
    try:
        os.link(temporary, target, follow_symlinks=False)  # a rename would replace what is there
    except FileExistsError:
        raise
    except OSError as error:  # this file system has no second names
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error
        temporary.replace(target)
        return
    temporary.unlink()


def put_in_place(temporary: Path, target: Path, *, replace: bool) -> None:
    """Give a folder its name at one stroke.

    What stands there is exchanged for it and has its temporary name then; it is always whole,
    and never absent where the file system can exchange two names.

    Raises
    ------
    FileExistsError
        If something stands there and is not to be replaced.
    FileNotFoundError
        If there is no such folder.
    OSError
        If the folder cannot be renamed.
    """
    for _ in range(MOST_TRIES):
        try:
            if not (replace and os.path.lexists(target)):
                temporary.rename(target)
            elif not _exchanged(temporary, target):
                aside = beside(target, OLD)
                target.rename(aside)
                _rename_or_back(temporary, target, aside)
                remove(aside)
            return
        except FileNotFoundError:  # another run has moved it: look again
            if not os.path.lexists(temporary):
                raise
        except (
            OSError
        ) as error:  # a folder's name is given to no file, and to no folder that holds something
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise
            if not replace:
                raise FileExistsError(
                    errno.EEXIST, os.strerror(errno.EEXIST), str(target)
                ) from error
    raise OSError(errno.EBUSY, os.strerror(errno.EBUSY), str(target))


def _rename_or_back(temporary: Path, target: Path, aside: Path) -> None:
    try:
        temporary.rename(target)
    except BaseException:
        if os.path.lexists(target):
            remove(aside)  # another run's result stands there
        else:
            aside.rename(target)
        raise


_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # of linux/fcntl.h and linux/fs.h
_UNABLE = {errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM}


@cache
def _renameat2() -> Callable[..., int] | None:
    try:
        return ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):
        return None


def _exchanged(one: Path, other: Path) -> bool:
    """Whether two names could be exchanged at one stroke: Linux can, on most of its file systems.

    Raises
    ------
    OSError
        If either is absent, or may not be renamed.
    """
    rename = _renameat2()
    if rename is None:
        return False
    if (
        rename(
            _AT_FDCWD,
            os.fsencode(one),
            _AT_FDCWD,
            os.fsencode(other),
            ctypes.c_uint(_RENAME_EXCHANGE),
        )
        == 0
    ):
        return True
    number = ctypes.get_errno()
    if number in _UNABLE:
        return False
    raise OSError(number, os.strerror(number), str(other))
