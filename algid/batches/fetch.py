"""Fetch logs from an object store: of MCAP and Parquet the needed parts, of others the whole.

The format's own reader says what it needs. What it finds where is known from a few small parts of
the object: the summary and the heads of the message indexes of an MCAP file, the footer of a
Parquet file. What is fetched of an object lies in a sparse file of its size, at its own places;
the rest are zeros, which no MCAP or Parquet reader takes for data. An object without such parts,
or of which nearly all is needed, is fetched whole; its hash is known then.
"""

from __future__ import annotations

import os
import struct
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.errors import AlgidError, LogError
from algid.identification.source import Staged
from algid.limits import LIMITS
from algid.readers.mcap import McapSource, framing
from algid.readers.mcap.catalogue import between, catalogue
from algid.readers.mcap.framing import DamagedError, File
from algid.readers.mcap.load import spans_beside, spans_of
from algid.readers.messages.source import channels_of
from algid.stores import public, reading

if TYPE_CHECKING:
    from pyarrow import NativeFile
    from pyarrow.fs import FileSystem
    from pyarrow.parquet import ColumnChunkMetaData, FileMetaData

    from algid.profile import Profile

Range = tuple[int, int]
"""First byte, and the one behind the last."""

GAP = 1 << 16
"""Bytes between two ranges that are fetched along, to save a request."""
SMALL = 1 << 20
"""Bytes of an object that one request brings about as soon as its parts."""
NEARLY_ALL = 0.9
_PIECE = 1 << 23
_REQUESTS = 8
_TAIL = 1 << 16
_MCAP_END = 37  # footer record and magic
_INDEX_HEAD = 15  # bytes of a message index record that name its channel and size
_METADATA_INDEX = 0x0D


class UnforeseenError(Exception):
    """A reader asks for bytes that were not fetched."""


def _pieces(ranges: Iterable[Range]) -> Iterator[Range]:
    """The ranges in pieces that one request fetches."""
    for start, end in ranges:
        for place in range(start, end, _PIECE):
            yield place, min(place + _PIECE, end)


class Partial(File):
    """The sparse file under construction; also what `algid.readers.mcap` reads while planning.

    Parameters
    ----------
    path : Path
        Of the sparse file.
    source : pyarrow's random access file of the object
    on_demand : bool
        Fetch what is read and not there, instead of raising `UnforeseenError`.
    """

    def __init__(self, path: Path, source: Any, *, on_demand: bool = False) -> None:
        super().__init__(path)
        self.source, self.on_demand = source, on_demand
        self._held: list[Range] = []

    def __enter__(self) -> Partial:
        self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        self.size = self.source.size()
        os.ftruncate(self._handle, self.size)
        return self

    def fetch(self, ranges: Iterable[Range]) -> None:
        """Fetch ranges, neighbours in one request, several requests at a time.

        Raises
        ------
        DamagedError
            If a range lies outside the object.
        OSError
            If the object cannot be read.
        """
        wanted = merged(ranges)
        if wanted and not 0 <= wanted[0][0] <= wanted[-1][1] <= self.size:
            raise DamagedError(
                f"bytes {wanted[0][0]} to {wanted[-1][1]} of an object of {self.size}"
            )
        wanted = merged(without(wanted, self._held), GAP)

        def copy(start: int, end: int) -> None:
            content = self.source.read_at(end - start, start)
            if len(content) != end - start:
                raise OSError(f"bytes {start} to {end} are gone: it was changed meanwhile")
            view = memoryview(content)
            while view:
                written = os.pwrite(self._handle, view, start)
                view, start = view[written:], start + written

        with ThreadPoolExecutor(_REQUESTS, thread_name_prefix="algid-fetch") as pool:
            for _ in pool.map(lambda piece: copy(*piece), _pieces(wanted)):
                pass
        self._held = merged([*self._held, *wanted])

    def read(self, start: int, length: int) -> bytes:
        """The bytes at `start`. Raises `DamagedError` where the object ends before."""
        place = (start, start + length)
        if 0 <= start <= place[1] <= self.size and any(without([place], self._held)):
            if not self.on_demand:
                raise UnforeseenError(f"bytes {start} to {place[1]}")
            self.fetch([place])
        return super().read(start, length)


def merged(ranges: Iterable[Range], gap: int = 0) -> list[Range]:
    """Ranges in order, those made one that lie at most `gap` bytes apart."""
    joint: list[Range] = []
    for start, end in sorted(ranges):
        if joint and start <= joint[-1][1] + gap:
            joint[-1] = (joint[-1][0], max(joint[-1][1], end))
        else:
            joint.append((start, end))
    return joint


def without(ranges: Iterable[Range], held: Sequence[Range]) -> Iterator[Range]:
    """What of `ranges` does not lie in any of the `held` ones, which are in order and apart."""
    for start, end in ranges:
        place = start
        for first, last in held[max(0, bisect_right(held, start, key=itemgetter(0)) - 1) :]:
            if first >= end:
                break
            if first > place:
                yield place, first
            place = max(place, last)
        if place < end:
            yield place, end


def staged(url: str, folder: Path, profile: Profile | None = None) -> Staged:
    """A copy of a log in `folder`, of the whole or of what identification with `profile` reads.

    Raises
    ------
    LogError
        If there is no such object, it cannot be read, or another took its place meanwhile.
    """
    with reading(url) as (filesystem, path):
        folder.mkdir(parents=True, exist_ok=True)
        copy = folder / path.rpartition("/")[2]
        with _one_version(filesystem, path, url) as source, Partial(copy, source=source) as part:
            with naming({copy: public(url)}):
                in_part = part.size >= SMALL and _fetched_in_part(part, profile)
            if not in_part:
                part.fetch([(0, part.size)])
    return Staged(copy, public(url), whole=not in_part)


@contextmanager
def _one_version(filesystem: FileSystem, path: str, url: str) -> Iterator[NativeFile]:
    """An object, opened; looked at again when the block ends.

    Requests for parts of an object tell nothing of each other: where it was replaced between two
    of them, what was fetched is of neither, and what its reader complains of is not the cause.

    Raises
    ------
    LogError
        If another object stands in its place then.
    """
    with filesystem.open_input_file(path) as source:
        metadata = source.metadata()
        failure: Exception | None = None
        try:
            yield source
        except (OSError, AlgidError) as error:
            failure = error
        with filesystem.open_input_file(path) as again:
            if again.metadata() != metadata:
                raise LogError(f"{url}: it was replaced while it was read; run again") from failure
        if failure is not None:
            raise failure


@contextmanager
def naming(copies: dict[Path, str]) -> Iterator[None]:
    """Errors about copies name the objects that they are of."""
    try:
        yield
    except AlgidError as error:
        text = str(error)
        for copy, url in copies.items():
            text = text.replace(str(copy), url)
        if text == str(error):
            raise
        raise type(error)(text) from error


def _fetched_in_part(part: Partial, profile: Profile | None) -> bool:
    """Fetch what a reader needs; False where that cannot be known, or is nearly everything."""
    try:
        part.fetch([(0, len(framing.MAGIC)), (part.size - _TAIL, part.size)])
        head = part.read(0, len(framing.MAGIC))
        if head == framing.MAGIC:
            wanted = _wanted_of_mcap(part, profile)
        elif head.startswith(b"PAR1"):
            wanted = _wanted_of_parquet(part, profile)
        else:
            return False
        if sum(end - start for start, end in wanted) > NEARLY_ALL * part.size:
            return False
        part.fetch(wanted)
    except (DamagedError, UnforeseenError):
        return False
    return True


def _wanted_of_mcap(part: Partial, profile: Profile | None) -> list[Range]:
    """The chunks that hold the joints, with the indexes behind them.

    The catalogue looks at the summary, and beyond it at heads of message indexes, metadata, and
    what lies between.

    Raises
    ------
    UnforeseenError
        If the file has no summary, one too large to fetch, or one that makes the catalogue look at
        the whole file.
    """
    from mcap import records

    from algid.readers.messages.plan import plan

    (start,) = struct.unpack("<Q", part.read(part.size - _MCAP_END + 9, 8))
    end = part.size - _MCAP_END
    if not 0 < start < end or end - start > LIMITS.summary_bytes:
        raise UnforeseenError("no summary")
    part.fetch([(start, part.size)])
    content, wanted, chunks = part.read(start, end - start), [], []
    for record in framing.walk_bytes(content, 0, len(content)):
        body = content[record.start : record.end]
        if record.code == framing.CHUNK_INDEX:
            chunks.append(framing.chunk_index(body))
            for offset in chunks[-1].message_index_offsets.values():
                wanted.append((offset, offset + _INDEX_HEAD))
        elif record.code == _METADATA_INDEX:
            place = framing.parse(records.MetadataIndex, body)
            if place.length <= LIMITS.record_bytes:
                wanted.append((place.offset, place.offset + place.length))
    chunks.sort(key=lambda chunk: chunk.chunk_start_offset)
    for first, last in between(chunks, start):
        if last - first <= SMALL:
            wanted.append((first, last))
    part.fetch(wanted)
    index = catalogue(part)  # a scan of the whole is unforeseen
    part.on_demand = True
    source = McapSource(part, index)
    topics = plan(source, profile).topics
    channels = frozenset[int]()
    for topic in topics:
        channels |= channels_of(source, topic.name, topic.type)
    spans = [*spans_of(index, channels), *spans_beside(index, channels)]
    return [(span.start, span.start + span.length + span.index_length) for span in spans]


def _pages_of(metadata: FileMetaData) -> Iterator[ColumnChunkMetaData]:
    """What is told of the pages of each column in each row group."""
    for place in range(metadata.num_row_groups):
        group = metadata.row_group(place)
        for column in range(group.num_columns):
            yield group.column(column)


def _wanted_of_parquet(part: Partial, profile: Profile | None) -> list[Range]:
    """The pages of the columns that are read, and what lies behind all pages."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from algid.profile import Profile
    from algid.readers.parquet import open_parquet

    start = part.size - 8 - int.from_bytes(part.read(part.size - 8, 4), "little")
    if part.size - start > LIMITS.summary_bytes:
        raise UnforeseenError("no footer")
    part.fetch([(start, part.size)])
    try:
        metadata = pq.read_metadata(part.path)
        if any(
            metadata.schema.column(place).max_repetition_level
            for place in range(metadata.num_columns)
        ):
            raise UnforeseenError("lists have widths that the footer does not tell")
        names = set(open_parquet(part.path, profile or Profile()).origin.mapping.values())
    except (pa.ArrowException, OSError, LogError) as error:
        raise UnforeseenError(str(error)) from error
    last, wanted = 0, []
    for pages in _pages_of(metadata):
        offsets = (pages.dictionary_page_offset, pages.data_page_offset)
        first = min(offset for offset in offsets if offset is not None)
        end = first + pages.total_compressed_size
        last = max(last, end)
        if pages.path_in_schema in names:
            wanted.append((first, end))
    return [(last or start, part.size), *wanted]
