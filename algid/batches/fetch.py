"""Fetch logs from an object store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import AlgidError, LogError
from algid.base.stores import public, reading
from algid.identification.open_logs import Staged

if TYPE_CHECKING:
    from pyarrow import NativeFile
    from pyarrow.fs import FileSystem

_PIECE = 1 << 23


def staged(url: str, folder: Path) -> Staged:
    """A copy of a log in `folder`.

    Raises
    ------
    LogError
        If there is no such object, it cannot be read, or another took its place meanwhile.
    """
    with reading(url) as (filesystem, path):
        folder.mkdir(parents=True, exist_ok=True)
        copy = folder / path.rpartition("/")[2]
        with _one_version(filesystem, path, url) as source, copy.open("wb") as target:
            while piece := source.read(_PIECE):
                target.write(piece)
    return Staged(copy, public(url), whole=True)


@contextmanager
def _one_version(filesystem: FileSystem, path: str, url: str) -> Iterator[NativeFile]:
    """An object, opened; looked at again when the block ends.

    Requests for parts of an object tell nothing of each other: where it was replaced between two
    of them, what was fetched is of neither, and what its reader complains of is not the cause.

    Raises
    ------
    LogError
        If another object stands in its place then.
    """
    with filesystem.open_input_file(path) as source:
        metadata = source.metadata()
        failure: Exception | None = None
        try:
            yield source
        except (OSError, AlgidError) as error:
            failure = error
        with filesystem.open_input_file(path) as again:
            if again.metadata() != metadata:
                raise LogError(f"{url}: it was replaced while it was read; run again") from failure
        if failure is not None:
            raise failure


@contextmanager
def errors_name_url(copies: dict[Path, str]) -> Iterator[None]:
    """Errors about copies name the objects that they are of."""
    try:
        yield
    except AlgidError as error:
        text = str(error)
        for copy, url in copies.items():
            text = text.replace(str(copy), url)
        if text == str(error):
            raise
        raise type(error)(text) from error
