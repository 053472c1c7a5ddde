"""What ends a command that nobody foresaw: one line for its user, and an exit code.

An exception that a library raises about what it was given is reported with the file and the stage.
Any other is an error inside algid, and is called one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from algid.base.errors import AlgidError, Exit, LogError, text_of
from algid.guard import TRACEBACK, reading
from algid.options import flag

_OWN = str(Path(__file__).parents[1]) + os.sep
_MEANT = (AlgidError, SystemExit, KeyboardInterrupt, GeneratorExit)
"""Exceptions that are no faults."""
_LONGEST_REASON = 200


@contextmanager
def during(stage: str, file: object) -> Iterator[None]:
    """Note on an exception from within the block what was being done, and with which file.

    A `LogError` begins with the file's name then.

    Whoever guards the process knows meanwhile that the file is being read.

    Raises
    ------
    LogError
        If one is raised within.
    """
    try:
        with reading(str(file)):
            yield
    except LogError as error:
        named = f"{file}: ", f"{file}/", f"{str(file)!r}: "
        if not (error.is_named or str(error).startswith(named)):
            error.args = (f"{file}: {error}",)
        error.is_named = True
        raise
    except _MEANT:
        raise
    except BaseException as error:  # a panic in a library of Rust is no Exception
        error.add_note(f"while {stage} {file}")
        raise


def fault(error: BaseException) -> tuple[str, int]:
    """The line about an exception that is nobody's message, and the exit code that goes with it.

    Parameters
    ----------
    error : BaseException
        Neither an `AlgidError` nor what ends a program on purpose.

    Returns
    -------
    str
        What could not be done, why, and what to do.
    int
        `Exit.USAGE` where memory, the system or a library refused a file; `Exit.INTERNAL` where
        algid is wrong.
    """
    place = ""
    for note in getattr(error, "__notes__", []):
        if note.startswith("while "):
            place = f"{note}: "
            break
    reason = text_of(error).partition("\n")[0][:_LONGEST_REASON]
    trace = f"see where with {TRACEBACK}=1"
    if isinstance(error, MemoryError):
        cut = f"{flag('start')} and {flag('end')}"
        return f"{place}not enough memory ({reason}); cut the log with {cut}", Exit.USAGE
    if isinstance(error, OSError) and error.strerror:
        what = error.strerror
        if error.filename is not None:
            what = f"{error.filename}: {what}"
        return f"{place}{what}; mend that and run it again, or {trace}", Exit.USAGE
    if place and not _ours(error.__traceback__):
        remedy = "look at the file, or write it anew in another format"
        return f"{place}a library cannot take it ({reason}); {remedy}; {trace}", Exit.USAGE
    return (
        f"internal error: {place}{reason}; this is a fault of algid: report it, {trace}",
        Exit.INTERNAL,
    )


def _ours(trace: TracebackType | None) -> bool:
    """Whether it was algid's own line that raised."""
    last = None
    while trace is not None:
        last, trace = trace, trace.tb_next
    return last is None or last.tb_frame.f_code.co_filename.startswith(_OWN)
