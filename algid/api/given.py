"""What callers give in one of several forms: text or parts, results or their files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.base.errors import SettingError
from algid.base.files import whole_folder
from algid.options import flag

if TYPE_CHECKING:
    from algid.results import Result


def parts_of(given: str | Iterable[Any]) -> Iterable[Any]:
    """The parts of text between commas, or what comes in parts already."""
    if isinstance(given, str):
        return given.split(",")
    return given


def numbers(name: str, given: Any, most: Sequence[float], like: str) -> Any:
    """As many numbers as `most`, each at most as large as that one, out of parts or text.

    Raises
    ------
    SettingError
        If they are none such; it says what they are `like`.
    """
    try:
        found = tuple(float(part) for part in parts_of(given))
    except (TypeError, ValueError):
        found = ()
    if len(found) != len(most) or not all(map(float.__le__, map(abs, found), most)):
        raise SettingError(f"{flag(name)}: expected {like}, found {given!r:.60}")
    return found


def opened(given: Result | str | Path) -> Result:
    """A result, read where its file or folder is given."""
    from algid.results import Result, read_result

    if isinstance(given, Result):
        return given
    return read_result(given)


def called(given: Result | str | Path) -> str:
    """What a result is called where it is wrong: its file, or its log."""
    if isinstance(given, str | Path):
        return str(given)
    return given.log.path


def folder_or_none(folder: Path | None, force: bool) -> AbstractContextManager[Path | None]:
    """A folder to write into, whole or not at all; None where nothing is to be written."""
    if folder is None:
        return nullcontext()
    return whole_folder(folder, force)
