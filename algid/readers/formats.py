"""The formats of logs, one entry each: how a file is recognised and opened, and what it holds.

A format is known from a file's content: names lie, first bytes do not. Whatever must know the
formats reads this table: opening and inspecting a log, the logs of a folder, the guide. Adding one
is a module and an entry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.files import read_start
from algid.base.limits import LIMITS
from algid.readers.text import GZIP, MCAP, NUL_AMONG_ROWS, ZSTD, head_of, looks_like_text

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.flat import TableFile
    from algid.readers.messages.message_file import MessageFile
    from algid.readers.messages.reader import MessageLog

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
Opener = Callable[[Path, "Profile"], "TableFile | MessageLog"]


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
        Opens a log of it; a profile may name columns that the file does not.
    messages : bool
        Whether it holds messages on topics, not columns.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    fits: Callable[[Path, bytes], bool]
    open: Opener
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
    from algid.readers.arrays import is_json_lines

    return is_json_lines(head)


def _is_text(_: Path, head: bytes) -> bool:
    text = head.rstrip(b"\0")  # of a log that breaks off
    return bool(text) and looks_like_text(text)


def _mcap(path: Path, _: Profile) -> MessageLog:
    from algid.readers.mcap import open_mcap

    return open_mcap([path])


def _bag(kind: str) -> Opener:
    def opened(path: Path, _: Profile) -> MessageLog:
        from algid.readers.bags import open_bag

        return open_bag(path, kind)

    return opened


def _parquet(path: Path, _: Profile) -> TableFile:
    from algid.readers.arrow_files import open_parquet

    return open_parquet(path)


def _feather(path: Path, _: Profile) -> TableFile:
    from algid.readers.arrow_files import open_feather

    return open_feather(path)


def _csv(kind: str) -> Opener:
    def opened(path: Path, profile: Profile) -> TableFile:
        from algid.readers.csv import open_csv

        return open_csv(path, kind, profile.columns)

    return opened


def _whole(kind: str) -> Opener:
    """What opens a file that is read as a whole."""

    def opened(path: Path, _: Profile) -> TableFile:
        from algid.readers import arrays

        openers = {
            "npz": arrays.open_npz,
            "mat": arrays.open_matlab,
            "hdf5": arrays.open_hdf5,
            "jsonl": arrays.open_json_lines,
        }
        return openers[kind](path)

    return opened


FORMATS: tuple[FileFormat, ...] = (
    FileFormat("mcap", "MCAP", (".mcap",), begins(MCAP), _mcap, messages=True),
    FileFormat("rosbag2", "rosbag2 folder", (), _is_bag_folder, _bag("rosbag2"), messages=True),
    FileFormat(
        "db3",
        "rosbag2 SQLite file",
        (".db3",),
        begins(b"SQLite format 3\x00"),
        _bag("db3"),
        messages=True,
    ),
    FileFormat("bag", "ROS 1 bag", (".bag",), begins(b"#ROSBAG V"), _bag("bag"), messages=True),
    FileFormat("parquet", "Parquet", (".parquet",), begins(b"PAR1"), _parquet),
    FileFormat("feather", "Feather (Arrow)", (".feather", ".arrow"), begins(b"ARROW1"), _feather),
    FileFormat("npz", "NumPy archive", (".npz",), _is_npz, _whole("npz")),
    FileFormat("mat", "MATLAB", (".mat",), begins(b"MATLAB "), _whole("mat")),
    FileFormat(
        "hdf5",
        "HDF5 (`algid[hdf5]`)",
        (".h5", ".hdf5"),
        begins(b"\x89HDF\r\n\x1a\n"),
        _whole("hdf5"),
    ),
    FileFormat(
        "csv.zst",
        "CSV packed with zstd",
        (".csv.zst",),
        _is_packed_text(ZSTD, "csv.zst"),
        _csv("csv.zst"),
    ),
    FileFormat(
        "csv.gz",
        "CSV packed with gzip",
        (".csv.gz",),
        _is_packed_text(GZIP, "csv.gz"),
        _csv("csv.gz"),
    ),
    FileFormat("jsonl", "JSON lines", (".jsonl", ".ndjson"), _is_json_lines, _whole("jsonl")),
    FileFormat("csv", "CSV", (".csv",), _is_text, _csv("csv")),
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
    if head.startswith(b"\x93NUMPY"):
        raise LogError(
            f"{path}: a single NumPy array; save its columns with np.savez(FILE, t=…, q=…, tau=…)"
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


def entries_of(opened: TableFile | MessageLog) -> Entries:
    """What a log holds, by name: columns, or the topics of its first file.

    Raises
    ------
    LogError
        If not even that can be read.
    """
    from algid.readers.flat import TableFile, cells_of

    if not isinstance(opened, TableFile):
        return tuple(_topics(opened.files[0]()))
    rows = opened.rows or None
    entries = [Entry(name, str(cell.type)[:80], rows) for name, cell in cells_of(opened).items()]
    entries += [Entry(name, "of another length") for name in opened.others]
    return tuple(entries)


def _topics(file: MessageFile) -> Iterator[Entry]:
    from algid.readers.messages.joint_topic import fields_shown

    first, last = file.span_ns or (0, 0)
    for place, (number, channel) in enumerate(sorted(file.channels.items())):
        form = f"{channel.type or 'no schema'}, {channel.encoding}"
        count = file.counts.get(number, 0)
        rate = 1e9 * (count - 1) / (last - first) if count > 1 and last > first else None
        joints, fields = fields_shown(file, number) if place < _MOST_SHOWN else ((), ())
        yield Entry(channel.topic, form, count, joints[:_MOST_SHOWN], fields[:_MOST_SHOWN], rate)


def entries_at(path: Path) -> Entries:
    """What a log at a path holds: see `entries_of`; columns without a name are numbered."""
    from algid.profile import Profile
    from algid.readers.dialect import NoHeaderError

    form = format_of(path)
    try:
        return entries_of(form.open(path, Profile()))
    except NoHeaderError as error:
        names = tuple(f"column {place + 1}" for place in range(error.columns))
        return entries_of(form.open(path, Profile(columns=names)))
