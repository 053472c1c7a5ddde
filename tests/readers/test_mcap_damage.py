"""Damaged MCAP files are read up to their first break, and what is lost is told and counted.

A summary is believed only where it agrees with the file, a chunk where it is sound.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, ChunkIndex, McapRecord, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType

from algid.base.errors import LogError
from algid.log import Log
from algid.readers import read_log
from algid.writers import write_log
from tests.readers.logs import EPOCH_NS, TRUTH, noise_log, same
from tests.readers.mcaps import (
    NO_INDEX,
    chunks_of,
    messages_of,
    poked,
    write_mcap,
)

LOG = noise_log(120, start_ns=EPOCH_NS)
LONG = noise_log(2000, start_ns=EPOCH_NS)
PLAIN = CompressionType.NONE
PACKED = list(CompressionType)
Edit = Callable[[Any], list[McapRecord]]


def made(path: Path, log: Log = LONG, **options: Any) -> bytes:
    """A file of a log, by default in several chunks with indexes, statistics and a summary."""
    write_mcap(path, messages_of(log), **options)
    return path.read_bytes()


def beginning(path: Path, content: bytes, log: Log = LONG) -> Log:
    """What is read of the content, which is how a log begins."""
    path.write_bytes(content)
    found = read_log(path)
    assert same(found, log.part(0, len(found)))
    return found


def lost(found: Log) -> dict[str, str]:
    return {notice.code: notice.text for notice in found.notices if notice.lossy}


def summary_of(content: bytes) -> int:
    """Where the summary begins."""
    return int(struct.unpack_from("<Q", content, len(content) - 28)[0])


def summarised(content: bytes, kinds: Any, edit: Edit, checksum: bool = True) -> bytes:
    """The file with other records of some kinds in its summary, under a checksum or none."""
    start, builder = summary_of(content), RecordBuilder()
    for record in StreamReader(BytesIO(content[start:]), skip_magic=True).records:
        if type(record).__name__ not in ("Footer", "SummaryOffset"):
            for one in edit(record) if isinstance(record, kinds) else [record]:
                one.write(builder)
    body = builder.end()  # type: ignore[no-untyped-call]
    head = struct.pack("<BQQQ", 2, 20, start, 0)
    crc = zlib.crc32(body + head) if checksum else 0
    return content[:start] + body + head + struct.pack("<I", crc) + content[-8:]


def gone(_: Any) -> list[McapRecord]:
    return []


def twice(one: Any) -> list[McapRecord]:
    return [one, one]


TWICE = "defined anew and differently"
SUMMARIES: dict[str, tuple[Any, Edit, str]] = {
    "as it was": ((), gone, ""),
    "a schema twice, alike": (Schema, twice, ""),
    "a channel twice, alike": (Channel, twice, ""),
    "no list of chunks": (ChunkIndex, gone, ""),
    "no statistics": (Statistics, gone, "DAMAGED_INDEX"),
    "nothing": ((Statistics, ChunkIndex, Channel, Schema), gone, "DAMAGED_INDEX"),
    "a count of another channel": (
        Statistics,
        lambda one: [replace(one, channel_message_counts=one.channel_message_counts | {7: 1})],
        "DAMAGED_INDEX",
    ),
    "a channel without definition": (
        Channel,
        lambda one: [replace(one, id=5)],
        "DAMAGED_INDEX",
    ),
    "a schema twice": (Schema, lambda one: [one, replace(one, data=b"int8 x")], TWICE),
    "a channel twice": (Channel, lambda one: [one, replace(one, topic="/other")], TWICE),
}


@pytest.mark.parametrize("checksum", [True, False])
@pytest.mark.parametrize("summary", SUMMARIES)
def test_a_summary_that_does_not_agree_with_the_file_loses_nothing_unseen(
    summary: str, checksum: bool, tmp_path: Path
) -> None:
    path, (kinds, edit, told) = tmp_path / "log.mcap", SUMMARIES[summary]
    path.write_bytes(summarised(made(path, LOG), kinds, edit, checksum))
    if told == TWICE:
        with pytest.raises(LogError, match=told):
            read_log(path)
        return
    found = read_log(path)
    assert same(found, LOG)
    codes = [notice.code for notice in found.notices]
    if summary == "a channel without definition":
        assert told in codes
    else:
        assert codes == ([told] if told else [])


@pytest.mark.parametrize(
    ("place", "form", "value"), [(-37, "<B", 7), (-36, "<Q", 21), (-28, "<Q", 7), (-12, "<I", 1)]
)
def test_a_damaged_footer_is_told_and_the_file_is_walked(
    place: int, form: str, value: int, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(poked(made(path, LOG), place, form, value))
    found = read_log(path)
    assert same(found, LOG)
    assert [(one.code, one.case) for one in found.notices] == [("DAMAGED_INDEX", "summary")]


@pytest.mark.parametrize("behind", ["a chunk", "its index"])
def test_an_end_of_the_data_that_stands_too_early_hides_no_loss(
    behind: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    content = made(path)
    start = summary_of(content)
    end = content[start - 13 : start]
    assert end[0] == 15
    chunks = chunks_of(path)
    first = chunks[0].chunk_start_offset + chunks[0].chunk_length * (behind == "its index")
    # all of it, but for the summary
    whole = content[:first] + end + content[first:start]
    assert len(beginning(path, whole)) == len(LONG)
    place = chunks[3].chunk_start_offset + len(end)
    found = beginning(path, poked(whole, place + 1, "<Q", 3))
    assert len(found) < len(LONG)
    assert lost(found)


VERY_LONG = noise_log(20_000, start_ns=EPOCH_NS)
"""About 3 MB of messages, many blocks of zstd and lz4."""


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("checksums", [True, False])
def test_a_chunk_that_breaks_off_yields_its_whole_messages(
    compression: CompressionType, checksums: bool, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    content = made(
        path, VERY_LONG, compression=compression, chunk_size=1 << 24, enable_crcs=checksums
    )
    (chunk,) = chunks_of(path)
    cut = content[: chunk.chunk_start_offset + chunk.chunk_length * 6 // 10]
    found = beginning(path, cut, VERY_LONG)
    # zstd and lz4 lose the block that breaks off, 128 and 64 KiB of about 3 MB
    assert 0.53 < len(found) / len(VERY_LONG) < 0.61
    assert lost(found).keys() == {"CUT_OFF"}
    assert "an unfinished chunk" in lost(found)["CUT_OFF"]


def test_the_truth_in_the_metadata_is_read_where_it_can_be(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, LOG, truth=TRUTH)
    assert read_log(path).origin.truth == TRUTH
    content = path.read_bytes()
    name = b"\x05\0\0\0algid"
    place = content.index(name, content.index(name) + 1)  # the header has it too
    other = content[:place] + b"\x05\0\0\0other" + content[place + 9 :]  # the index knows its name
    for damaged in (other, content.replace(b'"arm"', b'"mra"')):
        path.write_bytes(damaged)
        with pytest.raises(
            LogError,
            match=rf"^{path}: the truth in the MCAP file is damaged .*(Error|no name).*; copy",
        ):
            read_log(path)


def test_what_lies_behind_the_last_whole_record_is_called_cut(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    whole = made(path)
    cut = whole[: chunks_of(path)[5].chunk_start_offset]
    two = f"at byte {len(whole) - 8}: {len(whole) + 8:,} bytes"
    for content, words in ((cut, "breaks off behind its last whole record"), (whole * 2, two)):
        assert words in lost(beginning(path, content))["CUT_OFF"]


BARE = {"compression": PLAIN}
UNKNOWN = BARE | {"use_statistics": False}
"""Without statistics, a chunk's own index tells how many messages are lost."""
LOOSE = NO_INDEX | {"use_chunking": False}
LENGTHS = (0, 3, 1 << 20, (1 << 64) - 1)
DAMAGES: list[tuple[dict[str, Any], str, int, str, tuple[int, ...], str]] = [
    ({}, "chunk", 0, "<B", (0x86,), "DAMAGED CUT_OFF"),  # is called another record
    (UNKNOWN, "chunk", 0, "<B", (0x86,), "CUT_OFF"),
    (BARE, "number", 0, "<B", (7,), "DAMAGED"),
    (UNKNOWN, "number", 0, "<B", (7,), "DAMAGED"),
    (BARE, "index", 9, "<h", (7,), "DAMAGED"),  # is taken for one of another channel's
    *((BARE, "index", 23, "<q", (to,), "") for to in (31, 1 << 40, -8)),
    *((BARE | {"compression": one}, "chunk", 25, "<QI", (0, 0), "DAMAGED") for one in PACKED),
    *((BARE | {"compression": one}, "chunk", 25, "<QI", (100, 0), "DAMAGED") for one in PACKED),
    *((BARE, "chunk", 1, "<Q", (length,), "DAMAGED CUT_OFF") for length in LENGTHS),
    *((LOOSE, "message", 1, "<Q", (length,), "CUT_OFF") for length in LENGTHS),
]
"""How a file is written, what of it is changed from which byte on, to what, and what is lost."""


@pytest.mark.parametrize("row", DAMAGES, ids=str)
def test_what_damage_leaves_is_right_and_what_it_takes_is_told(row: Any, tmp_path: Path) -> None:
    path, (options, part, offset, form, values, codes) = tmp_path / "log.mcap", row
    whole = made(path, **options)
    place = whole.index(struct.pack("<d", LONG.theta[0, 1000]))
    if part == "message":
        size = 22 + len(messages_of(LONG)[1000][2])
        place = whole.rindex(struct.pack("<BQ", 5, size), 0, place)
    elif part != "number":
        chunk = chunks_of(path)[3]
        (index,) = chunk.message_index_offsets.values()
        place = index if part == "index" else chunk.chunk_start_offset
    path.write_bytes(poked(whole, place + offset, form, *values))
    found = read_log(path)
    kept = np.isin(LONG.stamp_ns, found.stamp_ns)
    assert np.array_equal(found.theta, LONG.theta[:, kept])
    told, missing = lost(found), len(LONG) - len(found)
    assert told.keys() == {*codes.split()}
    assert (0 < missing < len(LONG)) == bool(codes)
    if codes == "DAMAGED":
        counts = f"{missing} messages are missing", f"counts 2,000 messages and holds {len(found)}"
        assert any(words in told["DAMAGED"] for words in counts)
