"""Batches of messages of some channels, chunk by chunk, unpacked ahead in threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass

from algid.readers.mcap.catalogue import Catalogue, Span
from algid.readers.mcap.framing import DamagedError, File, claimed, has_checksum
from algid.readers.mcap.records import Records, entries, joined
from algid.readers.messages.batch import MessageBatch
from algid.runtime import executor

_AHEAD = 3
_AHEAD_BYTES = 1 << 23
"""Chunks beyond this size are not read ahead, so that memory stays bounded by one of them."""

_LOOKED_BESIDE, _SHARE_BESIDE = 1 << 22, 4
"""Limits of the chunks of other channels to look at: bytes, and a share 1/4 of the read ones."""

_GROUP_BYTES, _GROUP_UNPACKED = 1 << 16, 1 << 21
"""Small chunks are loaded together up to these sizes, packed and unpacked."""


def spans_of(catalogue: Catalogue, channels: frozenset[int]) -> list[Span]:
    """The spans that may hold messages of the channels."""
    return [span for span in catalogue.spans if span.channels is None or span.channels & channels]


def spans_beside(catalogue: Catalogue, channels: frozenset[int]) -> list[Span]:
    """The first spans of other channels, as many as cost little beside those of `channels`.

    They are looked at for definitions only: one may give a channel that is read another meaning.
    """
    own = spans_of(catalogue, channels)
    left = _LOOKED_BESIDE + sum(span.length for span in own) // _SHARE_BESIDE
    spans: list[Span] = []
    for span in catalogue.spans if own else ():
        if span.channels is None or span.channels & channels:
            continue
        left -= span.length
        if left < 0:
            break
        spans.append(span)
    return spans


def look_beside(file: File, catalogue: Catalogue, channels: frozenset[int]) -> None:
    """Note what spans of other channels, as far as they are looked at, redefine."""
    if channels not in catalogue.beside:
        before, catalogue.redefined = catalogue.redefined, {}
        with executor(2) as pool:
            spans = spans_beside(catalogue, channels)
            for span, others in zip(
                spans, pool.map(lambda span: _others(file, span), spans), strict=True
            ):
                with suppress(DamagedError):
                    catalogue.redefines(others, span.start)
        catalogue.beside[channels], catalogue.redefined = catalogue.redefined, before
    for channel, place in catalogue.beside[channels].items():
        catalogue.redefined[channel] = min(place, catalogue.redefined.get(channel, place))


def _others(file: File, span: Span) -> tuple[tuple[int, bytes], ...]:
    """Code and content of a span's records that are no messages.

    None of one that is damaged, which is not read.
    """
    try:
        return span.records(file, file.read(span.start, span.length + span.index_length)).others
    except DamagedError:
        return ()


def batches(file: File, catalogue: Catalogue, channels: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of `channels` in file order, many small spans at once.

    a damaged span yields its reason.
    """
    waiting: deque[Future[_Loaded]] = deque()

    def first() -> Iterator[MessageBatch]:
        loaded, left = waiting.popleft().result()
        yield from loaded
        while left:
            loaded, left = _load(file, catalogue, left, channels)
            yield from loaded

    with executor(2) as pool:
        try:
            for spans in _groups(spans_of(catalogue, channels)):
                ahead = _AHEAD if spans[0].length <= _AHEAD_BYTES else 0
                while len(waiting) > ahead:
                    yield from first()
                waiting.append(pool.submit(_load, file, catalogue, spans, channels))
            while waiting:
                yield from first()
        finally:
            for future in waiting:
                future.cancel()


def _groups(spans: Sequence[Span]) -> Iterator[Sequence[Span]]:
    """Adjacent spans to load as one: a small one alone costs more than its messages do."""
    first = size = 0
    for place, span in enumerate(spans):
        if place > first and size + span.length > _GROUP_BYTES:
            yield spans[first:place]
            first, size = place, 0
        size += span.length
    if spans:
        yield spans[first:]


_Loaded = tuple[list[MessageBatch], Sequence[Span]]
"""Batches of a group's first spans, and the rest if the first already fill the memory limit."""


@dataclass(frozen=True)
class _Sound:
    """A span's records, whether they were checked, and a torn chunk's size as it should be."""

    records: Records
    checked: bool
    torn: int | None = None


def _load(
    file: File, catalogue: Catalogue, spans: Sequence[Span], channels: frozenset[int]
) -> _Loaded:
    """Batches of spans: a damaged or torn one by itself, those between two of them as one."""
    loaded: list[MessageBatch] = []
    sound: list[_Sound] = []
    size, left = 0, spans[len(spans) :]
    for place, span in enumerate(spans):
        if size > _GROUP_UNPACKED:
            left = spans[place:]
            break
        one = _opened(file, catalogue, span, channels)
        if isinstance(one, MessageBatch) or one.torn is not None:
            loaded += _joined(sound, channels)
            loaded += [one] if isinstance(one, MessageBatch) else _joined([one], channels)
            sound = []
        else:
            sound.append(one)
            size += one.records.content.size
    return [*loaded, *_joined(sound, channels)], left


def _joined(sound: Sequence[_Sound], channels: frozenset[int]) -> list[MessageBatch]:
    """The messages of sound spans as one batch, or none."""
    if not sound:
        return []
    checked = all(one.checked or not one.records.offsets.size for one in sound)
    held, size = sound[0].records.content.size, sound[0].torn
    messages = joined([one.records for one in sound]).of(channels)
    return [MessageBatch(messages, checked, torn=None if size is None else (held, size))]


def _opened(
    file: File, catalogue: Catalogue, span: Span, channels: frozenset[int]
) -> _Sound | MessageBatch:
    """What a span holds, or the batch that says why it is lost.

    No message is read behind a record that gives its channel another meaning.
    """  # noqa: DOC501  # what is raised is caught here: it is why the span is lost
    content = b""
    try:
        content = file.read(span.start, span.length + span.index_length)
        records = span.records(file, content)
        catalogue.redefines(records.others, span.start)
        if any(
            catalogue.redefined.get(channel, span.start + 1) <= span.start for channel in channels
        ):
            raise DamagedError("a channel or its schema is defined anew and differently")
    except DamagedError as error:
        lost = 0
        for channel, places in entries(content[span.length :]):
            if channel in channels:
                lost += places.size
        return MessageBatch(None, checked=True, reason=f"{error} (at byte {span.start})", lost=lost)
    size = claimed(content) if span.torn else None
    broken = size is not None and size != records.content.size
    return _Sound(
        records, not span.loose and (has_checksum(content) or broken), size if broken else None
    )
