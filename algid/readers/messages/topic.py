"""One topic's numbers as tables: the channels that carry it, its fields, its clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from algid.base.errors import LogError
from algid.notices import Notice, Remedy
from algid.readers.flat import to_nanoseconds
from algid.readers.messages.codec import codec_for
from algid.readers.messages.layout import Decoder
from algid.readers.messages.message_file import MessageFile
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
    _header: bool | None = None
    """Whether the samples have the header's stamps, once that is known."""

    def tables(self, file: MessageFile, told: list[Notice], rows: int) -> Iterator[SampleTable]:
        """The topic's samples in tables of about `rows` rows; what is lost is told at the end.

        Raises
        ------
        LogError
            If half of the messages do not fit their schema, or their stamps are none.
        """
        channels = file.topics.get(self.name)
        if not channels:
            absent = {"case": "file", "file": file.path, "topic": self.name}
            told.append(Notice("MESSAGES_LEFT_OUT", numbers=absent))
            return
        place = f"{file.path}: topic {self.name!r}"
        wanted = dict(self.paths)
        if self.stamp is not None and self.clock != "log":
            wanted |= dict(zip(_STAMP, self.stamp, strict=True))
        decoder = Decoder(wanted, codec_for(file.path, file.channel(self.name)))
        found, lost, unchecked = 0, list[str](), False
        parts, size = list[SampleTable](), 0
        for messages in file.batches(channels):
            if isinstance(messages, str):
                lost.append(messages)
            elif len(messages):
                found += len(messages)
                unchecked |= not messages.checked
                held, columns = decoder.columns(messages)
                misfits = decoder.left_out.get("schema", {"count": 0})
                if misfits["count"] > found / 2:
                    why = f"{misfits['first']}; it cannot be read without guessing"
                    raise LogError(f"{place}: {why}")
                parts.append(SampleTable(messages.log_ns[held], columns))  # type: ignore[arg-type]
                size += len(parts[-1])
            if size >= rows:
                yield self._clocked(place, stack(parts), told)
                parts, size = [], 0
        if parts:
            yield self._clocked(place, stack(parts), told)
        others = Counter[str]()
        for number, channel in file.channels.items():
            if channel.topic == self.name and number not in channels and file.counts.get(number):
                others[channel.type or "no schema"] += file.counts[number]
        if others:
            decoder.leave("type", others.total(), types=", ".join(sorted(others)[:4]))
        told += file.notices
        promised = file.count(self.name)
        numbers: dict[str, Any] = {"case": "count", "promised": promised, "found": found}
        if lost:
            numbers = {"case": "chunk", "count": len(lost), "why": lost[0]}
            numbers["missing"] = promised - found
        if lost or promised != found:
            told.append(Notice("DAMAGED", numbers=numbers))
        if unchecked:
            told.append(Notice("NO_CHECKSUM", numbers={"case": "file"}))
        for case, left_out in decoder.left_out.items():
            own = {"case": case, "topic": self.name} | left_out
            told.append(Notice("MESSAGES_LEFT_OUT", numbers=own))
        told += [several(path, texts) for path, texts in decoder.labels.items() if len(texts) > 1]

    def _clocked(self, place: str, table: SampleTable, told: list[Notice]) -> SampleTable:
        """The samples with the stamps of the chosen clock and float64 columns."""
        columns, stamps = dict(table.columns), table.stamp_ns
        if _STAMP[0] in columns:
            try:
                header = to_nanoseconds(columns.pop(_STAMP[0]), "s")
                header += to_nanoseconds(columns.pop(_STAMP[1]), "ns")
            except ValueError as error:
                log_clock = Remedy({"clock": "log"}, "take the recorder's times")
                raise LogError(f"{place}: a header stamp with {error}; {log_clock}") from error
            if self._header is None and len(table):
                still = len(table) > 1 and not np.any(header != header[0])
                self._header = self.clock == "header" or not still
                if not self._header:
                    numbers = {"case": "still", "topic": self.name, "stamp": int(header[0])}
                    told.append(Notice("UNEVEN_STAMPS", numbers=numbers))
            stamps = header if self._header else stamps
        if not self._header and len(table) and stamps.min() < 0:
            header_clock = Remedy({"clock": "header"}, "take the header's stamps")
            raise LogError(
                f"{place}: a log time of 2^63 ns or more; expected ns since 1970; {header_clock}"
            )
        floats = {name: np.asarray(values, np.float64) for name, values in columns.items()}
        return SampleTable(stamps, floats)
