"""Tables of text, also compressed: recognised, and read in pieces with bounded memory."""

from __future__ import annotations

import gzip
import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from algid.errors import LogError
from algid.limits import LIMITS
from algid.words import counted

MCAP = b"\x89MCAP0\r\n"
PARQUET = b"PAR1"
ZSTD = b"\x28\xb5\x2f\xfd"
GZIP = b"\x1f\x8b"
_EMPTY_LINES = re.compile(rb"\n[\r\n]*\n")


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


_BLOCK = 1 << 16
_NOTHING = b"\0"
NUL_AMONG_ROWS = (
    "NUL bytes stand among the rows, as a crash leaves them; cut them out with the rest of their "
    "line, or cut the file there"
)


def end_of_lines(path: Path) -> int | None:
    """Where whole lines end in a text with NUL bytes behind it; None where none are behind it.

    A file system that had made a file longer, and lost the power before it wrote what belongs
    there, leaves NUL bytes: the line before them breaks off.
    """
    with path.open("rb") as stream:
        start = stream.seek(0, os.SEEK_END)
        block, behind = b"", start
        while start and not block:
            start = max(0, start - _BLOCK)
            stream.seek(start)
            block = stream.read(behind - start).rstrip(_NOTHING)
            behind = behind if block else start
        if start + len(block) == stream.seek(0, os.SEEK_END):
            return None
        while start and b"\n" not in block:
            start = max(0, start - _BLOCK)
            stream.seek(start)
            block = stream.read(_BLOCK)
    return start + block.rfind(b"\n") + 1


_PIECE = 1 << 24
_PACKED = 1 << 11
"""Bytes given to zstd at a time: at most 64 MiB unpacked, as a 4-byte block makes 128 KiB."""


def pieces(path: Path, name: str, size: int = _PIECE) -> Iterator[bytes]:
    """Bytes of a "csv" file, or unpacked ones of "csv.zst" or "csv.gz", `size` or more at a time.

    A "csv" file ends at its last whole line where NUL bytes are behind it.

    Raises
    ------
    LogError
        If the compressed data are damaged, cut off, or unpack to more than any table.
    """
    try:
        with path.open("rb") as raw:
            most = LIMITS.free_text_bytes + LIMITS.text_a_byte * os.fstat(raw.fileno()).st_size
            if name == "csv":
                end = end_of_lines(path)
                if end is None:
                    yield from iter(lambda: raw.read(size), b"")
                    return
                for start in range(0, end, size):
                    yield raw.read(min(size, end - start))
                return
            stream = gzip.GzipFile(fileobj=raw)
            total = 0
            for part in (
                _gathered(_zstd(raw), size)
                if name == "csv.zst"
                else iter(lambda: stream.read(size), b"")
            ):
                total += len(part)
                if total > most:
                    raise LogError(
                        f"{path}: the compressed data unpack to more than {counted(most, 'byte')}, "
                        "as no table of their size does; if it is one, unpack it first"
                    )
                yield part
    except (OSError, EOFError, zlib.error) as error:
        raise LogError(
            f"{path}: the compressed data are damaged or cut off ({error}); copy it again"
        ) from error


def _zstd(raw: BinaryIO) -> Iterator[bytes]:
    """The unpacked bytes of one zstd frame after another.

    A stream reader of the library takes a cut file for a whole one.

    Raises
    ------
    EOFError
        If the last frame breaks off, or one is damaged.
    """
    import zstandard

    window = zstandard.ZstdDecompressor(max_window_size=LIMITS.zstd_window_bytes)
    packed = raw.read(_PACKED)
    try:
        while packed:
            frame = window.decompressobj()
            while not frame.eof:
                if not packed:
                    raise EOFError("its last frame breaks off")
                yield frame.decompress(packed)
                packed = frame.unused_data or raw.read(_PACKED)
    except zstandard.ZstdError as error:
        raise EOFError(str(error)) from error


def _gathered(parts: Iterator[bytes], size: int) -> Iterator[bytes]:
    """The same bytes in pieces of `size` at least, but for the last."""
    held, length = [], 0
    for part in parts:
        held.append(part)
        length += len(part)
        if length >= size:
            yield b"".join(held)
            held, length = [], 0
    if length:
        yield b"".join(held)


def whole_lines(path: Path, name: str) -> Iterator[bytes]:
    """As `pieces`, in pieces that end with a line.

    Behind the head, which tells the dialect, without empty lines.

    Raises
    ------
    LogError
        As `pieces`, and if a line is no table's.
    """
    return ending_with_lines(path, _with_few_empty_lines(pieces(path, name)))


def _with_few_empty_lines(found: Iterator[bytes]) -> Iterator[bytes]:
    """The same text without empty lines behind its head, but for those where two pieces meet."""
    head = LIMITS.head_bytes
    for piece in found:
        yield piece[:head] + _EMPTY_LINES.sub(b"\n", piece[head:])
        head = max(0, head - len(piece))


def ending_with_lines(path: Path, found: Iterator[bytes]) -> Iterator[bytes]:
    """The same text in pieces that end with a line, but for the last.

    Raises
    ------
    LogError
        If a line is no table's.
    """
    rest = b""
    for piece in found:
        text = rest + piece
        end = text.rfind(b"\n") + 1
        rest = text[end:]
        if len(rest) > LIMITS.line_bytes:
            raise LogError(
                f"{path}: a line of more than 65,000 characters; expected rows of numbers"
            )
        if end:
            yield text[:end]
    if rest:
        yield rest


def head_of(path: Path, name: str) -> bytes:
    """The first unpacked bytes, 64 KiB at most."""
    return next(pieces(path, name, LIMITS.head_bytes), b"")[: LIMITS.head_bytes]
