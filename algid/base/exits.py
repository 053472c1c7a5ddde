"""How commands end: the one table of exit codes, from which help, README and guide are made."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum


class Exit(IntEnum):
    """An exit code."""

    OK = 0
    LIMIT = 1
    USAGE = 2
    FAILED = 3
    DATA_LOST = 4
    INTERNAL = 70
    STOPPED = 130


MEANINGS: Mapping[Exit, str] = {
    Exit.OK: "a result to use, good or with reservations",
    Exit.LIMIT: "a limit was exceeded: an error, a misfit, failed jobs of a batch",
    Exit.USAGE: "the call or a file is wrong; one line says what to do",
    Exit.FAILED: "failed, or some parameters not identifiable: do not use",
    Exit.DATA_LOST: "usable, but data were lost",
    Exit.INTERNAL: "a fault of algid",
    Exit.STOPPED: "stopped by a signal (128 + its number); nothing half-written is left",
}
WHAT_TO_DO: Mapping[Exit, str] = {
    Exit.OK: "go on",
    Exit.LIMIT: "alert",
    Exit.USAGE: "correct it, do not retry",
    Exit.FAILED: "read the verdict and the report",
    Exit.DATA_LOST: "go on, and check the recorder",
    Exit.INTERNAL: "report it",
    Exit.STOPPED: "retry",
}
_ALWAYS = (Exit.OK, Exit.USAGE)
OF_COMMAND: Mapping[str, tuple[Exit, ...]] = {
    "inspect": _ALWAYS + (Exit.FAILED, Exit.DATA_LOST),
    "design": _ALWAYS + (Exit.FAILED,),
    "identify": _ALWAYS + (Exit.FAILED, Exit.DATA_LOST),
    "validate": (Exit.OK, Exit.LIMIT, Exit.USAGE),
    "batch": (Exit.OK, Exit.LIMIT, Exit.USAGE, Exit.FAILED, Exit.DATA_LOST, Exit.STOPPED),
    "track": _ALWAYS + (Exit.FAILED, Exit.DATA_LOST),
    "convert": _ALWAYS + (Exit.DATA_LOST,),
}
"""The codes that a command ends with by itself; any other command ends with `OK` or `USAGE`."""


def exit_of(*, failed: bool, lost: bool) -> Exit:
    """How a command ends whose result has `failed`, or from whose logs data are lost."""
    if failed:
        return Exit.FAILED
    if lost:
        return Exit.DATA_LOST
    return Exit.OK


def epilog(command: str) -> str:
    """The codes of a command as its help ends with them."""
    codes = OF_COMMAND.get(command, _ALWAYS)
    return "Exit codes: " + "; ".join(f"{int(code)} {MEANINGS[code]}" for code in codes) + "."
