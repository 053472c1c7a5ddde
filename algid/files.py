"""Files and folders appear whole or not at all, and what killed processes leave is removed.

TOML files are checked against a pydantic model, with errors that name file, place and remedy.
"""

from __future__ import annotations

import errno
import fcntl
import glob
import io
import os
import reprlib
import secrets
import shutil
import stat
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from algid.errors import OutputError, SettingError
from algid.limits import LIMITS

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

ModelT = TypeVar("ModelT", bound="BaseModel")


@contextmanager
def writing(place: Path | str, trouble: str = "cannot write") -> Iterator[None]:
    """What the system says against writing to `place` within the block becomes an `OutputError`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{place}: {trouble} ({error.strerror}); choose another folder with -o") from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to; it becomes `path` when the block ends well.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to.
    """
    temporary = path.parent / f".{path.name}.{secrets.token_hex(4)}"  # named before it is made, as below
    try:
        with writing(path, "cannot write there"):
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.touch(mode=0o600, exist_ok=False)
        with writing(path):
            yield temporary
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(path)
    finally:
        with suppress(OSError):  # it may never have been made: what is reported is why, not that
            temporary.unlink()


def read_whole(path: Path) -> bytes:
    """The content of a file that an option names, or that stands in a result's folder.

    Raises
    ------
    OSError
        If it cannot be read, has more bytes than `FileLimits.text_bytes`, or is no regular file: a pipe would be waited
        for, and a device has no end.
    """
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # else opening a pipe waits already
    with os.fdopen(handle, "rb") as stream:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        if found.st_size > LIMITS.text_bytes:
            raise OSError(errno.EFBIG, f"it has more than {LIMITS.text_bytes >> 20} MiB", str(path))
        return stream.read()


def read_text(path: Path, encoding: str = "utf-8") -> str:
    """The text of a file, its line ends made line feeds: see `read_whole`.

    Raises
    ------
    OSError
        As `read_whole`.
    UnicodeDecodeError
        If it is not in `encoding`.
    """
    return io.TextIOWrapper(io.BytesIO(read_whole(path)), encoding=encoding).read()


def read_toml(path: Path, model: type[ModelT]) -> ModelT:
    """Read `path` as a `model`.

    Raises
    ------
    SettingError
        If the file is missing, is not TOML, or does not fit the model (the first misfit is named).
    """
    from pydantic import ValidationError

    try:
        content = tomllib.loads(read_text(path))
    except OSError as error:
        raise SettingError(f"{path}: cannot read it ({error.strerror}); check the name") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SettingError(f"{path}: not TOML ({error}); mend that line") from error
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise SettingError(f"{path}: {first_misfit(error)}") from error


def first_misfit(error: ValidationError) -> str:
    """Where a pydantic model was not met, what was expected and what was found, in one line."""
    first, *others = error.errors(include_url=False, include_context=False)
    place = ".".join(str(part) for part in first["loc"]) or "top level"
    more = f" (and {len(others)} more)" if others else ""
    if first["type"] == "unexpected_keyword_argument":  # the same misfit has other words in a dataclass than in a model
        said = "extra inputs are not permitted"
    else:  # a unit or a code keeps its capitals
        words = first["msg"].partition(", unable to parse")[0]
        said = f"{words[:1].lower()}{words[1:]}".replace("input should be", "expected", 1)
    return f"{place}: {said}, found {reprlib.repr(first['input']):.60}{more}"


FRESH = 60.0  # s; a folder may be younger than the hold on it
TEMPORARY = "algid-"
"""What everything that algid puts into the system's temporary folder starts with."""


def result_folder(first_log: str, parent: Path, name: str | None = None) -> Path:
    """Where the result of a log goes: `parent/NAME.algid`, NAME the log's stem by default."""
    return parent / f"{Path(first_log).stem or 'log' if name is None else name}.algid"


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
    # Named before it is made: a signal may come as soon as it stands, and it must be taken away then too.
    temporary = folder.parent / f".{folder.name}.{secrets.token_hex(4)}"
    try:
        with writing(folder, "cannot write there"):
            folder.parent.mkdir(parents=True, exist_ok=True)
            temporary.mkdir(mode=0o755)
        with writing(folder):
            with _held(temporary, strictly=False):
                yield temporary
            _swap(temporary, folder)
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


def remove_whole(place: Path) -> None:
    """Remove a file or a folder at once, if it is there; a link goes, and what it leads to stays.

    Raises
    ------
    OSError
        If it cannot be removed.
    """
    aside = place.with_name(f".{place.name}.{secrets.token_hex(4)}")
    with suppress(FileNotFoundError):
        place.rename(aside)
        if aside.is_dir() and not aside.is_symlink():
            shutil.rmtree(aside)
        else:
            aside.unlink()


def remove_stale(folder: Path) -> None:
    """Remove what runs that were killed have left of `folder` half-written: such of which no process holds."""
    for found in folder.parent.glob(f".{glob.escape(folder.name)}.*"):
        aside = found.name.startswith(f".{folder.name}.old.")
        if not aside or folder.exists():  # else it may be all that is left of a result
            _remove_unheld(found)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for what is needed for a while; those of processes that were killed are removed on the way.

    Raises
    ------
    OutputError
        If none can be made.
    """
    place = Path(tempfile.gettempdir())
    for found in place.glob(f"{TEMPORARY}*"):
        _remove_unheld(found)
    try:
        folder = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=place))
    except OSError as error:
        raise OutputError(f"{place}: cannot write there ({error.strerror}); name another folder in TMPDIR") from error
    try:
        with _held(folder, strictly=False):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _remove_unheld(found: Path) -> None:
    """Remove a file or folder that is this user's, not fresh, and held by no process."""
    with suppress(OSError):
        seen = found.lstat()
        if seen.st_uid == os.getuid() and time.time() - seen.st_mtime > FRESH:
            with _held(found, strictly=True):
                shutil.rmtree(found) if found.is_dir() else found.unlink()


@contextmanager
def _held(place: Path, strictly: bool) -> Iterator[None]:
    """Hold a file or folder; the system lets go of it however this process ends.

    Raises
    ------
    OSError
        If the place cannot be opened; and, `strictly`, if its file system cannot hold it or another process does.
    """
    handle = os.open(place, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if strictly:
                raise
        yield
    finally:
        os.close(handle)
