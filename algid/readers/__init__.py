"""Readers of logs: one file a format, behind the `TableReader` of `algid.readers.assemble`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from algid.faults import during
from algid.log import Log

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.assemble import TableReader


def open_log(path: str | Path, profile: Profile | None = None) -> TableReader:
    """Open a log of any format, known from its content; its samples are read by `TableReader.blocks`.

    Parameters
    ----------
    path : str or Path
        A CSV (also compressed), Parquet, MCAP, Feather, NumPy, MATLAB or ROS 1 bag file, or a rosbag2 folder.
    profile : Profile, optional
        What the log's names, units and signs mean, where the log does not tell.

    Raises
    ------
    LogError
        If there is no such log, its format is unknown, it is damaged, or it lacks a channel.
    """
    from algid.profile import Profile

    with during("opening", path):
        return _opened(Path(path), profile or Profile())


def _opened(path: Path, profile: Profile) -> TableReader:
    """As `open_log`, by the kind of log that its content shows."""
    from algid.readers.sniff import sniff

    kind = sniff(path)
    if kind == "mcap":
        from algid.readers.mcap import open_mcap

        return open_mcap([path], profile)
    if kind == "rosbag2":
        from algid.readers.bags.folder import bag_files
        from algid.readers.mcap import open_mcap

        bag = bag_files(path)
        if bag.kind == "mcap":
            reader = open_mcap(bag.paths, profile)
            return replace(reader, notices=(*bag.notices, *reader.notices))
    if kind == "parquet":
        from algid.readers.parquet import open_parquet

        return open_parquet(path, profile)
    if kind.startswith("csv"):
        from algid.readers.csv import open_csv

        return open_csv(path, profile, kind)
    if kind == "feather":
        from algid.readers.feather import open_feather

        return open_feather(path, profile)
    if kind in ("npz", "npy", "mat"):
        from algid.readers.arrays import open_arrays

        return open_arrays(path, kind, profile)
    from algid.readers.bags import open_bag

    return open_bag(path, kind, profile)


def read_log(path: str | Path, profile: Profile | None = None) -> Log:
    """Read a whole log: see `open_log`.

    Parameters
    ----------
    path : str or Path
        A file of any format that algid reads, or a rosbag2 folder.
    profile : Profile, optional
        What the log's names, units and signs mean, where the log does not tell.

    Returns
    -------
    Log
        Its samples in SI units, and in `notices` what its user should know.

    Raises
    ------
    LogError
        As `open_log`, and if a value is not finite or time runs wrong.
    """
    return open_log(path, profile).whole()
