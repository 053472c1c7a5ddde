"""Where files live: a folder of this machine, or a prefix of an object store behind s3://, gs:// or az://.

Files appear whole or not at all: on this machine through `algid.files.whole_file`, in object stores by their nature.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.errors import LogError, OutputError
from algid.files import whole_file

if TYPE_CHECKING:
    from pyarrow.fs import FileSystem

SCHEMES = ("s3://", "gs://", "az://")


def is_url(path: str) -> bool:
    """Whether a path is the URL of an object."""
    return path.startswith(SCHEMES)


@dataclass(frozen=True)
class Store:
    """Files by their names below one root.

    Parameters
    ----------
    filesystem : pyarrow's
    root : path within it
    folder : the same root, where it is a folder of this machine
    """

    filesystem: FileSystem
    root: str
    folder: Path | None = None

    def read(self, name: str) -> bytes | None:
        """The content, or None where there is no such file."""
        try:
            with self.filesystem.open_input_file(f"{self.root}/{name}") as stream:
                return bytes(stream.readall())
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write the whole file. Raises `OutputError`."""
        if self.folder is not None:
            with whole_file(self.folder / name) as temporary:
                temporary.write_bytes(content)
            return
        try:
            with self.filesystem.open_output_stream(f"{self.root}/{name}") as stream:
                stream.write(content)
        except OSError as error:
            raise OutputError(
                f"{self.root}/{name}: cannot write there ({_first_line(error)}); check rights and name"
            ) from error

    def names(self, under: str) -> list[str]:
        """Names of the files below the folder `under`, sorted; hidden ones are left out."""
        from pyarrow.fs import FileSelector, FileType

        place = f"{self.root}/{under}".rstrip("/")
        found = self.filesystem.get_file_info(FileSelector(place, recursive=True, allow_not_found=True))
        files = (info for info in found if info.type == FileType.File and not info.base_name.startswith("."))
        return sorted(info.path.removeprefix(f"{self.root}/") for info in files)

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        return bool(self.filesystem.get_file_info(f"{self.root}/{name}").is_file)


def open_store(place: str) -> Store:
    """The store at a folder's path or an object store's URL.

    Raises
    ------
    OutputError
        If the URL cannot be understood or reached.
    """
    from pyarrow.fs import LocalFileSystem

    if is_url(place):
        return Store(*connect(place))
    folder = Path(place).absolute()
    return Store(LocalFileSystem(), folder.as_posix().rstrip("/"), folder)


def connect(url: str) -> tuple[FileSystem, str]:
    """Pyarrow's file system behind a URL, and the path within it.

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
        raise OutputError(f"{url}: the object store cannot be reached ({_first_line(error)}); check the URL") from error
    return filesystem, path.rstrip("/")


def list_urls(url: str) -> list[tuple[str, str]]:
    """Objects at or below a URL: each one's URL, and its name below it."""
    store = Store(*connect(url))
    base, mark, query = url.partition("?")
    scheme = base.partition("://")[0]
    below = [(f"{scheme}://{store.root}/{name}{mark}{query}", name) for name in store.names("")]
    return below or [(url, store.root.rpartition("/")[2])]


def _first_line(error: BaseException) -> str:
    """Of what an object store's client says."""
    return str(error).split("\n", maxsplit=1)[0][:200]


def object_stat(url: str) -> tuple[int, int]:
    """Size in bytes and time of change in ns of an object; zeros where there is none."""
    filesystem, path = connect(url)
    info = filesystem.get_file_info(path)
    return (info.size, info.mtime_ns) if info.is_file else (0, 0)


@contextmanager
def reading(url: str) -> Iterator[tuple[Any, str]]:
    """The file system and path of an object.

    Raises
    ------
    LogError
        If the object cannot be read within the block.
    """
    filesystem, path = connect(url)
    try:
        yield filesystem, path
    except OSError as error:
        raise LogError(f"{url}: it cannot be read ({_first_line(error)}); check name and rights") from error


def put_folder(store: Store, name: str, folder: Path) -> None:
    """Write the files of a folder below `name`; ``result.json`` comes last, so that it vouches for the others."""
    files = sorted((path for path in folder.rglob("*") if path.is_file()), key=lambda p: (p.name == "result.json", p))
    for path in files:
        store.write(f"{name}/{path.relative_to(folder).as_posix()}", path.read_bytes())
