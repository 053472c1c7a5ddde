"""MCAP logs, read by columns: only the joints' chunks, without a Python object per message."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from algid.errors import LogError
from algid.log import Truth
from algid.readers.mcap.catalogue import Catalogue, catalogue
from algid.readers.mcap.framing import DamagedError, File
from algid.readers.mcap.load import batches, look_beside
from algid.readers.messages.batch import MessageBatch
from algid.readers.messages.reader import MessageLog
from algid.readers.messages.source import MessageChannel, Source


def open_mcap(paths: Sequence[Path]) -> MessageLog:
    """An MCAP log, or the splits of one in their order."""
    known: Known = {}
    name = str(paths[0] if len(paths) == 1 else paths[0].parent)
    return MessageLog(name, "mcap", [partial(messages_in, path, known) for path in paths])


Known = dict[tuple[Path, int, int], Catalogue]
"""Catalogues by path, size and time of change, so that a log is walked once for all passes."""


@contextmanager
def messages_in(path: Path, known: Known | None = None) -> Iterator[McapSource]:
    """The messages of an opened file: see `opened`."""
    with opened(path, known) as (file, index):
        yield McapSource(file, index)


@contextmanager
def opened(path: Path, known: Known | None = None) -> Iterator[tuple[File, Catalogue]]:
    """The opened file and its catalogue; a given `known` is looked up first and then holds it.

    Raises
    ------
    LogError
        If not even the start of the file is MCAP.
    """
    with File(path) as file:
        index = None if known is None else known.get((path, file.size, file.changed_ns))
        if index is None:
            try:
                index = catalogue(file)
            except DamagedError as error:
                raise LogError(f"{path}: the MCAP file cannot be read: {error}") from error
        if known is not None:
            known[path, file.size, file.changed_ns] = index
            index = index.copy()
        yield file, index


class McapSource(Source):
    """The messages of an MCAP file that is open."""

    def __init__(self, file: File, found: Catalogue) -> None:
        self.path = str(file.path)
        self.channels = {number: _channel(found, one) for number, one in found.channels.items()}
        self.counts, self.span_ns = found.counts, found.span_ns
        self.notices, self.damage = found.notices, found.damage
        self._file, self._found = file, found

    def batches(self, channels: frozenset[int]) -> Iterator[MessageBatch]:
        """The messages of `channels` in file order; a damaged part yields its reason."""
        return batches(self._file, self._found, channels)

    def works(self, steps: int) -> bool:
        """Count steps of some microsecond each.

        False where no honest file of this size asks for so many.
        """
        return self._file.works(steps)

    def check(self, channels: frozenset[int]) -> None:
        """Look for what chunks of other channels define anew."""
        look_beside(self._file, self._found, channels)

    def used(self) -> frozenset[int]:
        """The channels that have messages, as far as the file tells."""
        if self.counts is not None:
            return super().used()
        used: set[int] = set()
        for span in self._found.spans:
            if span.channels is None:
                return super().used()
            used |= span.channels
        return frozenset(used.intersection(self.channels))

    def truth(self) -> Truth | None:
        """What the metadata tell of a simulated arm."""
        return self._found.truth(self._file.path)


def _channel(found: Catalogue, channel: object) -> MessageChannel:
    schema = found.schemas.get(channel.schema_id)  # type: ignore[attr-defined]
    topic, encoding = channel.topic, channel.message_encoding  # type: ignore[attr-defined]
    metadata = channel.metadata  # type: ignore[attr-defined]
    if schema is None:
        return MessageChannel(topic, "", encoding, "", b"", metadata)
    return MessageChannel(topic, str(schema.name), encoding, schema.encoding, schema.data, metadata)
