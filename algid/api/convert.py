"""A log in Python, read and written, or in another format under algid's own names and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from algid import writers
from algid.api import Answer
from algid.api.options import LogOptions, ProfileLike, meant, verb
from algid.base.errors import exit_of
from algid.notices import Notice, Remedy, lossy
from algid.settings import DEFAULTS, OF_BOTH

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.log import Log
    from algid.readers.memory import FrameOrArrays


@verb
def convert(
    source: str | Path,
    out: str | Path,
    *,
    profile: ProfileLike | None = None,
    force: bool = False,
    progress: Progress | None = None,
    **options: Unpack[LogOptions],
) -> list[Notice]:
    """Write a log in another format, in SI units, with canonical names.

    A synthetic one keeps its truth. What is said of the arm and its driver, `gravity`, `effort` and
    `velocity`, no log holds: give it again where the file is used.

    Parameters
    ----------
    source : path
        The log to read.
    out : path
        The log to write: .mcap, .parquet or .csv.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what names and units mean.
    force : bool
        Replace what is there.
    progress : callable
        Called as samples are written.
    **options : settings of `Profile` by their names

    Returns
    -------
    list of Notice
        What was noticed in the log.

    Raises
    ------
    OutputError
        If no format has the suffix of `out`, or it cannot be written.
    LogError
        If the log cannot be read.
    SettingError
        If a setting is not known or wrong.

    Examples
    --------
    $ algid convert rosbag2_2026/ -o arm.parquet --joints shoulder,elbow --zero hanging

    >>> import tempfile
    >>> import algid
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = algid.synthesise("case1", out=folder, format="csv")
    ...     algid.convert(f"{folder}/case1-unloaded.csv", f"{folder}/arm.parquet")
    []
    """
    from algid.readers import open_log

    own = meant(profile, options)
    reader = open_log(source, own)
    notices: list[Notice] = []
    said = {} if own is None else own.model_dump(include={*OF_BOTH})
    # what samples in SI units do not hold; a current is a torque by now
    nothing = None, "raw", "current"
    left = {name: one for name, one in said.items() if one not in (DEFAULTS[name], *nothing)}
    if left:
        numbers = {"case": "kept", "said": ", ".join(left)}
        again = Remedy(left, "where the file is used")
        notices.append(Notice("STATED_UNUSED", numbers=numbers, remedies=(again,)))

    def noted() -> Iterator[Log]:
        """The blocks; keeps their notices, and tells how far the writing has come."""
        done = 0
        for block in reader.blocks():
            notices.extend(block.notices)
            yield block
            done += len(block)
            if progress is not None:
                progress("writing", done, reader.rows)

    writers.write_log(out, noted(), truth=reader.origin.truth, force=force)
    return notices


def answer(notices: list[Notice], given: Mapping[str, Any]) -> Answer:
    """What was noticed, and the file; 4 where samples are missing."""
    remarks = [*map(str, notices), f"wrote {given['out']}"]
    return Answer(remarks=remarks, exit=exit_of(failed=False, lost=lossy(notices)))


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
