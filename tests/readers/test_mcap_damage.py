"""Damaged MCAP files: what is left is read, and what is lost is told and counted."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType

from algid.errors import LogError
from algid.log import Log
from algid.readers import read_log
from algid.readers.mcap import opened
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import (
    NO_INDEX,
    TOPIC,
    chunks_of,
    joint_state,
    messages_of,
    small_chunks,
    write_mcap,
)

LongLog = tuple[Log, list[tuple[str, int, bytes]]]


@pytest.fixture(scope="module")
def long() -> LongLog:
    """Twenty thousand samples and their messages: about 3 MB, many blocks of zstd and lz4."""
    log = noise_log(20_000, start_ns=EPOCH_NS)
    return log, messages_of(log)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.95])
def test_a_cut_file_yields_what_is_there(share: float, tmp_path: Path) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "whole.mcap", messages_of(log))
    content = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: int(share * len(content))])
    found = read_log(tmp_path / "cut.mcap")
    assert share - 0.15 < len(found) / len(log) <= 1
    assert same(found, log.part(0, len(found)))
    assert any(notice.lossy for notice in found.notices)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("options", [{}, {"enable_crcs": False}])
def test_a_chunk_that_breaks_off_yields_its_whole_messages(
    compression: CompressionType, options: dict[str, Any], long: LongLog, tmp_path: Path
) -> None:
    log, messages = long
    write_mcap(
        tmp_path / "whole.mcap", messages, compression=compression, chunk_size=1 << 24, **options
    )
    content = (tmp_path / "whole.mcap").read_bytes()
    (chunk,) = chunks_of(tmp_path / "whole.mcap")
    (tmp_path / "cut.mcap").write_bytes(
        content[: chunk.chunk_start_offset + chunk.chunk_length * 6 // 10]
    )
    found = read_log(tmp_path / "cut.mcap")
    # zstd and lz4 lose the block that breaks off, 128 and 64 KiB of about 3 MB
    assert 0.53 < len(found) / len(log) < 0.61
    assert same(found, log.part(0, len(found)))
    notices = {notice.code: notice for notice in found.notices if notice.lossy}
    assert notices.keys() == {"CUT_OFF", "TORN_CHUNK"}
    assert f"{len(found):,} messages" in notices["TORN_CHUNK"].text
    assert "could not be checked" in notices["TORN_CHUNK"].text
    told = re.search(r"about ([\d,]+) are lost", notices["TORN_CHUNK"].text)
    assert told is not None
    # all messages are of one size, the schema and the channel are the rest
    assert abs(int(told[1].replace(",", "")) - (len(log) - len(found))) < 200


def test_a_torn_chunk_that_is_damaged_too_is_left_out(tmp_path: Path) -> None:
    log = noise_log(3000, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "whole.mcap", messages_of(log), chunk_size=1 << 17)
    content = bytearray((tmp_path / "whole.mcap").read_bytes())
    last = chunks_of(tmp_path / "whole.mcap")[-1]
    place = last.chunk_start_offset + 60  # within the frame's header and first block
    content[place : place + 20] = b"\xff" * 20
    (tmp_path / "cut.mcap").write_bytes(content[: last.chunk_start_offset + last.chunk_length // 2])
    found = read_log(tmp_path / "cut.mcap")
    assert same(found, log.part(0, len(found)))
    assert {"CUT_OFF", "DAMAGED_CHUNK"} <= {notice.code for notice in found.notices if notice.lossy}


def test_a_flipped_bit_costs_its_chunk_and_is_told(tmp_path: Path) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "log.mcap", messages_of(log), compression=CompressionType.NONE)
    content = bytearray((tmp_path / "log.mcap").read_bytes())
    place = content.index(struct.pack("<d", log.theta[0, 1000]))
    content[place] ^= 1
    (tmp_path / "log.mcap").write_bytes(content)
    found = read_log(tmp_path / "log.mcap")
    assert len(found) > 1900
    assert log.theta[0, 1000] not in found.theta
    (notice,) = found.notices
    assert notice.code == "DAMAGED_CHUNK"
    assert notice.lossy
    assert f"{len(log) - len(found):,} messages are missing" in notice.text


def test_a_message_index_that_lies_is_not_believed(tmp_path: Path) -> None:
    log = noise_log(300, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "log.mcap", messages_of(log), compression=CompressionType.NONE)
    content = bytearray((tmp_path / "log.mcap").read_bytes())
    (index,) = chunks_of(tmp_path / "log.mcap")[0].message_index_offsets.values()
    struct.pack_into("<Q", content, index + 15 + 8, 31)  # the first message's offset
    (tmp_path / "log.mcap").write_bytes(content)
    assert same(read_log(tmp_path / "log.mcap"), log)


def test_a_file_of_which_damage_left_nothing_says_so_and_where(tmp_path: Path) -> None:
    log = noise_log(100, start_ns=EPOCH_NS)
    write_mcap(
        tmp_path / "log.mcap",
        messages_of(log),
        compression=CompressionType.NONE,
        chunk_size=1 << 20,
    )
    whole = (tmp_path / "log.mcap").read_bytes()
    (chunk,) = chunks_of(tmp_path / "log.mcap")
    content = bytearray(whole)
    content[content.index(struct.pack("<d", log.theta[0, 50]))] ^= 1
    (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(
        LogError, match=rf"damaged \(.*checksum.*byte {chunk.chunk_start_offset + 9}\).*no topic"
    ):
        read_log(tmp_path / "log.mcap")
    content[content.rindex(b"JointState")] ^= 1  # in the summary
    (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(
        LogError, match=r"damaged \(its summary: its checksum is wrong; .*\).*no topic"
    ):
        read_log(tmp_path / "log.mcap")
    (tmp_path / "log.mcap").write_bytes(whole[: chunk.chunk_start_offset + 100])
    with pytest.raises(
        LogError, match=rf"damaged \(.*breaks off at byte {chunk.chunk_start_offset}\).*no topic"
    ):
        read_log(tmp_path / "log.mcap")


def test_damage_is_not_blamed_for_a_choice_that_is_missing(tmp_path: Path) -> None:
    names = [f"joint{number}" for number in range(7)]
    messages = [
        (TOPIC, row, joint_state(row, names, [0.0] * 7, (), [1.0] * 7).done()) for row in range(100)
    ]
    write_mcap(tmp_path / "log.mcap", messages, compression=CompressionType.NONE)
    content = (tmp_path / "log.mcap").read_bytes()
    (tmp_path / "log.mcap").write_bytes(content[: len(content) // 2])
    with pytest.raises(LogError, match="has 7 joints") as caught:
        read_log(tmp_path / "log.mcap")
    assert "damaged" not in str(caught.value)


def test_a_chunk_that_claims_too_much_is_left_out_unread(tmp_path: Path) -> None:
    log = noise_log(500, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "log.mcap", messages_of(log))
    content = bytearray((tmp_path / "log.mcap").read_bytes())
    place = content.index(b"\x04\0\0\0zstd")
    struct.pack_into("<Q", content, place - 12, 1 << 60)
    (tmp_path / "log.mcap").write_bytes(content)
    found = read_log(tmp_path / "log.mcap")
    assert 0 < len(found) < len(log)
    assert any(notice.code == "DAMAGED_CHUNK" and notice.lossy for notice in found.notices)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("length", [0, 3, 1 << 20, 1 << 63, (1 << 64) - 1])
def test_behind_a_broken_record_the_next_whole_one_is_found(
    length: int, chunked: bool, tmp_path: Path
) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    path = tmp_path / "log.mcap"
    options: dict[str, Any] = {} if chunked else NO_INDEX
    write_mcap(path, messages_of(log), use_chunking=chunked, **options)
    content = bytearray(path.read_bytes())
    if chunked:
        place = chunks_of(path)[len(chunks_of(path)) // 2].chunk_start_offset
        content[-8:] = b"no magic"
    else:
        size = len(messages_of(log)[1000][2])
        place = content.rindex(
            struct.pack("<BQ", 5, 22 + size),
            0,
            content.index(struct.pack("<d", log.theta[0, 1000])),
        )
    struct.pack_into("<Q", content, place + 1, length)
    path.write_bytes(content)
    found = read_log(path)
    lost = len(log) - len(found)
    assert 1 <= lost <= (40 if chunked else 8)
    assert np.isin(found.theta, log.theta).all()
    assert found.stamp_ns[0] == log.stamp_ns[0]
    assert found.stamp_ns[-1] == log.stamp_ns[-1]
    assert any(notice.lossy and f"byte {place}" in notice.text for notice in found.notices)


def test_a_chunk_that_claims_to_go_on_yields_its_messages_and_those_behind_it(
    tmp_path: Path,
) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    path = tmp_path / "log.mcap"
    write_mcap(path, messages_of(log), compression=CompressionType.NONE)
    content = bytearray(path.read_bytes())
    chunk = chunks_of(path)[3]
    more = len(content)  # both lengths lie, and agree with one another
    struct.pack_into("<Q", content, chunk.chunk_start_offset + 1, chunk.chunk_length - 9 + more)
    (size,) = struct.unpack_from("<Q", content, chunk.chunk_start_offset + 9 + 32)
    struct.pack_into("<Q", content, chunk.chunk_start_offset + 9 + 32, size + more)
    content[-8:] = b"no magic"
    path.write_bytes(content)
    found = read_log(path)
    assert same(found, log)
    assert any(notice.code == "BROKEN_RECORD" and notice.lossy for notice in found.notices)


def test_a_file_cut_between_two_records_is_called_cut(tmp_path: Path) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    path = tmp_path / "log.mcap"
    write_mcap(path, messages_of(log))
    chunk = chunks_of(path)[5]
    path.write_bytes(path.read_bytes()[: chunk.chunk_start_offset])
    found = read_log(path)
    assert same(found, log.part(0, len(found)))
    assert any(notice.code == "CUT_OFF" and notice.lossy for notice in found.notices)


def test_messages_of_a_damaged_chunk_are_counted_by_its_index(tmp_path: Path) -> None:
    log = noise_log(2000, start_ns=EPOCH_NS)
    path = tmp_path / "log.mcap"
    write_mcap(path, messages_of(log), compression=CompressionType.NONE, use_statistics=False)
    content = bytearray(path.read_bytes())
    content[content.index(struct.pack("<d", log.theta[0, 1000]))] ^= 1
    path.write_bytes(content)
    found = read_log(path)
    assert any(
        f"{len(log) - len(found):,} messages are missing" in notice.text for notice in found.notices
    )


def test_one_damaged_chunk_among_many_small_ones_is_left_out_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    small_chunks(path, compression=CompressionType.NONE)
    content = bytearray(path.read_bytes())
    content[content.index(struct.pack("<d", np.sin(500 * 0.01)))] ^= 1
    path.write_bytes(content)
    log = read_log(path)
    assert len(log) == 999
    assert 500 * 10**6 not in log.stamp_ns
    assert [(one.code, one.lossy) for one in log.notices if one.lossy] == [("DAMAGED_CHUNK", True)]
    assert "1 message is missing" in next(one.text for one in log.notices if one.lossy)


def test_a_chunk_that_claims_to_be_empty_and_is_not_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    small_chunks(path, rows=50, index_types=IndexType.NONE)
    with opened(path) as (_, found):
        place = found.spans[3].start + 16
    content = bytearray(path.read_bytes())
    content[place : place + 8] = bytes(8)
    path.write_bytes(content)
    log = read_log(path)
    assert len(log) == 49
    assert [notice.code for notice in log.notices if notice.lossy] == ["DAMAGED_CHUNK"]
