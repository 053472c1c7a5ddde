"""rosbag2's SQLite files: the table of messages, read row by row in the order of recording.

Only real tables are read, never a view, nor by an index: a view may run for ever, an index may
leave rows out. What a query may do is bounded by the size of the file, since pages of a database
may point to each other in circles.
"""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from algid.errors import LogError
from algid.limits import LIMITS
from algid.notices import Notice
from algid.readers.messages.batch import MessageBatch, Messages
from algid.readers.messages.source import MessageChannel, Source
from algid.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION

_BATCH_BYTES, _BATCH_ROWS = 1 << 21, 1 << 14
_PAD = 8
"""Bytes before the first message, which decoders want to have there."""
_STEPS = 10_000
"""Steps of SQLite's machine between two looks at how many they are."""
_NEEDED = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
_WAL = 2
"""In a database's header: what is written stands in a file of its own at first."""


@dataclass(frozen=True)
class Contents:
    """A database's channels, message counts and time span, and messages without a channel."""

    channels: dict[int, MessageChannel]
    counts: dict[int, int]
    span_ns: tuple[int, int] | None
    strays: int


Databases = dict[tuple[Path, int, int], Contents]
"""Contents by path, size and time of change: several passes go over a log."""


@contextmanager
def database_messages(path: Path, known: Databases | None = None) -> Iterator[SqliteSource]:
    """The messages of a SQLite file of rosbag2.

    Raises
    ------
    LogError
        If the file is damaged, or holds no messages as rosbag2 writes them.
    """
    status = path.stat()
    key = (path, status.st_size, status.st_mtime_ns)
    with _telling(path), closing(_connected(path, status.st_size)) as base:
        contents = None if known is None else known.get(key)
        if contents is None:
            contents = _contents(path, base)
            if known is not None:
                known[key] = contents
        yield SqliteSource(path, status.st_size, base, contents)


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """What SQLite says against a file becomes a `LogError`."""
    try:
        yield
    except (sqlite3.Error, sqlite3.Warning, OverflowError, UnicodeDecodeError) as error:
        reason = str(error).split("\n", maxsplit=1)[0][:200]
        if reason == "interrupted":
            reason = "it asks for more steps than any database of its size"
        raise LogError(
            f"{path}: the bag cannot be read ({reason}); copy it again, or record it anew"
        ) from error


def _connected(path: Path, size: int) -> sqlite3.Connection:
    """A connection that writes nothing, and whose queries end."""
    beside = [path.with_name(f"{path.name}{suffix}") for suffix in ("-wal", "-journal")]
    unfinished = any(one.exists() and one.stat().st_size for one in beside)
    base = sqlite3.connect(
        f"{path.absolute().as_uri()}?{'mode=ro' if unfinished else 'immutable=1'}",
        uri=True,
        check_same_thread=False,
    )
    base.text_factory = lambda text: text.decode("utf-8", errors="replace")
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LIMITS.message_bytes)
    base.execute("PRAGMA trusted_schema = OFF")
    looks = (LIMITS.free_sqlite_steps + LIMITS.sqlite_steps_a_byte * size) // _STEPS
    # in C, so that no exception of a signal's handler is raised where SQLite would lose it
    ending = itertools.chain(itertools.repeat(0, looks), itertools.repeat(1))
    base.set_progress_handler(ending.__next__, _STEPS)
    return base


def _contents(path: Path, base: sqlite3.Connection) -> Contents:
    """What the tables tell.

    Raises
    ------
    LogError
        If one of them is not there, or is none.
    """
    for table, needed in _NEEDED.items():
        _check_table(path, base, table, needed)
    columns = _columns(base, "topics")
    encoding = "serialization_format" if "serialization_format" in columns else "'cdr'"
    rows = base.execute(
        f"SELECT id, name, type, {encoding} FROM topics NOT INDEXED LIMIT {LIMITS.bag_topics + 1}"
    )
    topics = rows.fetchall()
    if len(topics) > LIMITS.bag_topics:
        raise LogError(f"{path}: more than {LIMITS.bag_topics} topics; expected a bag of rosbag2")
    definitions = _definitions(path, base)
    channels = {}
    for number, name, kind, encoding in topics:
        if isinstance(number, int):
            channels[number] = _channel(str(name), str(kind), str(encoding), definitions)
    each = "".join(f", TOTAL(topic_id IS {number})" for number in channels)
    query = f"SELECT COUNT(*), MIN(timestamp), MAX(timestamp){each} FROM messages NOT INDEXED"
    rows, first, last, *sums = base.execute(query).fetchone()
    counts = dict(zip(channels, map(int, sums), strict=True))
    span = (first, last) if type(first) is type(last) is int else None
    return Contents(channels, counts, span, rows - sum(counts.values()))


def _check_table(path: Path, base: sqlite3.Connection, table: str, needed: set[str]) -> None:
    row = base.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)).fetchone()
    if row is None or row[0] != "table" or not str(row[1]).upper().startswith("CREATE TABLE"):
        there = "no such table" if row is None else f"a {row[0]} in its place"
        raise LogError(
            f"{path}: expected the table {table!r} of a rosbag2 file, found {there}; record it anew"
        )
    columns = _columns(base, table)
    wrong = [name for name in sorted(needed) if not columns.get(name)]
    if wrong:
        text = f"expected a plain column {wrong[0]!r} in the table {table!r} of a rosbag2 file"
        raise LogError(f"{path}: {text}; found {', '.join(columns)}; record it anew")


def _columns(base: sqlite3.Connection, table: str) -> dict[str, bool]:
    """The columns of a table, and whether each is stored as it is, not computed."""
    rows = base.execute(f"PRAGMA table_xinfo({table})").fetchmany(LIMITS.columns)
    columns = {}
    for _, name, _, _, _, _, hidden in rows:
        columns[str(name)] = hidden == 0
    return columns


def _definitions(path: Path, base: sqlite3.Connection) -> dict[str, tuple[str, bytes]]:
    """Encoding and text of each type's definition, if the file holds them (newer rosbag2)."""
    if not base.execute(
        "SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'"
    ).fetchone():
        return {}
    _check_table(
        path, base, "message_definitions", {"topic_type", "encoding", "encoded_message_definition"}
    )
    query = (
        "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions NOT "
        "INDEXED"
    )
    definitions = {}
    for kind, encoding, text in itertools.islice(base.execute(query), LIMITS.bag_topics):
        if text:
            definitions[str(kind)] = str(encoding), str(text).encode()
    return definitions


def _channel(
    topic: str, kind: str, encoding: str, definitions: dict[str, tuple[str, bytes]]
) -> MessageChannel:
    """A topic with the definition of its messages: the file's own, or that of every ROS 2."""
    own = definitions.get(kind) or usual_definition(kind)
    return MessageChannel(topic, kind, encoding, *own)


def usual_definition(kind: str) -> tuple[str, bytes]:
    """Encoding and text of the definition of a type that every ROS 2 knows.

    Nothing where it is not known here.
    """
    if kind == JOINT_STATE:
        return "ros2msg", JOINT_STATE_DEFINITION.encode()
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        return "", b""
    store = get_typestore(Stores.LATEST)
    if kind not in store.types:
        return "", b""
    return "ros2msg", store.generate_msgdef(kind, ros_version=2)[0].encode()


class SqliteSource(Source):
    """The messages of a database that is open."""

    def __init__(self, path: Path, size: int, base: sqlite3.Connection, contents: Contents) -> None:
        self.path = str(path)
        self.channels, self.counts, self.span_ns = (
            contents.channels,
            contents.counts,
            contents.span_ns,
        )
        self.notices = _said_of(contents.strays)
        self.damage: list[str] = []
        self._base = base
        self._left = LIMITS.free_work + LIMITS.work_a_byte * size

    def works(self, steps: int) -> bool:
        """Count steps of some microsecond each.

        False where no honest file of this size asks for so many.
        """
        self._left -= steps
        return self._left >= 0

    def batches(self, channels: frozenset[int]) -> Iterator[MessageBatch]:
        """The messages of `channels` as they were recorded.

        At the end those rows that hold none, as one lost part.

        Raises
        ------
        LogError
            Where there are more messages than a file of this size can hold.
        """
        numbers = ",".join(map(str, sorted(channels)))
        query = (
            f"SELECT timestamp, data FROM messages NOT INDEXED WHERE topic_id IN ({numbers}) "
            "ORDER BY rowid"
        )
        stamps: list[int] = []
        payloads: list[bytes] = []
        size = odd = 0
        wrong: object = None
        for stamp, data in self._base.execute(query):
            if not (type(stamp) is int and type(data) is bytes):
                odd += 1
                wrong = stamp if type(stamp) is not int else data
                continue
            stamps.append(stamp)
            payloads.append(data)
            size += len(data)
            if size > _BATCH_BYTES or len(stamps) == _BATCH_ROWS:
                if not self.works(len(stamps) // 2):
                    raise LogError(
                        f"{self.path}: more messages than in any honest file of its size; copy it "
                        "again"
                    )
                yield MessageBatch(_gathered(stamps, payloads), checked=True)
                stamps, payloads, size = [], [], 0
        if stamps:
            yield MessageBatch(_gathered(stamps, payloads), checked=True)
        if odd:
            text = f"{_shown(wrong)} for a time or a message in the table 'messages'"
            yield MessageBatch(None, checked=True, reason=text, lost=odd, what="row")


def _said_of(strays: int) -> list[Notice]:
    if not strays:
        return []
    return [Notice("STRAY_MESSAGES", numbers={"count": strays}, lossy=True)]


def _gathered(stamps: list[int], payloads: list[bytes]) -> Messages:
    sizes = np.fromiter(map(len, payloads), np.int64, len(payloads))
    ends = _PAD + np.cumsum(sizes)
    content = np.frombuffer(b"".join([bytes(_PAD), *payloads]), np.uint8)
    return Messages(content, ends - sizes, sizes, np.array(stamps, np.int64))


def _shown(value: Any) -> str:
    return "nothing" if value is None else repr(value)[:40]
