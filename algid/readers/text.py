"""Tables of text, also compressed: recognised, and unpacked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.words import counted

MCAP = b"\x89MCAP0\r\n"
ZSTD = b"\x28\xb5\x2f\xfd"
GZIP = b"\x1f\x8b"
NUL_AMONG_ROWS = (
    "NUL bytes stand among the rows, as a crash leaves them; cut them out with the rest of their "
    "line, or cut the file there"
)
_CODECS = {"csv.gz": "gzip", "csv.zst": "zstd"}


def looks_like_text(head: bytes) -> bool:
    """Whether bytes are UTF-8 text, with tabs and line ends as only controls, or UTF-16."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    if any(byte < 32 and byte not in b"\t\n\r\f" for byte in set(head)):
        return False
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start > len(head) - 4
    return True


def pieces(path: Path, kind: str) -> Iterator[bytes]:
    """The text of a "csv", "csv.gz" or "csv.zst" file, 64 KiB or more at a time.

    Raises
    ------
    LogError
        If compressed data are damaged, cut off, or unpack to more than any table.
    """
    import pyarrow as pa

    most = LIMITS.free_text_bytes + LIMITS.text_a_byte * path.stat().st_size
    size, total = LIMITS.head_bytes, 0
    try:
        with pa.input_stream(str(path), compression=_CODECS.get(kind)) as stream:
            while piece := stream.read(size):
                total += len(piece)
                if total > most:
                    raise LogError(
                        f"{path}: the compressed data unpack to more than {counted(most, 'byte')}, "
                        "as no table of their size does; if it is one, unpack it first"
                    )
                yield piece
                size = 1 << 24
    except (OSError, ValueError) as error:
        raise LogError(
            f"{path}: the compressed data are damaged or cut off ({error}); copy it again"
        ) from error


def head_of(path: Path, kind: str) -> bytes:
    """The first unpacked bytes, 64 KiB at most."""
    return next(pieces(path, kind), b"")
