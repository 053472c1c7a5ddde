"""A result folder appears whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from algid.errors import OutputError


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
