"""The formats of logs, one entry each: how a file is recognised and opened, and what it holds.

Formats are recognised by their first bytes, not by suffix. All code that lists formats uses this
table: opening and inspecting a log, the logs of a folder, the guide.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.files import read_start
from algid.base.limits import LIMITS
from algid.readers.dialect import head_of, looks_like_text

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.messages.offer import MessageLog
    from algid.readers.table_cells import TableFile

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
    magic : bytes
        What its files begin with; empty for folders, and for text.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    magic: bytes


FORMATS: tuple[FileFormat, ...] = (
    FileFormat("mcap", "MCAP", (".mcap",), b"\x89MCAP0\r\n"),
    FileFormat("rosbag2", "rosbag2 folder", (), b""),
    FileFormat("db3", "rosbag2 SQLite file", (".db3",), b"SQLite format 3\x00"),
    FileFormat("bag", "ROS 1 bag", (".bag",), b"#ROSBAG V"),
    FileFormat("parquet", "Parquet", (".parquet",), b"PAR1"),
    FileFormat("feather", "Feather (Arrow)", (".feather", ".arrow"), b"ARROW1"),
    FileFormat("npz", "NumPy archive", (".npz",), b"PK\x03\x04"),
    FileFormat("mat", "MATLAB", (".mat",), b"MATLAB "),
    FileFormat("hdf5", "HDF5 (`algid[hdf5]`)", (".h5", ".hdf5"), b"\x89HDF\r\n\x1a\n"),
    FileFormat("csv.zst", "CSV packed with zstd", (".csv.zst",), b"\x28\xb5\x2f\xfd"),
    FileFormat("csv.gz", "CSV packed with gzip", (".csv.gz",), b"\x1f\x8b"),
    FileFormat("jsonl", "JSON lines", (".jsonl", ".ndjson"), b""),
    FileFormat("csv", "CSV", (".csv",), b""),
)
SUFFIXES = tuple(suffix for form in FORMATS for suffix in form.suffixes)
_BY_NAME = {form.name: form for form in FORMATS}


def open_file(path: Path, profile: Profile) -> TableFile | MessageLog:
    """Open a log, whatever its format; a profile may name columns that the file does not.

    Raises
    ------
    LogError
        If it is of no format, or damaged.
    """
    kind = format_of(path).name
    match kind:
        case "mcap" | "rosbag2" | "db3" | "bag":
            from algid.readers.bags import open_messages

            return open_messages(path, kind)
        case "parquet" | "feather":
            from algid.readers.arrow_files import open_feather, open_parquet

            return open_parquet(path) if kind == "parquet" else open_feather(path)
        case "npz" | "mat" | "hdf5" | "jsonl":
            from algid.readers.arrays import open_arrays, open_json_lines

            return open_json_lines(path) if kind == "jsonl" else open_arrays(path, kind)
    from algid.readers.csv import open_csv

    return open_csv(path, kind, profile.columns)


def format_of(path: Path) -> FileFormat:
    """The format of a log, by its first bytes; of a table of text by its first line.

    Raises
    ------
    LogError
        If there is no such file, it cannot be read, or its content is of no format.
    """
    # bytes that polars and results cannot name
    if any(0xD800 <= ord(letter) <= 0xDFFF for letter in str(path)):
        raise LogError(f"{str(path)!r}: the name is not valid UTF-8; rename the log")
    try:
        if path.is_dir():
            return _BY_NAME["rosbag2"]
        if not path.is_file():
            problem = "it is no regular file" if path.exists() else "there is no such file"
            raise LogError(f"{problem}; expected a log in MCAP, Parquet or CSV; check the name")
        head = read_start(path, LIMITS.head_bytes)
    except (OSError, ValueError) as error:
        raise LogError(
            f"{str(path)!r}: the log cannot be read ({error}); check the name and rights"
        ) from error
    for form in FORMATS:
        if not (form.magic and head.startswith(form.magic)):
            continue
        if form.name.startswith("csv."):
            inside = head_of(path, form.name)
            if not (inside and looks_like_text(inside)):
                raise LogError(
                    "compressed, but not a table of text; unpack it and name what is inside"
                )
        if form.name != "npz" or path.suffix.lower() == ".npz":  # any zip begins so
            return form
    text = head.replace(b"\0", b"")  # which a crash leaves at the end, or among the rows
    if text and looks_like_text(text):
        from algid.readers.arrays import is_json_lines

        return _BY_NAME["jsonl" if is_json_lines(head) else "csv"]
    if not head:
        raise LogError("the file is empty; expected a log in MCAP, Parquet or CSV")
    if head.startswith(b"\x93NUMPY"):
        raise LogError(
            "a single NumPy array; save its columns with np.savez(FILE, t=…, q=…, tau=…)"
        )
    raise LogError(
        f"unknown format, it begins with {head[:8]!r}; expected a log in MCAP, Parquet or CSV"
    )


def entries_of(opened: TableFile | MessageLog) -> Entries:
    """What a log holds, by name: columns, or the topics of its first file.

    Raises
    ------
    LogError
        If not even that can be read.
    """
    from algid.readers.table_cells import TableFile, cells_of

    if isinstance(opened, TableFile):
        rows = opened.rows or None
        cells = cells_of(opened).items()
        entries = [Entry(name, str(cell.type)[:80], rows) for name, cell in cells]
        entries += [Entry(name, "of another length") for name in opened.others]
        return tuple(entries)
    from algid.readers.messages.offer import fields_shown

    file, entries = opened.files[0](), []
    first, last = file.span_ns or (0, 0)
    for place, (number, channel) in enumerate(sorted(file.channels.items())):
        form = f"{channel.type or 'no schema'}, {channel.encoding}"
        count = file.counts.get(number, 0)
        rate = 1e9 * (count - 1) / (last - first) if count > 1 and last > first else None
        joints, fields = fields_shown(file, number) if place < _MOST_SHOWN else ((), ())
        shown = joints[:_MOST_SHOWN], fields[:_MOST_SHOWN]
        entries.append(Entry(channel.topic, form, count, *shown, rate))
    return tuple(entries)


def entries_at(path: Path) -> Entries:
    """What a log at a path holds: see `entries_of`."""
    from algid.profile import Profile

    return entries_of(open_file(path, Profile()))
