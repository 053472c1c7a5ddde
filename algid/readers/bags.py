"""ROS 1 bags through rosbags; rosbag2's SQLite files by themselves, or in their folder.

rosbags passes over the rows of a `-wal` file beside a database: SQLite itself reads those.
"""

from __future__ import annotations

import re
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.base.errors import LogError
from algid.base.files import read_text
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.notices import Notice
from algid.readers.mcap import mcap_file
from algid.readers.messages.message_file import MessageChannel, MessageFile, Messages
from algid.readers.messages.offer import MessageLog
from algid.readers.table import as_log_error

if TYPE_CHECKING:
    import sqlite3

_BATCH_BYTES, _BATCH_ROWS = 1 << 21, 1 << 14
_NAME_AND_NUMBER = re.compile(r"(.*?)(?:_(\d+))?$")


def open_messages(path: Path, kind: str) -> MessageLog:
    """An MCAP file ("mcap"), a ROS 1 bag ("bag"), a file ("db3") or folder ("rosbag2") of rosbag2.

    Raises
    ------
    LogError
        If none of a folder's files is there, or its metadata cannot be read.
    """
    paths, kinds = [path], [kind]
    notices: tuple[Notice, ...] = ()
    if kind == "rosbag2":  # which may mix them
        paths, notices = _files_of_folder(path)
        kinds = [one.suffix[1:] for one in paths]
    readers = {"mcap": mcap_file, "bag": ros1_file}
    files = []
    for one, own in zip(paths, kinds, strict=True):
        files.append(cache(partial(readers.get(own, database_file), one)))
    return MessageLog("mcap" if kinds[0] == "mcap" else "bag", files, notices)


def _files_of_folder(folder: Path) -> tuple[list[Path], tuple[Notice, ...]]:
    """The files of a rosbag2 folder in their order, and what is to be said of those missing."""
    metadata = folder / "metadata.yaml"
    if metadata.is_file():
        from ruamel.yaml import YAML  # of rosbags

        try:
            text = read_text(metadata)
            stated = YAML(typ="safe").load(text)["rosbag2_bagfile_information"]
            names = [Path(str(name)).name for name in stated["relative_file_paths"]]
        except Exception as error:  # what the library raises, and what is not there
            raise LogError(
                f"{metadata}: expected the metadata of a rosbag2 folder with relative_file_paths "
                f"({type(error).__name__}: {str(error).partition(chr(10))[0][:80]}); without that "
                "file the folder's numbered files are read"
            ) from error
        if (mode := str(stated.get("compression_mode") or "NONE")).upper() != "NONE":
            raise LogError(
                f"{folder}: the bag was compressed by rosbag2 (compression_mode {mode}), "
                "unreadable; write it anew with ros2 bag convert and storage compression (mcap, "
                "zstd chunks)"
            )
    else:
        parts = []
        for one in [*folder.glob("*.mcap"), *folder.glob("*.db3")]:
            if match := _NAME_AND_NUMBER.match(one.stem):
                parts.append((int(match[2] or 0), one.name, match[1]))
        names = [name for _, name, _ in sorted(parts)]
        if len({stem for *_, stem in parts}) > 1:
            raise LogError(
                f"{folder}: {', '.join(names[:3])}: not the numbered parts of one bag, and no "
                "metadata.yaml lists them; read each for itself"
            )
    there = [folder / name for name in names if (folder / name).is_file()]
    if not there:
        wanted = ", ".join(names[:3]) or "metadata.yaml, *.mcap or *.db3"
        raise LogError(f"{folder}: no file of a rosbag2 folder is there; expected {wanted}")
    missing = [name for name in names if folder / name not in there]
    numbers = {"missing": len(missing), "files": len(names), "names": ", ".join(missing[:3])}
    notices = (Notice("DAMAGED", numbers={"case": "split"} | numbers),) if missing else ()
    return there, notices


def ros1_file(path: Path) -> MessageFile:
    """A ROS 1 bag with an index.

    Raises
    ------
    LogError
        If its index is missing or damaged.
    """
    from rosbags.rosbag1 import Reader
    from rosbags.typesys.msg import denormalize_msgtype

    reader, mend = Reader(path), f"rosbag reindex {path.name} may mend it, else copy it again"
    with as_log_error("bag", mend):
        reader.open()
        if not all(chunk.connection_counts for chunk in reader.chunk_infos):
            reader.close()
            raise LogError(f"the bag's index has a chunk without messages; {mend}")
    channels, counts = {}, Counter[int]()
    for one in reader.connections:
        definition = one.msgdef.data.encode()
        kind = denormalize_msgtype(one.msgtype)
        channels[one.id] = MessageChannel(one.topic, kind, "ros1", "ros1msg", definition)
    for chunk in reader.chunk_infos:
        counts.update(chunk.connection_counts)
    # rosbags has the end behind the last message
    span = (reader.start_time, reader.end_time - 1) if counts.total() else None

    def rows(wanted: frozenset[int]) -> Iterator[tuple[int, bytes]]:
        chosen = [one for one in reader.connections if one.id in wanted]
        for _, stamp, data in reader.messages(chosen) if chosen else ():
            yield stamp, data

    file = MessageFile(str(path), channels, partial(_batches, rows), counts, span)
    weakref.finalize(file, reader.close)  # its index is read once for all passes
    return file


def database_file(path: Path) -> MessageFile:
    """A SQLite file of rosbag2.

    Raises
    ------
    LogError
        If it is damaged, or holds no tables as rosbag2 writes them.
    """
    with as_log_error("SQLite"), _connected(path) as base:
        query = "SELECT name FROM sqlite_master WHERE type = 'table'"  # a view may run for ever
        tables = {str(name) for (name,) in base.execute(query)}
        for needed in sorted({"messages", "topics"} - tables):
            raise LogError(f"no table {needed!r}; expected a SQLite file of rosbag2")
        own: dict[str, tuple[str, bytes]] = {}
        if "message_definitions" in tables:  # newer rosbag2
            query = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            own = {kind: (form, text.encode()) for kind, form, text in base.execute(query) if text}
        channels = {}
        query = "SELECT id, name, type, serialization_format FROM topics"
        for number, name, kind, encoding in base.execute(query):
            definition = own.get(kind) or usual_definition(kind)
            channels[int(number)] = MessageChannel(name, kind, encoding, *definition)
        # in one pass: GROUP BY would sort the rows
        each = "".join(f", TOTAL(topic_id IS {number})" for number in channels)
        query = f"SELECT COUNT(*), MIN(timestamp), MAX(timestamp){each} FROM messages"
        total, first, last, *sums = base.execute(query).fetchone()
    counts = dict(zip(channels, map(int, sums), strict=True))
    strays = total - sum(counts.values())
    stray = Notice("MESSAGES_LEFT_OUT", numbers={"case": "topic", "count": strays})
    span = (first, last) if type(first) is type(last) is int else None

    def rows(wanted: frozenset[int]) -> Iterator[tuple[int, bytes]]:
        numbers = ",".join(map(str, sorted(wanted)))
        with _connected(path) as base:
            yield from base.execute(
                f"SELECT timestamp, data FROM messages WHERE topic_id IN ({numbers}) "
                "AND typeof(timestamp) = 'integer' AND typeof(data) = 'blob' ORDER BY rowid"
            )

    notices = (stray,) if strays else ()
    return MessageFile(str(path), channels, partial(_batches, rows), counts, span, notices)


@contextmanager
def _connected(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection that writes nothing, not even beside the file where nothing is unfinished."""
    import sqlite3

    beside = [path.with_name(f"{path.name}{suffix}") for suffix in ("-wal", "-journal")]
    unfinished = any(one.exists() and one.stat().st_size for one in beside)
    place = f"{path.absolute().as_uri()}?{'mode=ro' if unfinished else 'immutable=1'}"
    with closing(sqlite3.connect(place, uri=True, check_same_thread=False)) as base:
        yield base


def usual_definition(kind: str) -> tuple[str, bytes]:
    """Encoding and text of the definition of a type that every ROS 2 knows, else nothing."""
    if kind == JOINT_STATE:
        return "ros2msg", JOINT_STATE_DEFINITION.encode()
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    if kind not in store.types:
        return "", b""
    return "ros2msg", store.generate_msgdef(kind, ros_version=2)[0].encode()


def _batches(
    rows: Callable[[frozenset[int]], Iterator[tuple[int, bytes]]], channels: frozenset[int]
) -> Iterator[Messages | str]:
    """Messages by their stamps and payloads up to the first break, and why it breaks."""
    stamps, payloads, size = list[int](), list[bytes](), 0
    broken = ""
    try:
        for stamp, payload in rows(channels):
            stamps.append(stamp)
            payloads.append(payload)
            size += len(payload)
            if size > _BATCH_BYTES or len(stamps) == _BATCH_ROWS:
                yield Messages.of(payloads, np.array(stamps, np.int64))
                stamps, payloads, size = [], [], 0
    except Exception as error:  # rosbags raises what its parts do
        reason = (str(error) or type(error).__name__).partition("\n")[0][:200]
        broken = f"{reason}; of what follows nothing is read"
    yield Messages.of(payloads, np.array(stamps, np.int64))
    if broken:
        yield broken
