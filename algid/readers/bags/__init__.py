"""ROS 1 bags, and rosbag2's SQLite files by themselves or in their folder.

Their messages are read by columns.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from algid.readers.bags.folder import bag_files
from algid.readers.messages.reader import MessageLog, Opener

if TYPE_CHECKING:
    from algid.notices import Notice


def open_bag(path: Path, kind: str) -> MessageLog:
    """A ROS 1 bag ("bag"), a SQLite file of rosbag2 ("db3"), or a folder ("rosbag2").

    Raises
    ------
    LogError
        If none of a folder's files is there.
    """
    if kind == "rosbag2" and (bag := bag_files(path)).kind == "mcap":
        from algid.readers.mcap import open_mcap

        return replace(open_mcap(bag.paths), notices=bag.notices)
    return MessageLog(str(path), "bag", *parts_of(path, kind))


def parts_of(path: Path, kind: str) -> tuple[list[Opener], tuple[Notice, ...]]:
    """What opens each file of a bag, and what is to be said of the whole."""
    from algid.readers.bags.ros1 import Bags, bag_messages
    from algid.readers.bags.sqlite import Databases, database_messages

    if kind == "bag":
        bags: Bags = {}
        return [partial(bag_messages, path, bags)], ()
    databases: Databases = {}
    if kind == "db3":
        return [partial(database_messages, path, databases)], ()
    bag = bag_files(path)
    return [partial(database_messages, one, databases) for one in bag.paths], bag.notices
