"""One topic's numbers as tables: the channels that carry it, its fields, its clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.log import IntArray
from algid.notices import Notice, Remedy
from algid.readers.messages.codec import codec_for
from algid.readers.messages.layout import Decoder
from algid.readers.messages.message_file import Losses, MessageFile, channels_by_topic
from algid.readers.stated import several
from algid.readers.table import SampleTable, stack

_STAMP = ("sec", "nanosec")


@dataclass
class Topic:
    """A topic of one file.

    Parameters
    ----------
    name : str
    paths : mapping
        By canonical channel the path of its number.
    stamp : pair of str, optional
        The paths of a stamp's seconds and nanoseconds.
    clock : "header", "log" or None
        None: the header's stamps, unless they stand still.
    """

    name: str
    paths: Mapping[str, str]
    stamp: tuple[str, str] | None
    clock: str | None
    _chosen: str | None = None

    def tables(self, file: MessageFile, rows: int) -> Iterator[SampleTable]:
        """The topic's samples in tables of about `rows` rows.

        Raises
        ------
        LogError
            If half of the messages do not fit their schema, or their stamps are none.
        """
        place = f"{file.path}: topic {self.name!r}"
        channels = channels_by_topic(file).get(self.name)
        if not channels:
            numbers = {"case": "file", "file": file.path, "topic": self.name}
            missing = Notice("MESSAGES_LEFT_OUT", numbers=numbers)
            yield SampleTable(np.empty(0, np.int64), {}, (missing,))
            return
        wanted = dict(self.paths)
        if self.stamp is not None and self.clock != "log":
            wanted |= dict(zip(_STAMP, self.stamp, strict=True))
        decoder = Decoder(wanted, codec_for(file.path, file.channels[min(channels)]))
        losses = Losses()
        parts: list[SampleTable] = []
        size = 0
        for batch in file.batches(channels):
            losses.add(batch)
            if batch.messages is None or not len(batch.messages):
                continue
            held, columns = decoder.columns(batch.messages)
            misfits = decoder.left_out.get("schema", {"count": 0})
            if misfits["count"] > losses.found / 2:
                raise LogError(f"{place}: {misfits['first']}; it cannot be read without guessing")
            log_ns = batch.messages.log_ns
            stamps = log_ns if held.all() else log_ns[held]
            parts.append(SampleTable(stamps, columns))  # type: ignore[arg-type]
            size += len(parts[-1])
            if size >= rows:
                yield self._clocked(place, parts)
                parts, size = [], 0
        last = self._clocked(place, parts) if parts else SampleTable(np.empty(0, np.int64), {})
        notices = [*file.notices, *losses.notices(self.count(file))]
        yield last.noting(*notices, *self._left_out(decoder, file, channels))

    def count(self, file: MessageFile) -> int:
        """Messages of the topic that the file counts."""
        channels = channels_by_topic(file).get(self.name, ())
        return sum(file.counts.get(channel, 0) for channel in channels)

    def _clocked(self, place: str, parts: list[SampleTable]) -> SampleTable:
        """The tables as one, with the stamps of the chosen clock and float64 columns."""
        table = stack(parts)
        columns, notices = dict(table.columns), table.notices
        stamps = table.stamp_ns
        if _STAMP[0] in columns:
            header = _nanoseconds(place, columns.pop(_STAMP[0]), columns.pop(_STAMP[1]))
            if self._chosen is None and len(table):
                self._chosen = "header"
                if self.clock != "header" and len(table) > 1 and not np.any(header != header[0]):
                    self._chosen = "log"
                    numbers = {"case": "still", "topic": self.name, "stamp": int(header[0])}
                    notices = (*notices, Notice("UNEVEN_STAMPS", numbers=numbers))
            if self._chosen == "header":
                stamps = header
        if stamps is table.stamp_ns and len(table) and stamps.min() < 0:
            header_clock = Remedy({"clock": "header"}, "take the header's stamps")
            raise LogError(
                f"{place}: a log time of 2^63 ns or more; expected ns since 1970; {header_clock}"
            )
        floats = {name: np.asarray(values, np.float64) for name, values in columns.items()}
        return SampleTable(stamps, floats, notices)

    def _left_out(
        self, decoder: Decoder, file: MessageFile, channels: frozenset[int]
    ) -> Iterator[Notice]:
        """Notices of messages that lack a field, do not fit, or are otherwise typed or encoded."""
        others = [
            (file.counts.get(number, 0), channel.type or "no schema")
            for number, channel in file.channels.items()
            if number not in channels and channel.topic == self.name
        ]
        if count := sum(count for count, _ in others):
            types = ", ".join(sorted({kind for count, kind in others if count})[:4])
            decoder.leave("type", count, types=types)
        for case, numbers in decoder.left_out.items():
            own = {"case": case, "topic": self.name} | numbers
            yield Notice("MESSAGES_LEFT_OUT", numbers=own)
        for path, values in decoder.labels.items():
            if len(values) > 1:
                yield several(path, values)


def _nanoseconds(place: str, seconds: NDArray[Any], nanoseconds: NDArray[Any]) -> IntArray:
    """Stamps (N,) of headers in ns.

    Raises
    ------
    LogError
        If one is beyond int64 nanoseconds, or not finite.
    """
    for values, largest in (
        (seconds, LIMITS.stamp_seconds),
        (nanoseconds, LIMITS.largest_time_ns),
    ):
        wrong = np.flatnonzero(~(np.abs(values.astype(np.float64)) < largest))
        if wrong.size:
            log_clock = Remedy({"clock": "log"}, "take the recorder's times")
            raise LogError(
                f"{place}: a header stamp with {values[wrong[0]]} for seconds or nanoseconds; "
                f"expected whole numbers below 2^63 ns; {log_clock}"
            )
    whole = np.floor(seconds)
    if seconds.dtype.kind == "f":
        nanoseconds = nanoseconds + np.rint((seconds - whole) * 1e9)
    return whole.astype(np.int64) * 1_000_000_000 + nanoseconds.astype(np.int64)
