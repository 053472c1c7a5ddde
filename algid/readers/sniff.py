"""Which format a file has, told from its content: names lie, first bytes do not.

Compressed text, piece by piece, in bounded memory.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path

from algid.errors import LogError

MCAP = b"\x89MCAP0\r\n"
PARQUET = b"PAR1"
ZSTD = b"\x28\xb5\x2f\xfd"
GZIP = b"\x1f\x8b"
BAG = b"#ROSBAG V"
SQLITE = b"SQLite format 3\x00"
_HEAD = 1 << 16


def sniff(path: Path) -> str:
    """The format of a log: "mcap", "parquet", "csv", "csv.zst", "csv.gz", "bag", "db3" or "rosbag2".

    Raises
    ------
    LogError
        If there is no such file, it cannot be read, or its content is none of these.
    """
    if not _is_unicode(path):
        raise LogError(f"{str(path)!r}: the name is not valid UTF-8; rename the log")
    try:
        if path.is_dir():
            return _folder(path)
        if not path.is_file():
            found = "it is no regular file" if path.exists() else "there is no such file"
            raise LogError(f"{path}: {found}; expected a log in MCAP, Parquet or CSV; check the name")
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
    except (OSError, ValueError) as error:
        raise LogError(f"{str(path)!r}: the log cannot be read ({error}); check the name and rights") from error
    return _by_content(path, head)


def _is_unicode(path: Path) -> bool:
    """Whether the name can be told to polars and written into a result; surrogates stand for bytes that cannot."""
    return not any(0xD800 <= ord(letter) <= 0xDFFF for letter in str(path))


def _folder(path: Path) -> str:
    if (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3")):
        return "rosbag2"
    raise LogError(f"{path}: a folder without metadata.yaml or *.mcap; expected a log file or a rosbag2 folder")


def _by_content(path: Path, head: bytes) -> str:
    for magic, name in ((MCAP, "mcap"), (PARQUET, "parquet"), (BAG, "bag"), (SQLITE, "db3")):
        if head.startswith(magic):
            return name
    if head.startswith((ZSTD, GZIP)):
        return _compressed(path, "csv.zst" if head.startswith(ZSTD) else "csv.gz")
    if not head:
        raise LogError(f"{path}: the file is empty; expected a log in MCAP, Parquet or CSV")
    if looks_like_text(head):
        return "csv"
    raise LogError(f"{path}: unknown format, it begins with {head[:8]!r}; expected a log in MCAP, Parquet or CSV")


def _compressed(path: Path, name: str) -> str:
    from algid.readers.sniff import head_of

    head = head_of(path, name)
    if head.startswith(MCAP):
        raise LogError(
            f"{path}: an MCAP file compressed as a whole, which cannot be read by parts; "
            f"unpack it first: {'zstd -d' if name == 'csv.zst' else 'gunzip'} {path.name}"
        )
    if head and looks_like_text(head):
        return name
    raise LogError(f"{path}: compressed, but not a table of text; unpack it and name what is inside")


def looks_like_text(head: bytes) -> bool:
    """Whether bytes are UTF-8 text, without control characters but tabs and line ends, or UTF-16."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    if any(byte < 32 and byte not in b"\t\n\r\f" for byte in set(head)):
        return False
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start > len(head) - 4
    return True


_PIECE = 1 << 24
_INFLATE_HEAD = 1 << 16
_LONGEST_LINE = 1 << 16


def pieces(path: Path, name: str, size: int = _PIECE) -> Iterator[bytes]:
    """Bytes of a "csv" file, unpacked ones of a "csv.zst" or "csv.gz" file, at most `size` at a time.

    Raises
    ------
    LogError
        If the compressed data are damaged or cut off.
    """
    import zstandard

    try:
        with path.open("rb") as raw:
            stream: io.BufferedIOBase | zstandard.ZstdDecompressionReader = raw
            if name == "csv.zst":
                window = zstandard.ZstdDecompressor(max_window_size=1 << 27)
                stream = window.stream_reader(raw, read_across_frames=True)
            elif name == "csv.gz":
                stream = gzip.GzipFile(fileobj=raw)
            while piece := stream.read(size):
                yield piece
    except (OSError, EOFError, zlib.error, zstandard.ZstdError) as error:
        raise LogError(f"{path}: the compressed data are damaged or cut off ({error}); copy it again") from error


def whole_lines(path: Path, name: str) -> Iterator[bytes]:
    """As `pieces`, in pieces that end with a line.

    Raises
    ------
    LogError
        As `pieces`, and if a line is no table's.
    """
    rest = b""
    for piece in pieces(path, name):
        text = rest + piece
        end = text.rfind(b"\n") + 1
        if not end and len(text) > _LONGEST_LINE:
            raise LogError(f"{path}: a line of more than 65,000 characters; expected rows of numbers")
        rest = text[end:]
        if end:
            yield text[:end]
    if rest:
        yield rest


def head_of(path: Path, name: str) -> bytes:
    """The first unpacked bytes, 64 KiB at most."""
    return next(pieces(path, name, _INFLATE_HEAD), b"")
