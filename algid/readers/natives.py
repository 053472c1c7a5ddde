"""Errors of C++ and Rust libraries on a damaged file, raised as a `LogError` at the call."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from algid.errors import LogError

_LONGEST = 200


@contextmanager
def natively(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever is raised within the block about the file of a `kind` into a `LogError`.

    A panic of polars is no Exception. What the user stops is passed on.

    Raises
    ------
    LogError
        If anything is raised within.
    """
    from polars.exceptions import PanicException

    try:
        yield
    except LogError:
        raise
    except (Exception, PanicException) as error:
        reason = str(error).split("\n", maxsplit=1)[0][:_LONGEST]
        raise LogError(
            f"{path}: the {kind} file cannot be read ({type(error).__name__}: {reason})"
        ) from error
