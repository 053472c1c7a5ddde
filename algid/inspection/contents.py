"""What a file holds, by name: columns, or topics with their types; also of a file that cannot be used."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from algid.errors import LogError
from algid.readers.sniff import sniff


@dataclass(frozen=True)
class Entry:
    """A column or a topic: its name, its type, and how many samples it has where that is known."""

    name: str
    type: str
    count: int | None = None


def contents(path: Path) -> tuple[str, tuple[Entry, ...]]:
    """Format and entries of a log.

    Raises
    ------
    LogError
        If there is no such log, or not even its list of entries can be read.
    """
    kind = sniff(path)
    if kind == "mcap":
        return kind, tuple(_topics(path))
    if kind == "rosbag2":
        from algid.readers.rosbag2 import bag_files

        bag = bag_files(path)
        return kind, tuple(_topics(bag.paths[0])) if bag.kind == "mcap" else ()
    if kind == "parquet":
        return kind, tuple(_parquet(path))
    if kind.startswith("csv"):
        return kind, tuple(_csv(path, kind))
    return kind, ()


def _topics(path: Path) -> Iterator[Entry]:
    from algid.readers.mcap import opened
    from algid.readers.mcap.catalogue import schema_name

    with opened(path) as (_, found):
        for number, channel in sorted(found.channels.items()):
            told = f"{schema_name(found, channel) or 'no schema'}, {channel.message_encoding}"
            count = None if found.counts is None else found.counts.get(number, 0)
            yield Entry(channel.topic, told, count)


def _parquet(path: Path) -> Iterator[Entry]:
    from algid.readers.parquet import counted_rows, schema_of

    rows = _known(lambda: counted_rows(path))
    for name, kind in schema_of(path).items():
        yield Entry(name, str(kind), rows)


def _csv(path: Path, kind: str) -> Iterator[Entry]:
    from algid.readers.csv import counted_rows, head_bytes
    from algid.readers.dialect import detect, kinds

    head = head_bytes(path, kind)
    dialect = detect(path, head)
    rows = _known(lambda: counted_rows(path, kind, dialect))
    for name, told in kinds(path, head, dialect).items():
        yield Entry(name, told, rows)


def _known(count: Callable[[], int]) -> int | None:
    """What can be counted; None in a damaged file, of which reading will tell more."""
    try:
        return count()
    except LogError:
        return None
