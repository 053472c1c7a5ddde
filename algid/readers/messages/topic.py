"""One topic: what reads its messages; its numbers as tables, by its fields and its clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from algid.base.errors import LogError
from algid.notices import Notice, Remedy
from algid.readers.annotations import lines_of, several, units_in
from algid.readers.flat import to_nanoseconds
from algid.readers.messages import protobuf, ros
from algid.readers.messages.json import JsonRecords, properties
from algid.readers.messages.layout import Codec, Decoder, MessageLayout, MisfitError
from algid.readers.messages.message_file import MessageChannel, MessageFile
from algid.readers.table import ROWS, SampleTable, stack

_STAMP = ("sec", "nanosec")


def codec_for(channel: MessageChannel) -> Codec:
    """What reads a channel's messages.

    Raises
    ------
    LogError
        If the encoding of the messages or of the schema is not known, or the schema cannot be read.
    """
    place = f"topic {channel.topic!r}"
    root, text = channel.type, channel.definition.decode("utf-8", errors="replace")
    form = channel.encoding, channel.definition_encoding
    try:
        if form in (("cdr", "ros2msg"), ("cdr", "ros2idl"), ("ros1", "ros1msg")):
            ros1 = channel.encoding == "ros1"
            root, types = ros.parse(root, text, idl=form[1] == "ros2idl", ros1=ros1)
            return Codec(partial(ros.parse_layout, root=root, types=types, ros1=ros1))
        if form == ("protobuf", "protobuf"):
            messages = protobuf.parse(root, channel.definition)
            return Codec(partial(protobuf.parse_layout, root=root, types=messages))
    except MisfitError as error:
        raise LogError(f"{place}: the message definition cannot be read: {error}") from error
    if channel.encoding == "json":
        records = JsonRecords()
        return Codec(records.parse, records.records)
    if form == ("cdr", ""):
        raise LogError(
            f"{place}: the file holds no definition of {root}, and none is known; record with MCAP"
        )
    raise LogError(
        f"{place}: message encoding {form[0]!r} with schema encoding {form[1]!r}; expected cdr "
        "with ros2msg or ros2idl, ros1 with ros1msg, protobuf, or json"
    )


def stated_of(
    channel: MessageChannel, paths: Mapping[str, str], layouts: Sequence[MessageLayout] = ()
) -> tuple[dict[str, str], list[str]]:
    """By field the unit that a channel's schema or metadata state; what else is stated, as text.

    `paths` are those of the fields in the messages.
    """
    text = channel.definition.decode("utf-8", errors="replace")
    metadata, lines = dict(channel.metadata), list(lines_of(channel.metadata))
    if channel.encoding == "json":
        own = properties(text)
        metadata |= own
        lines += [f"{key}: {said}" for key, said in own.items() if key.endswith("description")]
        for path, label in layouts[0].labels.items() if layouts else ():
            lines += [f"{path}: {label}"] * ("unit" in path)
    elif channel.definition_encoding.startswith("ros"):
        lines += [line for line in text.splitlines() if "#" in line or "//" in line]
    elif channel.encoding == "protobuf":
        lines += protobuf.comments(channel.definition)
    lists = {name: path.partition("[")[0] for name, path in paths.items()}
    units = units_in(metadata, list(dict.fromkeys(lists.values())))
    return {name: units[path] for name, path in lists.items() if path in units}, lines


def topic_tables(
    files: Sequence[Callable[[], MessageFile]],
    topic: str,
    paths: Mapping[str, str],
    stamp: tuple[str, str] | None,
    by_header: bool | None,
    told: list[Notice],
) -> Iterator[SampleTable]:
    """A topic's samples in tables of about `ROWS` rows; what is lost is told at a file's end.

    Parameters
    ----------
    files : sequence of callable
        What opens the log's files in their order.
    topic : str
    paths : mapping
        By canonical channel the path of its number.
    stamp : pair of str, optional
        The paths of a stamp's seconds and nanoseconds.
    by_header : bool or None
        Whether to take that stamp; None: unless it stands still.
    told : list of Notice

    Raises
    ------
    LogError
        If half of the messages do not fit their schema, their stamps are none, or a file states
        other units than those before it.
    """
    wanted, place = dict(paths), f"topic {topic!r}"
    if stamp is not None:
        wanted |= dict(zip(_STAMP, stamp, strict=True))

    def clocked(parts: Sequence[SampleTable]) -> SampleTable:
        """The samples with the stamps of the chosen clock and float64 columns."""
        nonlocal by_header
        table = stack(parts)
        columns, stamps = dict(table.columns), table.stamp_ns
        if _STAMP[0] in columns:
            try:
                header = to_nanoseconds(columns.pop(_STAMP[0]), "s")
                header += to_nanoseconds(columns.pop(_STAMP[1]), "ns")
            except ValueError as error:
                log_clock = Remedy({"clock": "log"}, "take the recorder's times")
                raise LogError(f"{place}: a header stamp with {error}; {log_clock}") from error
            if by_header is None and len(table):
                still = len(table) > 1 and not np.any(header != header[0])
                by_header = not still
                if still:
                    numbers = {"case": "still", "topic": topic, "stamp": int(header[0])}
                    told.append(Notice("UNEVEN_STAMPS", numbers=numbers))
            stamps = header if by_header else stamps
        if not by_header and len(table) and stamps.min() < 0:
            header_clock = Remedy({"clock": "header"}, "take the header's stamps")
            raise LogError(
                f"{place}: a log time of 2^63 ns or more; expected ns since 1970; {header_clock}"
            )
        floats = {name: np.asarray(values, np.float64) for name, values in columns.items()}
        return SampleTable(stamps, floats)

    known: dict[str, str] | None = None
    for opened in files:
        file = opened()
        channels = file.topics.get(topic)
        if not channels:
            absent = {"case": "file", "file": file.path, "topic": topic}
            told.append(Notice("MESSAGES_LEFT_OUT", numbers=absent))
            continue
        channel = file.channel(topic)
        units = stated_of(channel, paths)[0] if len(files) > 1 else {}
        if known not in (None, units):
            said = [", ".join(map(" in ".join, one.items())) or "none" for one in (units, known)]
            raise LogError(
                f"{place}: {file.path} states other units ({said[0]}) than the files before it "
                f"({said[1]}); read each file for itself"
            )
        known, codec = units, codec_for(channel)
        decoder = Decoder(wanted, codec)
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
            if size >= ROWS:
                yield clocked(parts)
                parts, size = [], 0
        if parts:
            yield clocked(parts)
        # those of the same joints, unless one begins where the other has ended, as a driver does
        # that is started again
        publishers = dict[int, tuple[int, int]]()
        for number in sorted(channels) if len(channels) > 1 else ():
            times = list[int]()
            for one in file.batches(frozenset((number,))):
                if isinstance(one, str) or not len(one):
                    continue
                if not (times or Decoder(wanted, codec).columns(one)[0].any()):
                    break
                times += int(one.log_ns.min()), int(one.log_ns.max())
            if times:
                publishers[number] = min(times), max(times)
        if any(one[1] > other[0] for one, other in pairwise(sorted(publishers.values()))):
            told.append(several(f"publisher of {topic}", publishers))
        others = Counter[str]()
        for number, channel in file.channels.items():
            if channel.topic == topic and number not in channels and file.counts.get(number):
                others[channel.type or "no schema"] += file.counts[number]
        if others:
            decoder.leave("type", others.total(), types=", ".join(sorted(others)[:4]))
        told += file.notices
        promised = file.count(topic)
        numbers: dict[str, Any] = {"case": "count", "promised": promised, "found": found}
        if lost:
            numbers = {"case": "chunk", "count": len(lost), "why": lost[0]}
            numbers["missing"] = promised - found
        if lost or promised != found:
            told.append(Notice("DAMAGED", numbers=numbers))
        if unchecked:
            told.append(Notice("NO_CHECKSUM", numbers={"case": "file"}))
        for case, left_out in decoder.left_out.items():
            own = {"case": case, "topic": topic} | left_out
            told.append(Notice("MESSAGES_LEFT_OUT", numbers=own))
        told += [several(path, texts) for path, texts in decoder.labels.items() if len(texts) > 1]
