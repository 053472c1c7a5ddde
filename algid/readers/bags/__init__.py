"""ROS 1 bags, and rosbag2's SQLite files by themselves or in their folder.

Their messages are read by columns.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from algid.readers.assemble import TableReader
from algid.readers.bags.folder import bag_files
from algid.readers.messages.reader import Opener, open_messages

if TYPE_CHECKING:
    from algid.notices import Notice
    from algid.profile import Profile


def open_bag(path: Path, kind: str, profile: Profile | None = None) -> TableReader:
    """Open a ROS 1 bag ("bag"), a SQLite file of rosbag2 ("db3"), or a folder of these ("rosbag2").

    Raises
    ------
    LogError
        If the bag is damaged, or no topic holds the joint states of two joints.
    """
    parts, said = parts_of(path, kind)
    return open_messages(str(path), "bag", parts, profile, said)


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
