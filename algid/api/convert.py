"""A log in another format, under algid's own names and units."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.api.choices import written
from algid.api.options import meaning
from algid.errors import OutputError
from algid.files import refuse_existing

if TYPE_CHECKING:
    from algid.api.options import ProfileLike
    from algid.log import Log
    from algid.notices import Notice
    from algid.progress import Progress


def convert(
    source: str | Path,
    out: str | Path,
    *,
    profile: ProfileLike | None = None,
    force: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> list[Notice]:
    """Write a log in another format, in SI units, with canonical names.

    A synthetic one keeps its truth.

    Parameters
    ----------
    source : path
        The log to read.
    out : path
        The log to write: .mcap, .parquet or .csv.
    profile : Profile, path of one, or dict of what would stand in its file
    force : bool
        Replace a file that is there.
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
    >>> import tempfile
    >>> import algid
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = algid.synthesise("case1", out=folder, kind="csv")
    ...     algid.convert(f"{folder}/case1-unloaded.csv", f"{folder}/arm.parquet")
    []
    """
    from algid.readers import open_log
    from algid.writers import FORMATS, write_log

    target = Path(out)
    if target.suffix.lstrip(".").lower() not in FORMATS:
        raise OutputError(f"{target}: expected a name that ends in {', '.join(written())}")
    refuse_existing(target, force)
    reader = open_log(source, meaning(profile, options))
    notices: list[Notice] = []

    def noted() -> Iterator[Log]:
        """The blocks; keeps their notices, and tells how far the writing has come."""
        done = 0
        for block in reader.blocks():
            notices.extend(block.notices)
            yield block
            done += len(block)
            if progress is not None:
                progress("writing", done, reader.rows)

    write_log(target, noted(), truth=reader.origin.truth, force=force)
    return notices
