"""MCAP files against the mcap library: its reader, with sums, and its own writer of the same
messages.
"""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from algid.base.errors import OutputError
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log, Origin
from algid.writers import mcap, write_log

ROWS = 1000


def log_of(rows: int, *, velocity: bool, start: int = 1_700_000_000_000_000_000) -> Log:
    draw = np.random.default_rng(1)
    theta, tau, omega = draw.normal(size=(3, 2, rows))
    stamps = start + 1_000_000 * np.arange(rows)
    return Log(stamps, theta, tau, Origin("", "", {}), omega if velocity else None)


def by_the_library(log: Log) -> bytes:
    """The log as the mcap library writes it, a message at a time."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=8192)
    writer.start(profile="ros2", library="algid")
    schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
    channel = writer.register_channel(mcap.TOPIC, "cdr", schema)
    for number, (stamp, row) in enumerate(
        zip(log.stamp_ns.tolist(), mcap.messages(log), strict=True)
    ):
        writer.add_message(channel, stamp, row.tobytes(), stamp, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def facts(content: bytes) -> list[tuple[object, ...]]:
    reader = make_reader(io.BytesIO(content), validate_crcs=True)
    return [
        (
            schema and schema.data,
            channel.topic,
            one.log_time,
            one.publish_time,
            one.sequence,
            one.data,
        )
        for schema, channel, one in reader.iter_messages()
    ]


def indexed(content: bytes) -> list[int]:
    """The times of the messages that the chunks' indexes name, where a message stands at each
    place.
    """
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    times = []
    for index in summary.chunk_indexes:
        chunk, entries = (
            StreamReader(
                io.BytesIO(content[index.chunk_start_offset :]), skip_magic=True, emit_chunks=True
            ).records,
            content[index.message_index_offsets[1] :],
        )
        (first,) = islice(chunk, 1)
        assert isinstance(first, Chunk)
        plain = zstandard.decompress(first.data)
        (found,) = islice(StreamReader(io.BytesIO(entries), skip_magic=True).records, 1)
        assert isinstance(found, MessageIndex)
        for time, place in found.records:
            assert plain[place] == Opcode.MESSAGE
            assert plain[place + 15 : place + 23] == time.to_bytes(8, "little")
            times.append(time)
    return times


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("block", [ROWS, 333])
def test_the_file_holds_what_the_library_writes(tmp_path: Path, velocity: bool, block: int) -> None:
    log = log_of(ROWS, velocity=velocity)
    path = tmp_path / "log.mcap"
    parts = [log.part(first, min(first + block, ROWS)) for first in range(0, ROWS, block)]
    mcap.write(path, parts, chunk_size=8192)
    content, expected = path.read_bytes(), by_the_library(log)
    assert facts(content) == facts(expected)
    assert indexed(content) == log.stamp_ns.tolist()
    in_turn = NonSeekingReader(io.BytesIO(content), validate_crcs=True).iter_messages()
    assert [one.sequence for *_, one in in_turn] == list(range(ROWS))
    own, theirs = (make_reader(io.BytesIO(one)).get_summary() for one in (content, expected))
    assert own is not None
    assert theirs is not None
    assert own.statistics is not None
    assert len(own.chunk_indexes) == own.statistics.chunk_count > 10
    assert replace(own.statistics, chunk_count=0) == replace(
        theirs.statistics,
        chunk_count=0,  # type: ignore[type-var]
    )


def test_a_log_without_samples_is_a_file_without_messages(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    mcap.write(path, [log_of(0, velocity=False)])
    assert facts(path.read_bytes()) == []


@pytest.mark.parametrize("start", [-1, 2**31 * 10**9 - 5_000_000])
def test_stamps_that_no_header_holds_are_refused_in_one_line(tmp_path: Path, start: int) -> None:
    path = tmp_path / "log.mcap"
    with pytest.raises(
        OutputError, match=r"log\.mcap: .* times from 1970 to 2038 .* found "
    ) as told:
        write_log(path, log_of(ROWS, velocity=False, start=start))
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []
