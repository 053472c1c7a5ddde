"""Batches of messages of some channels, chunk by chunk, unpacked ahead in threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass

from algid.log import Notice
from algid.readers.mcap.catalogue import Catalogue, Span
from algid.readers.mcap.framing import DamagedError, File, has_checksum, unpack, unpack_torn
from algid.readers.mcap.messages import Messages, find
from algid.runtime import executor

_AHEAD = 3
_AHEAD_BYTES = 1 << 23
"""Chunks beyond this size are not read ahead, so that memory stays bounded by one of them."""


@dataclass(frozen=True)
class Batch:
    """Messages of one span, or None and why they are lost; of a torn chunk also how much is there."""

    messages: Messages | None
    checked: bool
    reason: str = ""
    torn: tuple[int, int] | None = None
    """Bytes of a torn chunk's records, unpacked: what is there, and what there should be."""


def spans_of(catalogue: Catalogue, channels: frozenset[int]) -> list[Span]:
    """The spans that may hold messages of the channels."""
    return [span for span in catalogue.spans if span.channels is None or span.channels & channels]


def batches(file: File, catalogue: Catalogue, channels: frozenset[int]) -> Iterator[Batch]:
    """The messages of `channels`, a span at a time and in file order; a damaged span yields its reason."""
    waiting: deque[Future[Batch]] = deque()
    with executor(2) as pool:
        try:
            for span in spans_of(catalogue, channels):
                ahead = _AHEAD if span.length <= _AHEAD_BYTES else 0
                while len(waiting) > ahead:
                    yield waiting.popleft().result()
                waiting.append(pool.submit(_load, file, span, channels))
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def _load(file: File, span: Span, channels: frozenset[int]) -> Batch:
    try:
        content = file.read(span.start, span.length + span.index_length)
        if span.loose:
            return Batch(find(content, b"", channels), checked=False)
        if span.torn:
            records, size = unpack_torn(content)
            torn = (len(records), size) if len(records) < size else None
            return Batch(find(records, b"", channels), torn is not None or has_checksum(content), torn=torn)
        chunk, index = content[: span.length], content[span.length :]
        return Batch(find(unpack(chunk), index, channels), has_checksum(chunk))
    except DamagedError as error:
        return Batch(None, checked=True, reason=f"{error} (at byte {span.start})")


@dataclass
class Account:
    """What was lost on the way, for the notices at the end."""

    spans: int = 0
    reason: str = ""
    unchecked: bool = False
    found: int = 0
    torn: str = ""

    def add(self, batch: Batch) -> None:
        """Count one batch."""
        if batch.messages is None:
            self.spans += 1
            self.reason = self.reason or batch.reason
        else:
            self.found += len(batch.messages)
            self.unchecked |= not batch.checked and len(batch.messages) > 0
            if batch.torn:
                self.torn = _torn(len(batch.messages), *batch.torn)

    def notices(self, counted: int | None) -> list[Notice]:
        """What to say; `counted` is how many messages the statistics promise."""
        said = []
        if self.spans:
            told = f"{self.spans} chunks are damaged and were left out; the first: {self.reason}"
            missing = f"; {counted - self.found} messages are missing" if counted is not None else ""
            said.append(Notice("DAMAGED_CHUNK", told + missing, lossy=True))
        elif counted is not None and counted != self.found:
            told = f"the file counts {counted} messages and holds {self.found}"
            said.append(Notice("MISSING_MESSAGES", told, lossy=True))
        if self.torn:
            said.append(Notice("TORN_CHUNK", self.torn, lossy=True))
        if self.unchecked:
            said.append(Notice("NO_CHECKSUM", "the file has no checksums: damaged values would go unseen"))
        return said


def _torn(messages: int, held: int, size: int) -> str:
    """What to say of a chunk that breaks off; the lost messages are counted by the share of bytes."""
    lost = f"about {round(messages * (size - held) / held)} are lost" if messages else "the rest is lost"
    return (
        f"the last chunk breaks off: {messages} messages in its first {held} of {size} bytes were taken, {lost}; "
        "they could not be checked, since the chunk's checksum covers all of it"
    )
