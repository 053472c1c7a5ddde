"""Writers of logs: one file a format, each `write(path, blocks, truth=…)`, whole files only."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from algid.base.errors import OutputError
from algid.log import Log, Truth

FORMATS = ("mcap", "parquet", "csv")


def write_log(
    path: str | Path,
    log: Log | Iterable[Log],
    *,
    truth: Truth | None = None,
    format: str | None = None,  # noqa: A002  # as the flag
    force: bool = True,
) -> None:
    """Write a log, or the blocks of one, whole or not at all.

    Parameters
    ----------
    path : str or Path
    log : Log, or the blocks of one in their order
    truth : Truth
        The arm and the payload behind a synthetic log, which is written beside its samples.
    format : 'mcap', 'parquet' or 'csv'
        Format; that of `path`'s suffix by default.
    force : bool
        Replace a file that is there, also one that another process has written meanwhile.

    Raises
    ------
    OutputError
        If the format is unknown, or the file cannot be written there, or exists and `force` is not
        set.

    Examples
    --------
    >>> import tempfile
    >>> import algid
    >>> log, _ = algid.synthesise("case1")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     algid.write_log(f"{folder}/log.parquet", log)
    ...     len(algid.read_log(f"{folder}/log.parquet"))
    1001
    """
    path = Path(path)
    name = format or path.suffix.lstrip(".").lower()
    if name not in FORMATS:
        raise OutputError(f"{path}: expected a log of {', '.join(FORMATS)}, found {name!r:.60}")
    blocks = [log] if isinstance(log, Log) else log
    import_module(f"algid.writers.{name}").write(path, blocks, truth=truth, force=force)
