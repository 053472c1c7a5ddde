"""The formats of logs, one entry each: how a file is recognised and opened, and what it holds.

A format is known from a file's content: names lie, first bytes do not. Whatever must know the
formats reads this table: opening and inspecting a log, the logs of a folder, the guide. Adding one
is a module and an entry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.files import read_start
from algid.limits import LIMITS
from algid.readers.text import GZIP, MCAP, NUL_AMONG_ROWS, ZSTD, head_of, looks_like_text

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.assemble import TableReader
    from algid.readers.messages.source import Source

_MOST_SHOWN = 64


@dataclass(frozen=True)
class Entry:
    """A column or a topic: its name, its type, and how many samples it has where that is known.

    A topic's `rate` is that of its messages in Hz, its `joints` are those that its messages name,
    its `fields` paths of their numbers.
    """

    name: str
    type: str
    count: int | None = None
    joints: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()
    rate: float | None = None


Entries = tuple[Entry, ...]


@dataclass(frozen=True)
class FileFormat:
    """A format of logs.

    Attributes
    ----------
    name : str
        As results and messages name it.
    title : str
        What people call it.
    suffixes : tuple of str
        Ends of file names by which logs are looked for in a folder.
    fits : callable
        Whether a path, whose first bytes are given, is of this format; a folder has none.
    open : callable
        Opens a log of it as a profile says.
    entries : callable
        What a log of it holds, by name.
    messages : bool
        Whether it holds messages on topics, not columns.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    fits: Callable[[Path, bytes], bool]
    open: Callable[[Path, Profile], TableReader]
    entries: Callable[[Path], Entries]
    messages: bool = False


def begins(magic: bytes) -> Callable[[Path, bytes], bool]:
    """Whether a file begins with these bytes."""
    return lambda _, head: head.startswith(magic)


def _is_npz(path: Path, head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and path.suffix.lower() == ".npz"  # any zip begins so


def _is_bag_folder(path: Path, head: bytes) -> bool:
    return not head and path.is_dir()


def _is_packed_text(magic: bytes, name: str) -> Callable[[Path, bytes], bool]:
    """Whether a file packed in one way holds text."""

    def fits(path: Path, head: bytes) -> bool:
        if not head.startswith(magic):
            return False
        inside = head_of(path, name)
        if inside.startswith(MCAP):
            unpack = "zstd -d" if magic == ZSTD else "gunzip"
            text = "an MCAP file compressed as a whole, which cannot be read by parts"
            raise LogError(f"{path}: {text}; unpack it first: {unpack} {path.name}")
        if not (inside and looks_like_text(inside)):
            raise LogError(
                f"{path}: compressed, but not a table of text; unpack it and name what is inside"
            )
        return True

    return fits


def _is_json_lines(_: Path, head: bytes) -> bool:
    from algid.readers.jsonlines import is_lines

    return is_lines(head)


def _is_text(_: Path, head: bytes) -> bool:
    text = head.rstrip(b"\0")  # of a log that breaks off
    return bool(text) and looks_like_text(text)


def _open_mcap(path: Path, profile: Profile) -> TableReader:
    from algid.readers.mcap import open_mcap

    return open_mcap([path], profile)


def _mcap_entries(path: Path) -> Entries:
    from algid.readers.mcap import messages_in

    with messages_in(path) as source:
        return tuple(_topics(source))


def _open_folder(path: Path, profile: Profile) -> TableReader:
    from algid.readers.bags import open_bag
    from algid.readers.bags.folder import bag_files
    from algid.readers.mcap import open_mcap

    bag = bag_files(path)
    if bag.kind != "mcap":
        return open_bag(path, "rosbag2", profile)
    reader = open_mcap(bag.paths, profile)
    return replace(reader, notices=(*bag.notices, *reader.notices))


def _folder_entries(path: Path) -> Entries:
    from algid.readers.bags.folder import bag_files

    bag = bag_files(path)
    return _mcap_entries(bag.paths[0]) if bag.kind == "mcap" else _bag_entries("rosbag2", path)


def _open_bag(kind: str, path: Path, profile: Profile) -> TableReader:
    from algid.readers.bags import open_bag

    return open_bag(path, kind, profile)


def _bag_entries(kind: str, path: Path) -> Entries:
    from algid.readers.bags import parts_of

    parts, _ = parts_of(path, kind)
    with parts[0]() as source:
        return tuple(_topics(source))


def _topics(source: Source) -> Iterator[Entry]:
    from algid.readers.messages.plan import fields_shown

    first, last = source.span_ns or (0, 0)
    for place, (number, channel) in enumerate(sorted(source.channels.items())):
        form = f"{channel.type or 'no schema'}, {channel.encoding}"
        count = None if source.counts is None else source.counts.get(number, 0)
        rate = 1e9 * (count - 1) / (last - first) if count and count > 1 and last > first else None
        joints, fields = fields_shown(source, number) if place < _MOST_SHOWN else ((), ())
        yield Entry(channel.topic, form, count, joints[:_MOST_SHOWN], fields[:_MOST_SHOWN], rate)


def _open_parquet(path: Path, profile: Profile) -> TableReader:
    from algid.readers.parquet import open_parquet

    return open_parquet(path, profile)


def _parquet_entries(path: Path) -> Entries:
    from algid.readers.parquet import counted_rows, schema_of

    return _entries(schema_of(path), _known(lambda: counted_rows(path)))


def _entries(kinds: Mapping[str, object], rows: int | None) -> Entries:
    """The columns of so many rows with the names of their types."""
    return tuple(Entry(name, str(kind), rows) for name, kind in kinds.items())


def _open_csv(kind: str, path: Path, profile: Profile) -> TableReader:
    from algid.readers.csv import open_csv

    return open_csv(path, profile, kind)


def _csv_entries(kind: str, path: Path) -> Entries:
    from algid.readers.csv import counted_rows
    from algid.readers.dialect import described, kinds

    head = head_of(path, kind)
    dialect = described(path, head)
    rows = _known(lambda: counted_rows(path, kind, dialect))
    return _entries(kinds(path, head, dialect), rows)


def _known(count: Callable[[], int]) -> int | None:
    """What can be counted; None in a damaged file, of which reading will tell more."""
    try:
        return count()
    except LogError:
        return None


def _open_arrays(kind: str, path: Path, profile: Profile) -> TableReader:
    from algid.readers.arrays import open_arrays

    return open_arrays(path, kind, profile)


def _array_entries(kind: str, path: Path) -> Entries:
    from algid.readers.arrays import contents_of

    content, others = contents_of(path, kind)
    columns = _entries(content.schema, content.rows)
    return columns + _entries(dict.fromkeys(others, "of another length"), None)


def _open_feather(path: Path, profile: Profile) -> TableReader:
    from algid.readers.feather import open_feather

    return open_feather(path, profile)


def _feather_entries(path: Path) -> Entries:
    from algid.readers.feather import opened

    feather = opened(path)
    return tuple(Entry(field.name, str(field.type)[:80], feather.rows) for field in feather.schema)


def _table(
    name: str, title: str, suffixes: tuple[str, ...], fits: Callable[[Path, bytes], bool]
) -> FileFormat:
    """A format that is read as a whole."""
    return FileFormat(
        name, title, suffixes, fits, partial(_open_arrays, name), partial(_array_entries, name)
    )


def _csv(name: str, title: str, suffix: str, fits: Callable[[Path, bytes], bool]) -> FileFormat:
    return FileFormat(
        name, title, (suffix,), fits, partial(_open_csv, name), partial(_csv_entries, name)
    )


def _bag(name: str, title: str, suffix: str, magic: bytes) -> FileFormat:
    return FileFormat(
        name,
        title,
        (suffix,),
        begins(magic),
        partial(_open_bag, name),
        partial(_bag_entries, name),
        messages=True,
    )


FORMATS: tuple[FileFormat, ...] = (
    FileFormat("mcap", "MCAP", (".mcap",), begins(MCAP), _open_mcap, _mcap_entries, messages=True),
    FileFormat(
        "rosbag2",
        "rosbag2 folder",
        (),
        _is_bag_folder,
        _open_folder,
        _folder_entries,
        messages=True,
    ),
    _bag("db3", "rosbag2 SQLite file", ".db3", b"SQLite format 3\x00"),
    _bag("bag", "ROS 1 bag", ".bag", b"#ROSBAG V"),
    FileFormat(
        "parquet", "Parquet", (".parquet",), begins(b"PAR1"), _open_parquet, _parquet_entries
    ),
    FileFormat(
        "feather",
        "Feather (Arrow)",
        (".feather", ".arrow"),
        begins(b"ARROW1"),
        _open_feather,
        _feather_entries,
    ),
    _table("npz", "NumPy archive", (".npz",), _is_npz),
    _table("npy", "NumPy structured array", (".npy",), begins(b"\x93NUMPY")),
    _table("mat", "MATLAB", (".mat",), begins(b"MATLAB ")),
    _table("hdf5", "HDF5 (`algid[hdf5]`)", (".h5", ".hdf5"), begins(b"\x89HDF\r\n\x1a\n")),
    _csv("csv.zst", "CSV packed with zstd", ".csv.zst", _is_packed_text(ZSTD, "csv.zst")),
    _csv("csv.gz", "CSV packed with gzip", ".csv.gz", _is_packed_text(GZIP, "csv.gz")),
    _table("jsonl", "JSON lines", (".jsonl", ".ndjson"), _is_json_lines),
    _csv("csv", "CSV", ".csv", _is_text),
)
"""In the order in which a file is held against them."""

SUFFIXES = tuple(suffix for form in FORMATS for suffix in form.suffixes)


def format_of(path: Path) -> FileFormat:
    """The format of a log, by its content.

    Raises
    ------
    LogError
        If there is no such file, it cannot be read, or its content is of no format.
    """
    head = _head(path)
    for form in FORMATS:
        if form.fits(path, head):
            return form
    if not head:
        raise LogError(f"{path}: the file is empty; expected a log in MCAP, Parquet or CSV")
    if not head.strip(b"\0"):
        raise LogError(
            f"{path}: the file begins with NUL bytes alone, as a crash leaves them where nothing "
            "was written; look for another copy, and at the recorder"
        )
    if looks_like_text(head.replace(b"\0", b"")):
        raise LogError(f"{path}: {NUL_AMONG_ROWS}")
    raise LogError(
        f"{path}: unknown format, it begins with {head[:8]!r}; expected a log in MCAP, Parquet or "
        "CSV"
    )


def _head(path: Path) -> bytes:
    """The first bytes of a file, none of a folder that may be a bag.

    Raises
    ------
    LogError
        If there is no such file, or it cannot be read.
    """
    # bytes that polars and results cannot name
    if any(0xD800 <= ord(letter) <= 0xDFFF for letter in str(path)):
        raise LogError(f"{str(path)!r}: the name is not valid UTF-8; rename the log")
    try:
        if path.is_dir():
            if (
                (path / "metadata.yaml").is_file()
                or any(path.glob("*.mcap"))
                or any(path.glob("*.db3"))
            ):
                return b""
            raise LogError(
                f"{path}: a folder without metadata.yaml or *.mcap; expected a log file or a "
                "rosbag2 folder"
            )
        if not path.is_file():
            problem = "it is no regular file" if path.exists() else "there is no such file"
            raise LogError(
                f"{path}: {problem}; expected a log in MCAP, Parquet or CSV; check the name"
            )
        return read_start(path, LIMITS.head_bytes)
    except (OSError, ValueError) as error:
        raise LogError(
            f"{str(path)!r}: the log cannot be read ({error}); check the name and rights"
        ) from error


def sniff(path: Path) -> str:
    """The name of a log's format.

    Raises
    ------
    LogError
        As `format_of`.
    """
    return format_of(path).name


def in_memory(given: object) -> tuple[str, Entries]:
    """The format and the columns of a log in memory: see `algid.readers.memory`."""
    from algid.readers.memory import content_of

    kind, content = content_of(given)
    return kind, _entries(content.schema, content.rows)
