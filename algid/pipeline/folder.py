"""A result folder appears whole or not at all."""

from __future__ import annotations

import glob
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from algid.errors import OutputError

FRESH = 60.0  # s; a folder may be younger than the hold on it


def result_folder(first_log: str, parent: Path) -> Path:
    """Where the result of a log goes: `parent/STEM.algid`."""
    return parent / f"{Path(first_log).stem or 'log'}.algid"


def refuse_existing(folder: Path, force: bool) -> None:
    """Raises `OutputError` where `folder` exists and is not to be replaced."""
    if folder.exists() and not force:
        raise OutputError(f"{folder}: exists already; choose another folder with -o, or replace it with --force")


@contextmanager
def whole_folder(folder: Path, force: bool) -> Iterator[Path]:
    """Give a temporary folder to write to; it becomes `folder` when the block ends well.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to, or exists and `force` is not set.
    """
    refuse_existing(folder, force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise OutputError(f"{folder}: cannot write there ({error.strerror}); choose another folder with -o") from error
    try:
        temporary.chmod(0o755)
        with _held(temporary, strictly=False):
            yield temporary
        _swap(temporary, folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot write ({error.strerror}); choose another folder with -o") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _swap(temporary: Path, folder: Path) -> None:
    if not folder.exists():
        temporary.rename(folder)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}.old.", dir=folder.parent))
    folder.rename(aside / folder.name)
    temporary.rename(folder)
    shutil.rmtree(aside, ignore_errors=True)


def remove_stale(folder: Path) -> None:
    """Remove what runs that were killed have left of `folder` half-written: such of which no process holds."""
    for found in folder.parent.glob(f".{glob.escape(folder.name)}.*"):
        with suppress(OSError):
            aside = found.name.startswith(f".{folder.name}.old.")
            if aside and not folder.exists():  # it may be all that is left of a result
                continue
            if time.time() - found.stat().st_mtime > FRESH:
                with _held(found, strictly=True):
                    shutil.rmtree(found, ignore_errors=True)


@contextmanager
def _held(folder: Path, strictly: bool) -> Iterator[None]:
    """Hold a folder; the system lets go of it however this process ends.

    Not every file system can: raises `OSError` there, or where another process holds it, if asked to be strict.
    """
    if sys.platform == "win32":
        if strictly:
            raise OSError("folders cannot be held")
        yield
        return
    import fcntl

    handle = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        with nullcontext() if strictly else suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)
