"""Readers of logs: one file a format, behind the `TableReader` of `algid.readers.log_reader`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.faults import during
from algid.log import Log

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.log_reader import TableReader
    from algid.readers.memory import FrameOrArrays


def open_log(path: str | Path | FrameOrArrays, profile: Profile | None = None) -> TableReader:
    """Open a log of any format, known from its content.

    Its samples are read by `TableReader.blocks`.

    Parameters
    ----------
    path : str, Path or columns
        A CSV (also compressed), Parquet, MCAP, Feather, NumPy, MATLAB or ROS 1 bag file, or a
        rosbag2 folder; or a pandas or polars frame, or a dict of arrays, as `algid.readers.memory`
        takes them.
    profile : Profile, optional
        What the log's names, units and signs mean, where the log does not tell.

    Raises
    ------
    LogError
        If there is no such log, its format is unknown, it is damaged, or it lacks a channel.
    """
    from algid.profile import Profile
    from algid.readers.memory import NAME

    known = profile or Profile()
    with during("opening", path if isinstance(path, str | Path) else NAME):
        if known.torque_file is None:
            return _open_one(path, known)
        from algid.readers.two_files import open_with_torque_file

        return open_with_torque_file(path, known, _open_one)


def _open_one(path: str | Path | FrameOrArrays, profile: Profile) -> TableReader:
    """Open a log that stands in one file, or in memory."""
    from algid.readers.flat import offer_table, open_offered
    from algid.readers.table_cells import TableFile

    if isinstance(path, str | Path):
        from algid.readers.formats import open_file

        found = open_file(Path(path), profile)
        if not isinstance(found, TableFile):
            from algid.readers.messages.offer import offer_messages

            return open_offered(str(path), offer_messages(found, profile), profile)
    else:
        from algid.readers.memory import NAME, open_columns

        found, path = open_columns(path), NAME
    return open_offered(str(path), offer_table(found, profile), profile)


def read_log(path: str | Path | FrameOrArrays, profile: Profile | None = None) -> Log:
    """Read a whole log into memory: see `algid.read_log`, and `open_log` for its errors."""
    return open_log(path, profile).whole()
