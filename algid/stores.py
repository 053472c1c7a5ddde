"""Where files live: folders of this machine, and object stores behind s3://, gs:// and az://.

An object appears whole or not at all, as a file does through `algid.files.whole_file`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from algid.errors import LogError, OutputError
from algid.files import whole_file

SCHEMES = ("s3://", "gs://", "az://")


def is_url(path: str) -> bool:
    """Whether a path is the URL of an object."""
    return path.startswith(SCHEMES)


class Store(Protocol):
    """Files by their names below one root."""

    def read(self, name: str) -> bytes | None:
        """The content, or None where there is no such file."""

    def write(self, name: str, content: bytes) -> None:
        """Write the whole file. Raises `OutputError`."""

    def names(self, under: str) -> list[str]:
        """Names of the files below the folder `under`, sorted."""

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""


@dataclass(frozen=True)
class FolderStore:
    """A folder of this machine."""

    root: Path

    def read(self, name: str) -> bytes | None:
        """The content, or None where there is no such file."""
        try:
            return (self.root / name).read_bytes()
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write the whole file. Raises `OutputError`."""
        with whole_file(self.root / name) as temporary:
            temporary.write_bytes(content)

    def names(self, under: str) -> list[str]:
        """Names of the files below the folder `under`, sorted; hidden ones are left out."""
        files = (path for path in (self.root / under).rglob("*") if path.is_file() and not path.name.startswith("."))
        return sorted(path.relative_to(self.root).as_posix() for path in files)

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        return (self.root / name).is_file()


@dataclass(frozen=True)
class ObjectStore:
    """A prefix of an object store, through pyarrow."""

    filesystem: Any
    root: str

    def read(self, name: str) -> bytes | None:
        """The content, or None where there is no such object."""
        try:
            with self.filesystem.open_input_file(f"{self.root}/{name}") as stream:
                return bytes(stream.readall())
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write the whole object. Raises `OutputError`."""
        try:
            with self.filesystem.open_output_stream(f"{self.root}/{name}") as stream:
                stream.write(content)
        except OSError as error:
            raise OutputError(
                f"{self.root}/{name}: cannot write there ({_told_by(error)}); check rights and name"
            ) from error

    def names(self, under: str) -> list[str]:
        """Names of the objects below `under`, sorted."""
        from pyarrow.fs import FileSelector, FileType

        place = f"{self.root}/{under}".rstrip("/")
        found = self.filesystem.get_file_info(FileSelector(place, recursive=True, allow_not_found=True))
        return sorted(info.path.removeprefix(f"{self.root}/") for info in found if info.type == FileType.File)

    def exists(self, name: str) -> bool:
        """Whether there is such an object."""
        from pyarrow.fs import FileType

        return bool(self.filesystem.get_file_info(f"{self.root}/{name}").type == FileType.File)

    def remove(self, name: str) -> None:
        """Remove an object, if it is there."""
        with suppress(FileNotFoundError):
            self.filesystem.delete_file(f"{self.root}/{name}")


def open_store(place: str) -> Store:
    """The store at a folder's path or an object store's URL.

    Raises
    ------
    OutputError
        If the URL cannot be understood or reached.
    """
    if not is_url(place):
        return FolderStore(Path(place))
    filesystem, root = connect(place)
    return ObjectStore(filesystem, root)


def connect(url: str) -> tuple[Any, str]:
    """pyarrow's file system behind a URL, and the path within it.

    Raises
    ------
    OutputError
        If the URL cannot be understood or reached.
    """
    import pyarrow as pa
    from pyarrow.fs import FileSystem

    try:
        filesystem, path = FileSystem.from_uri(url.replace("az://", "abfs://", 1))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise OutputError(f"{url}: the object store cannot be reached ({_told_by(error)}); check the URL") from error
    return filesystem, path.rstrip("/")


def list_urls(url: str) -> list[tuple[str, str]]:
    """Objects at or below a URL: each one's URL, and its name below it."""
    filesystem, root = connect(url)
    scheme, _, query = url.partition("://")[0], *url.partition("?")[1:]
    tail = f"?{query}" if query else ""
    store = ObjectStore(filesystem, root)
    below = [(f"{scheme}://{root}/{name}{tail}", name) for name in store.names("")]
    return below or [(url, root.rpartition("/")[2])]


def _told_by(error: BaseException) -> str:
    """The first line of what an object store's client says."""
    return str(error).split("\n", maxsplit=1)[0][:200]


def object_stat(url: str) -> tuple[int, int]:
    """Size in bytes and time of change in ns of an object; zeros where there is none."""
    filesystem, path = connect(url)
    info = filesystem.get_file_info(path)
    return (info.size, info.mtime_ns) if info.is_file else (0, 0)


@contextmanager
def copying(url: str, folder: Path) -> Iterator[tuple[Any, str, Path]]:
    """The file system and path of an object, and where in `folder` its copy goes, under its own name.

    Raises
    ------
    LogError
        If the object cannot be read within the block.
    """
    filesystem, path = connect(url)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield filesystem, path, folder / path.rpartition("/")[2]
    except OSError as error:
        raise LogError(f"{url}: it cannot be read ({_told_by(error)}); check name and rights") from error


def fetched(url: str, folder: Path) -> Path:
    """A copy of an object in `folder`, under its own name.

    Raises
    ------
    LogError
        If there is no such object, or it cannot be read.
    """
    from pyarrow.fs import LocalFileSystem, copy_files

    with copying(url, folder) as (filesystem, path, copy):
        copy_files(path, str(copy), source_filesystem=filesystem, destination_filesystem=LocalFileSystem())
    return copy


def put_folder(store: Store, name: str, folder: Path) -> None:
    """Write the files of a folder below `name`; ``result.json`` comes last, so that it vouches for the others."""
    files = sorted((path for path in folder.rglob("*") if path.is_file()), key=lambda p: (p.name == "result.json", p))
    for path in files:
        store.write(f"{name}/{path.relative_to(folder).as_posix()}", path.read_bytes())
