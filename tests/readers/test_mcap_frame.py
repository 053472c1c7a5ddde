"""The frame of an MCAP file: a summary is believed only where it agrees with the file, a chunk
where it is sound.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, McapRecord, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from algid.errors import LogError
from algid.readers import read_log
from algid.readers.mcap import opened
from algid.readers.mcap.framing import BrokenOffError, DamagedError, File, Record, unpack, walk
from algid.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.writers import write_log
from tests.readers.logs import EPOCH_NS, TRUTH, noise_log, same
from tests.readers.mcaps import TOPIC, chunks_of, messages_of, write_mcap

LOG = noise_log(120, start_ns=EPOCH_NS)
Records = list[McapRecord]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log in several chunks with message indexes, statistics and a summary, as the `mcap`
    package writes it.
    """
    path = tmp_path_factory.mktemp("whole") / "log.mcap"
    write_mcap(path, messages_of(LOG), chunk_size=4096)
    assert len(chunks_of(path)) > 3
    return path.read_bytes()


def summarised(content: bytes, edit: Callable[[Records], Records], checksum: bool = True) -> bytes:
    """The file with another summary, written by the `mcap` package, under a checksum that is right
    for it or none.
    """
    start, _, _ = struct.unpack_from("<QQI", content, len(content) - 28)
    records = list(StreamReader(BytesIO(content[start:]), skip_magic=True).records)
    builder = RecordBuilder()
    for record in edit(
        [one for one in records if type(one).__name__ not in ("Footer", "SummaryOffset")]
    ):
        record.write(builder)
    body = builder.end()  # type: ignore[no-untyped-call]
    head = struct.pack("<BQQQ", 2, 20, start, 0)
    crc = zlib.crc32(body + head) if checksum else 0
    return content[:start] + body + head + struct.pack("<I", crc) + content[-8:]


def changing(kind: type, change: Callable[[Any], object]) -> Callable[[Records], Records]:
    """Changes the first record of a kind."""

    def edit(records: Records) -> Records:
        change(next(one for one in records if isinstance(one, kind)))
        return records

    return edit


def without(*kinds: type) -> Callable[[Records], Records]:
    return lambda records: [one for one in records if not isinstance(one, kinds)]


def unindexed(records: Records) -> Records:
    """No message indexes, so that the counts cannot be compared."""
    for one in records:
        if isinstance(one, ChunkIndex):
            one.message_index_length, one.message_index_offsets = 0, {}
    return records


def hiding(records: Records) -> Records:
    """The second chunk is in no list, and the statistics do not count it either."""
    chunks = [one for one in unindexed(records) if isinstance(one, ChunkIndex)]
    changing(Statistics, lambda one: setattr(one, "chunk_count", one.chunk_count - 1))(records)
    return [one for one in records if one is not chunks[1]]


def overlapping(records: Records) -> Records:
    """The second chunk is listed in place of the third too."""
    chunks = [one for one in unindexed(records) if isinstance(one, ChunkIndex)]
    chunks[2].chunk_start_offset, chunks[2].chunk_length = (
        chunks[1].chunk_start_offset,
        chunks[1].chunk_length,
    )
    return records


def shorter(records: Records) -> Records:
    last = [one for one in records if isinstance(one, ChunkIndex)][-1]
    return [one for one in records if one is not last]


def hidden_index(records: Records) -> Records:
    """The second chunk lists none of its indexes, and the statistics do not count their
    messages.
    """
    chunk = [one for one in records if isinstance(one, ChunkIndex)][1]
    (channel,) = chunk.message_index_offsets
    count = (chunk.message_index_length - 15) // 16
    chunk.message_index_offsets = {}
    changing(
        Statistics, lambda one: one.channel_message_counts.update({channel: len(LOG) - count})
    )(records)
    return records


def cut_index(records: Records) -> Records:
    """The third chunk has no index as it is told, the second one that ends before its own."""
    chunks = [one for one in hidden_index(records) if isinstance(one, ChunkIndex)]
    chunks[2].message_index_offsets, chunks[2].message_index_length = {}, 0
    chunks[1].message_index_length = 9
    return records


def misplaced(chunk: ChunkIndex) -> None:
    chunk.message_index_offsets = {
        number: place + 1 for number, place in chunk.message_index_offsets.items()
    }


def redefined(kind: type, **change: Any) -> Callable[[Records], Records]:
    """A record of a kind stands there twice, and not the same."""

    def edit(records: Records) -> Records:
        first = next(one for one in records if isinstance(one, kind))
        return [*records, kind(**{**vars(first), **change})]

    return edit


WRONG: dict[str, tuple[Callable[[Records], Records], str]] = {
    "a chunk of no length": (
        changing(ChunkIndex, lambda one: setattr(one, "chunk_length", 9)),
        r"it claims a chunk at byte \d+",
    ),
    "a chunk behind the end": (
        changing(ChunkIndex, lambda one: setattr(one, "message_index_length", 1 << 40)),
        r"it claims a chunk at byte",
    ),
    "a chunk left out": (shorter, r"it lists \d+ of \d+ chunks"),
    "a count": (
        changing(Statistics, lambda one: one.channel_message_counts.update({1: len(LOG) - 1})),
        "its indexes and its statistics count different numbers of messages",
    ),
    "a count of another channel": (
        changing(Statistics, lambda one: one.channel_message_counts.update({7: 1})),
        "its indexes and its statistics count different",
    ),
    "an index beside its place": (changing(ChunkIndex, misplaced), (r"it claims a message index at "
                                                                   r"byte \d+")),
    "chunks over one another": (overlapping, r"its chunks overlap at byte \d+"),
    "a chunk in no list": (hiding, r"it does not list what stands at byte \d+"),
    "an index in no list": (hidden_index, r"it does not list what stands at byte \d+"),
    "an index that ends before its end": (cut_index, r"a record at byte \d+ breaks off"),
    "a channel without definition": (
        changing(Channel, lambda one: setattr(one, "id", 5)), ("it lists messages of a channel 1 "
                                                              "that it does not define")
    ),
    "a schema twice": (redefined(Schema, data=b"int8 x"), ("schema 1 is defined anew and "
                                                          "differently")),
    "a channel twice": (redefined(Channel, topic="/other"), ("channel 1 is defined anew and "
                                                            "differently")),
}  # fmt: skip


@pytest.mark.parametrize("checksum", [True, False])
@pytest.mark.parametrize("fault", WRONG)
def test_a_summary_that_does_not_agree_with_the_file_is_not_used(
    fault: str, checksum: bool, whole: bytes, tmp_path: Path
) -> None:
    edit, told = WRONG[fault]
    path = tmp_path / "log.mcap"
    path.write_bytes(summarised(whole, edit, checksum))
    found = read_log(path)
    assert same(found, LOG)
    (notice,) = found.notices
    assert (notice.code, notice.lossy) == ("DAMAGED_SUMMARY", False)
    assert re.search(rf"cannot be used \({told}", notice.text)


@pytest.mark.parametrize("checksum", [True, False])
@pytest.mark.parametrize(
    "kept", [lambda records: records, unindexed, redefined(Schema), redefined(Channel)]
)
def test_a_summary_that_agrees_is_used(
    kept: Callable[[Records], Records], checksum: bool, whole: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(summarised(whole, kept, checksum))
    found = read_log(path)
    assert same(found, LOG)
    assert found.notices == ()


@pytest.mark.parametrize(
    "missing", [(Statistics,), (ChunkIndex,), (Channel,), (Statistics, ChunkIndex, Channel, Schema)]
)
def test_a_summary_that_says_too_little_is_no_damage(
    missing: tuple[type, ...], whole: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(summarised(whole, without(*missing)))
    found = read_log(path)
    assert same(found, LOG)
    assert [notice.code for notice in found.notices] == ["NO_INDEX"]


def poked(content: bytes, place: int, kind: str, *values: int) -> bytes:
    """The content with other numbers at a place, counted from the end where negative."""
    changed = bytearray(content)
    struct.pack_into(kind, changed, place % len(content), *values)
    return bytes(changed)


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda whole: poked(whole, -37, "<B", 7), "its footer is damaged"),
        (lambda whole: poked(whole, -36, "<Q", 21), "its footer is damaged"),
        (
            lambda whole: poked(whole, -28, "<Q", len(whole)),
            r"its footer claims a summary at byte \d+",
        ),
        (lambda whole: poked(whole, -28, "<Q", 7), "its footer claims a summary at byte 7"),
        (lambda whole: poked(whole, -12, "<I", 1), "its checksum is wrong"),
        (lambda whole: whole[:-1], "the file has no end: it was cut off"),
        (lambda whole: whole + b"\0", "the file has no end: it was cut off"),
    ],
)
def test_a_damaged_footer_is_told_and_the_file_is_walked(
    damage: Callable[[bytes], bytes], told: str, whole: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(damage(whole))
    found = read_log(path)
    assert same(found, LOG)
    first = found.notices[0]
    assert first.code == "DAMAGED_SUMMARY"
    assert re.fullmatch(
        rf"the file's summary cannot be used \({told}\); read by scanning", first.text
    )


@pytest.mark.parametrize("kind", [ChunkIndex, Statistics, Channel])
def test_a_record_of_the_summary_that_breaks_off_within_is_told(
    kind: type, whole: bytes, tmp_path: Path
) -> None:
    start, _, _ = struct.unpack_from("<QQI", whole, len(whole) - 28)
    place, codes = start, {Channel: 4, ChunkIndex: 8, Statistics: 11}
    while whole[place] != codes[kind]:
        place += 9 + int.from_bytes(whole[place + 1 : place + 9], "little")
    within = {Channel: 4, ChunkIndex: 32, Statistics: 42}[kind]  # the length of a text or of a map
    path = tmp_path / "log.mcap"
    path.write_bytes(poked(poked(whole, place + 9 + within, "<I", 1 << 30), -12, "<I", 0))
    found = read_log(path)
    assert same(found, LOG)
    assert f"a {kind.__name__} record cannot be read" in found.notices[0].text


def test_what_does_not_begin_as_mcap_is_no_mcap(whole: bytes, tmp_path: Path) -> None:
    for name, content in (
        ("short", whole[:7]),
        ("other", b"\x89MCAP1" + whole[6:]),
        ("empty", b""),
    ):
        (tmp_path / name).write_bytes(content)
        begins = "the MCAP file cannot be read: the file does not begin as MCAP does"
        with pytest.raises(LogError, match=begins), opened(tmp_path / name):
            pass
    with (
        pytest.raises(LogError, match=r"none: the log cannot be read \(No such file"),
        File(tmp_path / "none"),
    ):
        pass


def test_bytes_outside_a_file_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(range(10)))
    with File(tmp_path / "a") as file:
        assert file.read(2, 3) == b"\2\3\4"
        assert file.read(10, 0) == b""
        for start, length in ((-1, 2), (8, 3), (11, 0), (3, -1)):
            with pytest.raises(
                DamagedError, match=rf"bytes {start} to {start + length} of a file of 10"
            ):
                file.read(start, length)
        assert file.read_bytes == 3
        (tmp_path / "a").write_bytes(b"\0\1")  # cut while it is read
        with pytest.raises(DamagedError, match="bytes 1 to 5 cannot be read"):
            file.read(1, 4)


def test_records_are_walked_to_the_byte_where_they_break_off(tmp_path: Path) -> None:
    sizes = [22, 400_000, 22, 900_000, 60_000, 22]
    content = b"".join(
        struct.pack("<BQHIQQ", 5, size, 1, 0, 0, 0) + bytes(size - 22) for size in sizes
    )
    places = np.cumsum([0, *(9 + size for size in sizes)]).tolist()
    (tmp_path / "a").write_bytes(content)
    with File(tmp_path / "a") as file:
        found = list(walk(file, 0, len(content)))
        assert found == [
            Record(5, place + 9, size) for place, size in zip(places, sizes, strict=False)
        ]
        assert [one.end for one in found] == places[1:]
        for end, record in (
            (len(content) - 1, Record(5, places[-2] + 9, 22)),
            (places[-2] + 8, None),
        ):
            with pytest.raises(
                BrokenOffError, match=f"a record at byte {places[-2]} breaks off"
            ) as caught:
                list(walk(file, 0, end))
            assert (caught.value.place, caught.value.record) == (places[-2], record)
        assert list(walk(file, 5, 5)) == []


PACKED: dict[bytes, Callable[[bytes], bytes]] = {
    b"": bytes,
    b"zstd": zstandard.compress,
    b"lz4": lambda content: lz4.frame.compress(content, block_size=lz4.frame.BLOCKSIZE_MAX64KB),
}
NOISE = np.random.default_rng(4)
MESSAGES = [
    struct.pack("<BQHIQQ", 5, 222, 1, row, row, row) + NOISE.bytes(200) for row in range(2000)
]
INSIDE = b"".join(MESSAGES)


def chunk(
    inside: bytes, name: bytes, *, size: int | None = None, crc: int | None = None, cut: int = 0
) -> bytes:
    """A chunk record's content.

    `size` and `crc` lie where they are given, `cut` bytes are missing at its end.
    """
    packed = PACKED.get(name, bytes)(inside)
    told = (0, 0, len(inside) if size is None else size, zlib.crc32(inside) if crc is None else crc)
    head = struct.pack("<QQQII", *told, len(name)) + name + struct.pack("<Q", len(packed))
    return (head + packed)[: -cut or None]


@pytest.mark.parametrize("name", PACKED)
def test_a_chunk_unpacks_to_what_was_packed_or_is_refused(name: bytes) -> None:
    assert unpack(chunk(INSIDE, name)) == INSIDE
    assert unpack(chunk(INSIDE, name, crc=0)) == INSIDE
    assert unpack(chunk(b"", name)) == b""
    assert unpack(chunk(INSIDE, name), torn=True) == INSIDE
    for wrong, told in (
        (chunk(INSIDE, name, crc=1), "a chunk's checksum is wrong"),
        (chunk(INSIDE, name, cut=5), r"a chunk claims [\d,]+ bytes and has \d+"),
        (chunk(INSIDE, name, size=len(INSIDE) + 1), r"a chunk of 462,001 bytes unpacks to 462000"),
        (chunk(INSIDE, name, size=len(INSIDE) - 1), r"unpacks to|holds a zstd frame of 462000"),
        (
            chunk(INSIDE, name, size=1 << 29),
            "a chunk claims 536,870,912 bytes unpacked, more than 268435456",
        ),
        (chunk(INSIDE, name)[:39], "a chunk breaks off"),
        (poked(chunk(INSIDE, name), 28, "<I", 33), "a chunk's compression has no name"),
        (
            chunk(b"abcdef", name + b"2"),
            f"packed with '{name.decode()}2'; expected zstd, lz4 or nothing",
        ),
    ):
        with pytest.raises(DamagedError, match=told):
            unpack(wrong)
    with pytest.raises(DamagedError, match="checksum"):
        unpack(chunk(INSIDE, name, crc=1), torn=True)


@pytest.mark.parametrize("name", [b"zstd", b"lz4"])
def test_packed_bytes_that_are_damaged_are_refused_by_name(name: bytes) -> None:
    content = chunk(INSIDE, name)
    for torn in (False, True):
        with pytest.raises(DamagedError, match=r"a chunk cannot be unpacked \(.+\)"):
            unpack(poked(content, 40 + len(name), "<Q", 0), torn=torn)


@pytest.mark.parametrize("name", PACKED)
@pytest.mark.parametrize("share", [0.01, 0.35, 0.8, 0.999])
def test_of_a_torn_chunk_whole_records_are_left_and_nothing_else(name: bytes, share: float) -> None:
    whole = chunk(INSIDE, name)
    left = unpack(whole[: 60 + int(share * (len(whole) - 60))], torn=True)
    assert INSIDE.startswith(left)
    assert len(left) % len(MESSAGES[0]) == 0
    # noise does not shrink: what is lost is the block that breaks off, and at most a message more
    block = {b"": 0, b"zstd": 1 << 17, b"lz4": 1 << 16}[name]
    assert share * len(INSIDE) - block - 300 < len(left) <= share * len(INSIDE) + 300


@pytest.mark.parametrize("summary", [True, False])
@pytest.mark.parametrize("code", [3, 4])
def test_behind_a_definition_that_changes_nothing_of_it_is_read(
    code: int, summary: bool, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=600, compression=CompressionType.NONE, enable_crcs=False)
        writer.start()
        one = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
        writer.register_channel(TOPIC, "cdr", one)
        for row, (_, stamp, data) in enumerate(messages_of(LOG)):
            if row == 50:
                other = writer.register_schema("a/msg/B", "ros2msg", b"int8 x")
                writer.add_message(
                    writer.register_channel("/other", "cdr", other), stamp, b"\0\1\0\0\7", stamp
                )
            writer.add_message(1, stamp, data, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    content = path.read_bytes()
    place = next(  # the second of its kind, in the chunk of the fifty-first message
        place for place in range(content.index(b"/other") - 200, len(content))
        if content[place] == code and content[place + 9 : place + 11] == b"\2\0"
    )  # fmt: skip
    end = chunks_of(path)[-1]
    changed = poked(content, place + 9, "<H", 1)
    path.write_bytes(changed if summary else changed[: end.chunk_start_offset + end.chunk_length])
    found = read_log(path)
    assert 46 <= len(found) <= 50  # the chunk itself goes too
    assert same(found, LOG.part(0, len(found)))
    told = {notice.code: notice.text for notice in found.notices if notice.lossy}
    assert "defined anew and differently" in told["DAMAGED_CHUNK"]
    assert told.keys() == ({"DAMAGED_CHUNK"} if summary else {"DAMAGED_CHUNK", "CUT_OFF"})
    if summary:
        assert f"{len(LOG) - len(found)} messages are missing" in told["DAMAGED_CHUNK"]


def test_the_truth_in_the_metadata_is_read_where_it_can_be(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, LOG, truth=TRUTH)
    with opened(path) as (_, found):
        assert found.truth(path) == TRUTH
    content = path.read_bytes()
    path.write_bytes(content.replace(b'"arm"', b'"mra"'))
    with pytest.raises(
        LogError, match=rf"^{path}: the truth in the file's metadata cannot be read \(.+\)$"
    ):
        read_log(path)
    with path.open("rb") as stream:
        (index,) = make_reader(stream).get_summary().metadata_indexes  # type: ignore[union-attr]
    path.write_bytes(poked(content, index.offset + 9, "<I", 1 << 20))  # the length of its name
    found_log = read_log(path)
    assert found_log.origin.truth is None
    assert [(one.code, one.lossy) for one in found_log.notices] == [("DAMAGED_RECORD", False)]


def hiding_one_of_two(path: Path, others: int) -> None:
    """A file of small chunks, of which the summary hides the joints of one chunk that holds
    another channel too.
    """
    messages = messages_of(LOG)
    beside = [("/other", stamp, b"\0\1\0\0\7") for _, stamp, _ in messages[30 : 30 + others]]
    mixed = [*messages[:30], *beside, *messages[30:]]
    write_mcap(
        path,
        mixed,
        {"/other": ("a/msg/B", "ros2msg", b"int8 x")} if others else None,
        chunk_size=2000,
    )


def test_a_summary_that_hides_the_joints_of_a_chunk_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    hiding_one_of_two(path, 20)
    shared = [chunk for chunk in chunks_of(path) if len(chunk.message_index_offsets) == 2]
    assert shared

    def hide(records: Records) -> Records:
        (statistics,) = (one for one in records if isinstance(one, Statistics))
        for chunk in (one for one in records if isinstance(one, ChunkIndex)):
            if len(chunk.message_index_offsets) == 2:
                places = sorted([*chunk.message_index_offsets.values(), _end_of(chunk)])
                start = chunk.message_index_offsets.pop(1)
                statistics.channel_message_counts[1] -= (
                    places[places.index(start) + 1] - start - 15
                ) // 16
        return records

    path.write_bytes(summarised(path.read_bytes(), hide))
    found = read_log(path)
    assert same(found, LOG)
    assert [notice.code for notice in found.notices] == ["DAMAGED_SUMMARY"]
    assert "does not list what stands at byte" in found.notices[0].text


def _end_of(chunk: ChunkIndex) -> int:
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length


@pytest.mark.parametrize("code", [3, 4])
def test_a_definition_in_a_chunk_of_others_that_changes_the_joints_ends_them(
    code: int, tmp_path: Path
) -> None:
    """The chunk holds no message of the joints, so its index does not name them."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=100, compression=CompressionType.NONE, enable_crcs=False)
        writer.start()
        one = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
        writer.register_channel(TOPIC, "cdr", one)
        for row, (_, stamp, data) in enumerate(messages_of(LOG)):
            if row == 50:
                other = writer.register_schema("a/msg/B", "ros2msg", b"int8 x")
                writer.add_message(
                    writer.register_channel("/other", "cdr", other), stamp, b"\0\1\0\0\7", stamp
                )
            writer.add_message(1, stamp, data, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    content = path.read_bytes()
    assert [set(chunk.message_index_offsets) for chunk in chunks_of(path)] == [{1}] * 50 + [{2}] + [
        {1}
    ] * 70
    place = next(
        place for place in range(content.index(b"/other") - 200, len(content))
        if content[place] == code and content[place + 9 : place + 11] == b"\2\0"
    )  # fmt: skip
    path.write_bytes(poked(content, place + 9, "<H", 1))
    found = read_log(path)
    assert same(found, LOG.part(0, 50))
    told = {notice.code: notice.text for notice in found.notices if notice.lossy}
    assert "defined anew and differently" in told["DAMAGED_CHUNK"]
    assert "70 messages are missing" in told["DAMAGED_CHUNK"]
