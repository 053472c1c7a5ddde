"""Readers of logs: one file a format, behind the `Reader` of `algid.readers.base`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.errors import LogError
from algid.log import Log

if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.base import Reader


def open_log(path: str | Path, profile: Profile | None = None) -> Reader:
    """Open a log of any format, told from its content; its samples are read by `Reader.blocks`.

    Parameters
    ----------
    path : str or Path
        A CSV (also compressed), Parquet or MCAP file, or a rosbag2 folder.
    profile : Profile, optional
        What the log's names, units and signs mean, where the log does not tell.

    Raises
    ------
    LogError
        If there is no such log, its format is unknown, it is damaged, or it lacks a channel.
    """
    from algid.readers.sniff import sniff

    path = Path(path)
    kind = sniff(path)
    if kind == "mcap":
        from algid.readers.mcap import open_mcap

        return open_mcap([path], profile)
    if kind == "parquet":
        from algid.readers.parquet import open_parquet

        return open_parquet(path, profile)
    if kind.startswith("csv"):
        from algid.readers.csv import open_csv

        return open_csv(path, profile, kind)
    raise LogError(f"{path}: {kind} logs cannot be read; convert it to MCAP, Parquet or CSV")


def read_log(path: str | Path, profile: Profile | None = None) -> Log:
    """Read a whole log: see `open_log`.

    Raises
    ------
    LogError
        As `open_log`, and if a value is not finite or time runs wrong.
    """
    return _joined(open_log(path, profile).blocks())


def _joined(blocks: Iterator[Log]) -> Log:
    """One log out of blocks, one channel at a time: two copies of the whole never stand side by side."""
    first = next(blocks)
    stamps, thetas, taus, notices = [first.stamp_ns], [first.theta], [first.tau], [first.notices]
    omegas = [first.omega] if first.omega is not None else []
    origin = first.origin
    del first
    for block in blocks:
        stamps.append(block.stamp_ns)
        thetas.append(block.theta)
        taus.append(block.tau)
        notices.append(block.notices)
        omegas += [block.omega] if block.omega is not None else []
        del block
    return Log(
        _one(stamps),
        _one(thetas),
        _one(taus),
        origin,
        _one(omegas) if omegas else None,
        tuple(notice for some in notices for notice in some),
    )


def _one(parts: list[Any]) -> Any:
    whole = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)
    parts.clear()
    return whole
