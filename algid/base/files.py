"""Files and folders appear whole or not at all, and what killed processes leave is removed.

TOML files are checked against a pydantic model, with errors that name file, place and remedy.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import re
import reprlib
import stat
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from algid.base.errors import OutputError, SettingError
from algid.base.limits import LIMITS
from algid.base.staging import delete_leftovers, put, staged, temporary_name
from algid.guard import delete
from algid.options import flag

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

ModelT = TypeVar("ModelT", bound="BaseModel")


@contextmanager
def writing(place: Path | str, trouble: str = "cannot write") -> Iterator[None]:
    """What the system says against writing to `place` within the block becomes an `OutputError`."""
    try:
        yield
    except OSError as error:
        remedy = (
            "give a shorter name"
            if error.errno == errno.ENAMETOOLONG
            else f"choose another folder with {flag('out')}"
        )
        raise OutputError(f"{place}: {trouble} ({reason_of(error)}); {remedy}") from error


def reason_of(error: OSError) -> str:
    """What the system says, or the library that raises its exception."""
    return error.strerror or str(error).partition("\n")[0][:200] or type(error).__name__


def refuse_links(folder: Path, name: str) -> None:
    """Raise `OutputError` if a folder from `folder` to the future `name` links out of it."""
    place = folder
    for part in name.split("/")[:-1]:
        place /= part
        if place.is_symlink():
            raise OutputError(
                f"{place}: a link, which is not followed; make it a folder, or choose another one "
                f"with {flag('out')}"
            )


def whole_file(path: Path, *, force: bool = True) -> AbstractContextManager[Path]:
    """Give a temporary name beside `path` to write to; it becomes `path` when the block ends well.

    What killed runs left there is deleted first, once a folder: this looks through it.

    Parameters
    ----------
    path : Path
    force : bool
        Replace one that exists, also one that another process has made meanwhile.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to, or the file exists and `force` is not set.
    """
    return _whole(path, Path.touch, force)


def whole_folder(folder: Path, force: bool) -> AbstractContextManager[Path]:
    """Give a temporary folder to write to; see `whole_file`, whose errors it raises.

    A folder that is replaced stands there, whole, until its successor does.
    """
    return _whole(folder, Path.mkdir, force)


_delete_leftovers_once = cache(delete_leftovers)


@contextmanager
def _whole(place: Path, make: Callable[[Path], None], force: bool) -> Iterator[Path]:
    """A temporary file or folder by `make`, which becomes `place` when the block ends well."""
    refuse_existing(place, force)
    with ExitStack() as stack:
        with writing(place, "cannot write there"):
            place.parent.mkdir(parents=True, exist_ok=True)
            _delete_leftovers_once(place.parent.absolute())
            temporary = stack.enter_context(staged(place, make))
        with writing(place):
            yield temporary
            refuse_existing(place, force)  # another process may have made it meanwhile
            put(temporary, place)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files in the order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        # one of none is empty, or waits for ever, as /proc/kmsg does
        if file.is_file() and file.stat().st_size:
            with file.open("rb") as opened:
                hashlib.file_digest(opened, lambda: digest)
    return digest.hexdigest()


def read_whole(path: Path) -> bytes:
    """The content of a file that an option names, or that stands in a result's folder.

    Raises
    ------
    OSError
        As `read_start`, and if it has more bytes than `FileLimits.text_bytes`.
    """
    content = read_start(path, LIMITS.text_bytes + 1)
    if len(content) > LIMITS.text_bytes:
        raise OSError(errno.EFBIG, f"it has more than {LIMITS.text_bytes >> 20} MiB", str(path))
    return content


def read_start(path: Path, most: int) -> bytes:
    """The first `most` bytes of a file.

    A file of no size is empty, whatever reading it would bring: those that the kernel makes up,
    such as /proc/kmsg, say that they have none, and some of them wait for ever.

    Raises
    ------
    OSError
        If it cannot be read or is no regular file: a pipe would be waited for, and a device has no
        end.
    """
    # else opening a pipe waits already
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as stream:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        if not status.st_size:
            return b""
        return stream.read(most)


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

    content = toml_content(path)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise SettingError(f"{path}: {first_misfit(error)}") from error


def toml_content(path: Path) -> dict[str, Any]:
    """What stands in a TOML file, not held against any model yet.

    Raises
    ------
    SettingError
        If the file is missing or is not TOML.
    """
    try:
        return parsed_toml(read_text(path))
    except OSError as error:
        raise SettingError(f"{path}: cannot read it ({error.strerror}); check the name") from error
    except (ValueError, RecursionError) as error:
        raise SettingError(f"{path}: not TOML ({error}); mend that line") from error


def parsed_toml(text: str) -> dict[str, Any]:
    """The content of a TOML document that does not ask for more work than any honest one.

    Raises
    ------
    ValueError
        If it is not TOML, or larger than `LIMITS` allow.
    RecursionError
        If lists or tables lie too deep within one another.
    """
    if len(text) > LIMITS.toml_bytes:
        raise ValueError(f"more than {LIMITS.toml_bytes >> 20} MiB")
    return tomllib.loads(text)


def first_misfit(error: ValidationError) -> str:
    """Where a pydantic model was not met, what was expected and what was found, in one line."""
    return ": ".join(misfit(error))


def misfit(error: ValidationError) -> tuple[str, str]:
    """Where a pydantic model was not met; and what was expected and what was found."""
    errors = error.errors(include_url=False, include_context=False)
    first, more = errors[0], ""
    place = ".".join(map(str, first["loc"])) or "top level"
    if len(errors) > 1:
        more = f" (and {len(errors) - 1} more)"
    # the same misfit has other words in a dataclass than in a model
    if first["type"] == "unexpected_keyword_argument":
        said = "extra inputs are not permitted"
    else:  # a unit or a code keeps its capitals
        words = first["msg"].partition(", unable to parse")[0].removeprefix("Value error, ")
        said = f"{words[:1].lower()}{words[1:]}".replace("input should be", "expected", 1)
    try:
        found = reprlib.repr(first["input"])
    except ValueError:  # Python prints no whole number of more than 4,300 digits
        found = "a number of too many digits"
    return place, f"{said}, found {found:.60}{more}"


def result_folder(first_log: str, parent: Path, name: str | None = None) -> Path:
    """Where the result of a log goes: `parent/NAME.algid`, NAME the log's stem by default."""
    if name is None:
        name = Path(first_log).stem or "log"
    return parent / f"{name}.algid"


def refuse_misleading(name: str | None) -> None:
    """Raise `SettingError` if the name of a result's folder is empty or leads elsewhere."""
    odd = name is not None and ("/" in name or not name.isprintable())
    if odd or name in ("", ".", ".."):
        raise SettingError(
            f"{flag('name')}: expected a name for the result folder, without slashes, found "
            f"{name!r:.60}; {flag('out')} names the folder around it"
        )


def refuse_url(place: Path | str) -> None:
    """Raise `OutputError` where a folder's path is a URL, which would make folders of its parts."""
    if re.match(r"[A-Za-z][\w+.-]+:/", str(place)):
        raise OutputError(
            f"{place}: expected a folder of this machine, found a URL; algid batch alone writes to "
            "s3://, gs:// and az://, spelled so"
        )


def refuse_existing(folder: Path, force: bool) -> None:
    """Raises `OutputError` where `folder` is a URL, or exists and is not to be replaced."""
    refuse_url(folder)
    if os.path.lexists(folder) and not force:
        raise OutputError(
            f"{folder}: exists already; choose another folder with {flag('out')}, or replace it "
            f"with {flag('force')}"
        )


def remove_whole(place: Path) -> None:
    """Remove a file or a folder at once, if it is there; a link goes, and what it leads to stays.

    Raises
    ------
    OSError
        If it cannot be removed.
    """
    aside = temporary_name(place)
    with suppress(FileNotFoundError):
        place.rename(aside)
        delete(aside)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for what is needed for a while.

    Those of processes that were killed are removed on the way.

    Raises
    ------
    OutputError
        If none can be made.
    """
    with ExitStack() as stack:
        try:
            place = Path(tempfile.gettempdir(), "algid")
            delete_leftovers(place.parent)
            folder = stack.enter_context(staged(place, lambda own: own.mkdir(mode=0o700)))
        except OSError as error:
            raise OutputError(
                f"no temporary folder can be made ({reason_of(error)}); name one in TMPDIR"
            ) from error
        yield folder
