"""What a file holds, by name: columns, or topics with their types; also of a file that cannot be used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

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
    from algid.readers.parquet import schema_of

    for name, kind in schema_of(path).items():
        yield Entry(name, str(kind))


def _csv(path: Path, kind: str) -> Iterator[Entry]:
    from algid.readers.csv import head_bytes
    from algid.readers.dialect import detect

    dialect = detect(path, head_bytes(path, kind))
    for name in dialect.columns:
        yield Entry(name, "whole numbers" if name in dialect.whole else "text or numbers")
