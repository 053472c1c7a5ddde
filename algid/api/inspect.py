"""Look at a log before anyone identifies anything."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from algid.api.given import meant
from algid.api.options import meaning

if TYPE_CHECKING:
    from algid.api.options import ProfileLike
    from algid.identification.source import LogLike
    from algid.inspection.report import Inspection
    from algid.report.document import Table


def inspect(log: LogLike, *, profile: ProfileLike | None = None, **options: Any) -> Inspection:
    """What a log holds, which channels would be used, and what is wrong with it.

    Parameters
    ----------
    log : path, `Log`, pandas or polars frame, or dict of arrays
    profile : Profile, path of one, or dict of what would stand in its file
    **options : settings of `Profile` by their names
        As ``zero="hanging"``.

    Returns
    -------
    Inspection
        Its `mapping`, figures of its clock and signals, `findings` and `notices`; of a log that
        would be refused what it holds, and why (`refused`).

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    SettingError
        If a setting is not known or wrong.

    Examples
    --------
    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=2.0, excitation="wide")
    >>> found = algid.inspect(log)
    >>> found.refused is None, found.clock.rows
    (True, 2001)
    """
    from algid.inspection.report import inspect_log

    own = meaning(profile, options)
    return inspect_log(meant(log, own), own)


def content(found: Inspection) -> Iterator[Table | str]:
    """Tables, and lines between them."""
    from algid.report.inspected import inspection_content

    return inspection_content(found)


def as_json(found: Inspection) -> str:
    """What was found, as the text of a JSON file."""
    return json.dumps(found.as_dict(), indent=2) + "\n"
