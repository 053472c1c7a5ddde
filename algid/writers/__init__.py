"""Writers of logs: one file a format, each `write(path, blocks, truth=…)`, whole files only."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from algid.base.errors import OutputError, SettingError
from algid.log import Log, Truth, add, word_sum

UNITS = {"theta": "rad", "q_des": "rad", "tau": "N m"}
"""What a file states of its channels, so that a profile of the log it was made of is not applied
again without a word."""
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
        The arm and the payload behind a synthetic log, which is written beside its samples; by
        default the log's own.
    format : 'mcap', 'parquet' or 'csv'
        Format; that of `path`'s suffix by default.
    force : bool
        Replace a file that is there, also one that another process has written meanwhile.

    Raises
    ------
    SettingError
        If `path` is none.
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
    if not isinstance(path, str | Path):
        raise SettingError(
            f"write_log: expected a path, then a log; found {type(path).__name__} first"
        )
    path = Path(path)
    name = format or path.suffix.lstrip(".").lower()
    if name not in FORMATS:
        raise OutputError(f"{path}: expected a log of {', '.join(FORMATS)}, found {name!r:.60}")
    if isinstance(log, Log):
        truth, log = truth or log.origin.truth, [log]
    import_module(f"algid.writers.{name}").write(path, log, truth=truth, force=force)


def columns(block: Log, sums: dict[str, int]) -> dict[str, NDArray[Any]]:
    """Columns (N,) by canonical name, ``t`` in s first and ``stamp_ns`` last.

    The sums of their words are added to `sums`, in place.
    """
    by_name: dict[str, NDArray[Any]] = {"t": block.stamp_ns / 1e9}
    pairs = {"theta": block.theta, "tau": block.tau, "omega": block.omega, "q_des": block.reference}
    for name, pair in pairs.items():
        if pair is not None:
            by_name |= {f"{name}1": pair[0], f"{name}2": pair[1]}
    by_name["stamp_ns"] = block.stamp_ns
    for name, values in by_name.items():
        sums[name] = add(sums.get(name, 0), word_sum(values))
    return by_name
