"""MCAP files whose records lie: lengths, definitions, overlapping chunks, summaries."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable
from functools import cache
from io import BytesIO

import zstandard
from mcap.writer import CompressionType, IndexType

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log
from pipelines.hostile import Hostile
from pipelines.mutations import clean_log, joint_states, write_topics

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, DATA_END = 3, 4, 5, 6, 7, 15
TOPIC = b"/joint_states"
NUMBERS = (
    0,
    1,
    21,
    22,
    39,
    255,
    65535,
    1 << 24,
    1 << 28,
    1 << 31,
    1 << 40,
    (1 << 63) - 1,
    1 << 63,
    (1 << 64) - 1,
)
_CHANCE = 0.5


@cache
def log_of_records() -> Log:
    """What the files hold."""
    return clean_log(200)


class Record:
    """A record: code, content, and the length it claims."""

    def __init__(self, code: int, body: bytes) -> None:
        self.code, self.body, self.claims = code, body, len(body)

    def bytes(self) -> bytes:
        return struct.pack("<BQ", self.code, self.claims & (1 << 64) - 1) + self.body


def split(content: bytes) -> list[Record]:
    """The records of sound bytes."""
    found, place = [], 0
    while place < len(content):
        code, length = struct.unpack_from("<BQ", content, place)
        found.append(Record(code, content[place + 9 : place + 9 + length]))
        place += 9 + length
    return found


def written(draw: random.Random) -> bytes:
    """A sound file, written in one of the ways that there are."""
    log, stream = log_of_records(), BytesIO()
    indexes = (IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE)
    options = ("use_chunking", "use_statistics", "enable_crcs", "repeat_channels", "repeat_schemas")
    others = [(stamp, b"\0\1\0\0\7") for stamp in log.stamp_ns.tolist()[::7]]
    write_topics(
        stream,
        [
            joint_states(log),
            ("/other", "cdr", "std_msgs/msg/Int8", "ros2msg", b"int8 data", others),
        ],
        chunk_size=draw.choice((1, 2000, 8000, 1 << 20)),
        compression=draw.choice(list(CompressionType)),
        index_types=draw.choice(indexes),
        **{option: draw.random() < 0.8 for option in options},
    )
    return stream.getvalue()


def lying(draw: random.Random) -> Hostile:
    """A file of which something lies."""
    content = written(draw)
    records = split(content[len(MAGIC) : -len(MAGIC)])
    kind, strict = "sound", True
    for _ in range(draw.choice((1, 1, 2))):
        edit = draw.choice(_EDITS)
        chunks = [place for place, record in enumerate(records) if record.code == CHUNK]
        if chunks and draw.random() < _CHANCE:
            strict &= _within(records[draw.choice(chunks)], edit, draw)
        else:
            strict &= edit(records, draw)
        kind = edit.__name__.strip("_")
    body = b"".join(record.bytes() for record in records)
    tail = MAGIC if draw.random() < _CHANCE else b""
    return Hostile(".mcap", MAGIC + body + tail, kind, log_of_records() if strict else None)


def _within(
    chunk: Record, edit: Callable[[list[Record], random.Random], bool], draw: random.Random
) -> bool:
    """Edit the records of a chunk, and pack it anew with a checksum that is right,
    wrong or none.
    """
    if len(chunk.body) < 40:  # a record that the edit before has called a chunk
        return True
    start, end, _, crc, name_length = struct.unpack_from("<QQQII", chunk.body)
    name = chunk.body[32 : 32 + name_length]
    packed = chunk.body[40 + name_length :]
    try:
        if name == b"lz4":
            import lz4.frame

            content = lz4.frame.decompress(packed)
        else:
            content = zstandard.decompress(packed) if name else packed
        records = split(content)
    except (zstandard.ZstdError, RuntimeError, struct.error):  # spoilt by the edit before
        return True
    if not records:
        return True
    strict = edit(records, draw)
    content = b"".join(record.bytes() for record in records)
    crc = draw.choice((zlib.crc32(content), zlib.crc32(content), crc, 0))
    size = draw.choice((len(content), len(content), len(content), *NUMBERS))
    packed = zstandard.compress(content)
    chunk.body = (
        struct.pack("<QQQII", start, end, size, crc, 4)
        + b"zstd"
        + struct.pack("<Q", len(packed))
        + packed
    )
    chunk.claims = len(chunk.body)
    return strict


def _lengths(records: list[Record], draw: random.Random) -> bool:
    record = draw.choice(records)
    record.claims = draw.choice(
        (*NUMBERS, record.claims + draw.randrange(-40, 40), record.claims * 2)
    )
    return record.code not in (1, 9, 10, 12, 13)


def _redefined(records: list[Record], draw: random.Random) -> bool:
    def text(content: bytes) -> bytes:
        return struct.pack("<I", len(content)) + content

    if draw.random() < _CHANCE:
        data = draw.choice((b"float64[] effort", b"", JOINT_STATE_DEFINITION.encode()))
        head = struct.pack("<H", draw.choice((1, 2, 7))) + text(JOINT_STATE.encode())
        made = Record(SCHEMA, head + text(b"ros2msg") + text(data))
    else:
        head = struct.pack("<HH", draw.choice((1, 2, 3, 0)), draw.choice((1, 2, 9, 0)))
        topic, encoding = draw.choice((b"/other", TOPIC, b"")), draw.choice((b"cdr", b"jso"))
        made = Record(CHANNEL, head + text(topic) + text(encoding) + struct.pack("<I", 0))
    records.insert(draw.randrange(len(records)), made)
    return True


def _repeated(records: list[Record], draw: random.Random) -> bool:
    records.insert(draw.randrange(len(records)), draw.choice(records))
    return True


def _garbage(records: list[Record], draw: random.Random) -> bool:
    record = Record(
        draw.choice((0, 2, 5, 6, 7, 8, 15, 16, 77, 137, 255)),
        draw.randbytes(draw.choice((0, 1, 22, 100, 5000))),
    )
    record.claims = draw.choice((record.claims, *NUMBERS))
    records.insert(draw.randrange(len(records)), record)
    return False


def _dropped(records: list[Record], draw: random.Random) -> bool:
    del records[draw.randrange(len(records))]
    records[:] = records or [Record(DATA_END, bytes(4))]
    return False


def _moved(records: list[Record], draw: random.Random) -> bool:
    records.insert(draw.randrange(len(records)), records.pop(draw.randrange(len(records))))
    return False


def _numbers(records: list[Record], draw: random.Random) -> bool:
    record = draw.choice(records)
    width = draw.choice((2, 4, 8))
    if len(record.body) >= width:
        place = draw.choice((0, 0, 2, 4, 6, 8, 16, 24, 32, draw.randrange(len(record.body)))) % (
            len(record.body) - width + 1
        )
        number = draw.choice(NUMBERS) & (1 << 8 * width) - 1
        record.body = (
            record.body[:place] + number.to_bytes(width, "little") + record.body[place + width :]
        )
    return False


def _many(records: list[Record], draw: random.Random) -> bool:
    sizes = ((77, 0), (200, 0), (MESSAGE, 22), (CHUNK, 40), (INDEX, 6))
    code, size = draw.choice(sizes)
    small = Record(code, bytes(size))
    place = draw.randrange(len(records))
    records[place:place] = [small] * draw.choice((100, 3000, 30_000))
    return False


_EDITS = (
    _lengths,
    _lengths,
    _lengths,
    _redefined,
    _repeated,
    _garbage,
    _dropped,
    _moved,
    _numbers,
    _many,
)
