"""Places of files: a local folder, or a prefix of an object store at s3://, gs:// or az://.

Files appear whole or not at all: on this machine through `algid.base.files.whole_file`, in object
stores by their nature.

A URL names an object by its key, percent-encoded: ``%3F`` for ``?``, ``%23`` for ``#``, ``%25``
for ``%``. Whatever else no URL may hold, such as blanks, may stand as it is. URLs of objects that
are found below a prefix are encoded and keep the prefix's credentials, which are neither printed
nor kept.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from algid.base.errors import AlgidError, LogError, OutputError, without_credentials
from algid.base.files import read_whole, refuse_links, refuse_url, remove_whole, whole_file

if TYPE_CHECKING:
    from pyarrow.fs import FileSystem

MOST_LISTED = 1_000_000
"""Entries below a prefix or a folder: more are no robot's logs."""
SCHEMES = ("s3://", "gs://", "az://")
_SAFE = "/%!$&'()*+,;=:@~"
"""What stands in the path of a URL as it is, beside letters, digits and ``-._``."""


def is_url(path: str) -> bool:
    """Whether a path is the URL of an object."""
    return path.startswith(SCHEMES)


def absolute(place: str) -> str:
    """A path as it reads in every folder; a URL does already."""
    if is_url(place):
        return place
    return str(Path(place).absolute())


def shown(place: str) -> str:
    """A folder's path or URL for messages: without credentials and without the query."""
    if not is_url(place):
        return place
    return without_credentials(place).partition("?")[0].rstrip("/")


@dataclass(frozen=True)
class Store:
    """Files by their names below one root.

    Parameters
    ----------
    filesystem : pyarrow's
    root : path within it
    place : the root as it is printed
    folder : the same root, where it is a folder of this machine
    """

    filesystem: FileSystem
    root: str
    place: str
    folder: Path | None = None

    def read(self, name: str) -> bytes | None:
        """The content, or None where there is no such file.

        Raises `LogError` where it cannot be read.
        """
        with _translated(f"{self.place}/{name}", LogError, "it cannot be read"):
            try:
                if self.folder is not None:
                    return read_whole(self.folder / name)
                with self.filesystem.open_input_file(f"{self.root}/{name}") as stream:
                    return bytes(stream.readall())
            except FileNotFoundError:
                return None

    def write(self, name: str, content: bytes) -> None:
        """Write the whole file. Raises `OutputError`."""
        if self.folder is not None:
            refuse_links(self.folder, name)
            with whole_file(self.folder / name) as temporary:
                temporary.write_bytes(content)
            return
        with (
            _translated(f"{self.place}/{name}", OutputError, "cannot write there"),
            self.filesystem.open_output_stream(f"{self.root}/{name}") as stream,
        ):
            stream.write(content)

    def remove(self, name: str) -> None:
        """Remove a file, or a folder with all that is in it; nothing where there is none.

        Raises `OutputError`.
        """
        from pyarrow.fs import FileType

        path = f"{self.root}/{name}"
        with _translated(f"{self.place}/{name}", OutputError, "it cannot be removed"):
            if self.folder is not None:
                refuse_links(self.folder, name)
                remove_whole(self.folder / name)
                return
            kind = self.filesystem.get_file_info(path).type
            if kind == FileType.Directory:
                self.filesystem.delete_dir(path)
            elif kind != FileType.NotFound:
                self.filesystem.delete_file(path)

    def names(self, under: str) -> list[str]:
        """Names of the files below the folder `under`, sorted; hidden ones are left out.

        Raises
        ------
        OutputError
            If they cannot be listed, are too many, or their bucket does not exist.
        """
        from pyarrow.fs import FileSelector, FileType

        start = len(self.root) + 1
        if self.folder is not None:  # links to folders and unreadable ones are passed over
            return sorted(
                f"{place}/{name}"[start:]
                for place, _, names in os.walk(self.folder / under)
                for name in names
                if name[0] != "." and Path(place, name).is_file()
            )
        path = f"{self.root}/{under}".rstrip("/")
        with _translated(self.place, OutputError, "its objects cannot be listed"):
            entries = self.filesystem.get_file_info(
                FileSelector(path, recursive=True, allow_not_found=True)
            )
            bucket = self.root.partition("/")[0]
            gone = not entries and self.filesystem.get_file_info(bucket).type == FileType.NotFound
        if gone:
            raise OutputError(f"{self.place}: there is no such bucket; check its name, or make it")
        if len(entries) > MOST_LISTED:
            raise OutputError(
                f"{self.place}: expected at most {MOST_LISTED:,} objects, found {len(entries):,}; "
                "name a prefix of fewer"
            )
        files = (one for one in entries if one.is_file and not one.base_name.startswith("."))
        return sorted(one.path[start:] for one in files)

    def exists(self, name: str) -> bool:
        """Whether there is such a file. Raises `LogError` where that cannot be known."""
        with _translated(f"{self.place}/{name}", LogError, "it cannot be looked at"):
            return bool(self.filesystem.get_file_info(f"{self.root}/{name}").is_file)


def open_store(place: str) -> Store:
    """The store at a folder's path or an object store's URL.

    Raises
    ------
    OutputError
        If the URL cannot be understood or reached, or is of another kind.
    """
    from pyarrow.fs import LocalFileSystem

    if is_url(place):
        filesystem, path = connect(place)
        return Store(filesystem, path, shown(place))
    refuse_url(place)
    folder = Path(place).absolute()
    root = folder.as_posix().rstrip("/")
    return Store(LocalFileSystem(), root, root, folder)


def connect(url: str) -> tuple[FileSystem, str]:
    """Pyarrow's file system behind a URL, and the path within it.

    Raises
    ------
    OutputError
        If the URL cannot be understood or reached.
    """
    from pyarrow.fs import FileSystem

    if "#" in url:  # it would cut off the query, and with it the host that the credentials are for
        raise OutputError(f"{url}: no # may stand in a URL; write %23 for one in a key")
    base, mark, query = url.partition("?")
    scheme, _, path = base.partition("://")
    if scheme == "az":
        scheme = "abfs"
    with _translated(url, OutputError, "the object store cannot be reached", "check the URL"):
        path = quote(re.sub("%(?![0-9A-Fa-f]{2})", "%25", path), safe=_SAFE)
        filesystem, place = FileSystem.from_uri(f"{scheme}://{path}{mark}{query}")
    return filesystem, place.rstrip("/")


def list_urls(url: str) -> list[tuple[str, str]]:
    """Objects at or below a URL: each one's URL, and its name below it.

    Raises `OutputError` as `Store.names` does.
    """
    filesystem, root = connect(url)
    store = Store(filesystem, root, shown(url))
    base, mark, query = url.partition("?")
    below = [(f"{base.rstrip('/')}/{quote(name)}{mark}{query}", name) for name in store.names("")]
    return below or [(url, store.root.rpartition("/")[2])]


@contextmanager
def reading(url: str) -> Iterator[tuple[Any, str]]:
    """The file system and path of an object.

    Raises
    ------
    LogError
        If the object cannot be read within the block.
    """
    filesystem, path = connect(url)
    with _translated(url, LogError, "it cannot be read"):
        yield filesystem, path


@contextmanager
def _translated(
    place: str, kind: type[AlgidError], what: str, do: str = "check name and rights"
) -> Iterator[None]:
    """Turn errors of a store's client into ours: the place, `what` failed, and what to do."""
    import pyarrow as pa

    try:
        yield
    except (OSError, UnicodeError, pa.ArrowException) as error:
        # before it is cut, so that no half of a secret stays
        said = without_credentials(str(error)).partition("\n")[0][:200]
        raise kind(f"{place}: {what} ({said}); {do}") from error


def put_folder(store: Store, name: str, folder: Path) -> None:
    """Make the objects below `name` those of a result's folder.

    ``result.json`` vouches for the others: the one that is there goes before any of them, the new
    one comes last. Therefore it is taken out of the folder.

    Raises
    ------
    OutputError
        If a file cannot be written, or one that is there cannot be removed.
    """
    from pyarrow.fs import copy_files

    voucher = folder / "result.json"
    content = voucher.read_bytes()
    voucher.unlink()
    store.remove(f"{name}/result.json")
    store.remove(name)
    with _translated(f"{store.place}/{name}", OutputError, "cannot write there"):
        copy_files(str(folder), f"{store.root}/{name}", destination_filesystem=store.filesystem)
    store.write(f"{name}/result.json", content)
