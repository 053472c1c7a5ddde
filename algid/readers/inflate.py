"""Compressed text, piece by piece, in bounded memory."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path

from algid.errors import LogError

_PIECE = 1 << 24
_HEAD = 1 << 16
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
    return next(pieces(path, name, _HEAD), b"")
