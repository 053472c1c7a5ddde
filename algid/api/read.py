"""A log in Python: read into memory, and written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from algid import writers
from algid.api.options import LogOptions, ProfileLike, meant, verb

if TYPE_CHECKING:
    from algid.log import Log
    from algid.readers.memory import FrameOrArrays

write_log = verb(writers.write_log)


def read_log(
    path: str | Path | FrameOrArrays,
    profile: ProfileLike | None = None,
    **options: Unpack[LogOptions],
) -> Log:
    """Read a whole log into memory.

    Parameters
    ----------
    path : str, Path or columns
        A file of any format that algid reads, or a rosbag2 folder; or a pandas or polars frame, or
        a dict of arrays.
    profile : Profile, path of one, or dict of what would stand in its file
        What the log's names, units and signs mean, where the log does not tell.
    **options : settings of `Profile` by their names
        As ``zero="hanging"``.

    Returns
    -------
    Log
        Its samples in SI units, and in `notices` what its user should know.

    Raises
    ------
    LogError
        If there is no such log, its format is unknown, it is damaged, or it lacks a channel; if a
        value is not finite or time runs wrong.
    SettingError
        If a setting is not known or wrong.

    Examples
    --------
    >>> import algid
    >>> t = [0.0, 0.01, 0.02, 0.03]
    >>> columns = {"t": t, "theta": [[0.0, 0.1, 0.2, 0.3], [0.0, 0.0, 0.1, 0.1]], "tau": [t, t]}
    >>> algid.read_log(columns, offsets=(1.0, 0.0)).theta[0].tolist()
    [1.0, 1.1, 1.2, 1.3]
    """
    from algid.readers import read_log as read

    return read(path, meant(profile, options))
