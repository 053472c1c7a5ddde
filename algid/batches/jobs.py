"""What a batch is made of: a job is the logs of one arm on one occasion."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated

from pydantic import BeforeValidator, Field

from algid.base.errors import without_credentials
from algid.base.limits import LIMITS

Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
"""What a column of the table can hold."""
Label = str | Finite | Int64 | bool
Time = Annotated[str, BeforeValidator(lambda cell: utc_of(str(cell)).isoformat())]
TABLE = "jobs.parquet"
"""The table of all jobs, in OUT."""
_TAKEN = (".algid", ".json")
"""Of results and records: as folders they would lie in one another."""


@dataclass(frozen=True)
class Job:
    """One identification of a batch.

    Parameters
    ----------
    name : str
        Unique in the batch; the result folder is ``OUT/NAME.algid``, so that it may hold slashes.
    logs, loaded : paths or URLs of the logs without and with payload
    profile : path of a profile, or None for the batch's
    robot : str or None
    time : ISO 8601 or None, when the logs were taken, where their stamps do not tell
    labels : anything else that is known, such as ``payload`` in kg
    trouble : str or None, why it cannot be run
    """

    name: str
    logs: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    profile: str | None = None
    robot: str | None = None
    time: Time | None = None
    labels: Mapping[str, Label] = field(default_factory=dict)
    trouble: str | None = None


def name_fault(name: str) -> str | None:
    """Why no result and no record of that name can lie in OUT beside all others.

    None where they can.
    """
    parts = name.split("/")
    for part in parts:
        odd = not part.isprintable() or part.startswith(".") or "\\" in part
        if odd or not 0 < len(part.encode(errors="surrogatepass")) <= 200:
            return "expected parts of 1 to 200 printable characters, none starting with a dot"
    if len(name.encode()) > LIMITS.name_bytes:
        return f"expected at most {LIMITS.name_bytes} bytes"
    if parts[0] == TABLE or any(part.lower().endswith(_TAKEN) for part in parts[:-1]):
        return f"expected no folder that is {TABLE} or ends in {' or '.join(_TAKEN)}: algid's own"
    return None


def safe_name(name: str) -> str:
    """A name that can stand for one that cannot: what is readable of it, and a hash."""
    content = name.encode(errors="surrogatepass")
    readable = "".join(
        letter if letter.isalnum() or letter in "-_. " else "%" for letter in name[:40]
    )
    return f"%{readable}~{hashlib.sha256(content).hexdigest()[:8]}"


def redacted_path(path: str) -> str:
    """A path or URL to print and keep: without credentials, in letters that any file can hold."""
    return (
        without_credentials(path).encode(errors="surrogateescape").decode(errors="backslashreplace")
    )


def utc_of(text: str) -> datetime:
    """A time in ISO 8601 as one in UTC, which it is where it says nothing else.

    Raises
    ------
    ValueError
        If it is none, or none that stamps in int64 nanoseconds can name: from 1970 to 2261.
    """
    with suppress(ValueError, OverflowError):
        taken = datetime.fromisoformat(text)
        taken = taken.replace(tzinfo=taken.tzinfo or UTC).astimezone(UTC)
        if 1970 <= taken.year <= 2261:
            return taken
    raise ValueError("expected ISO 8601 like 2026-01-31T12:00:00Z, from 1970 to 2261")
