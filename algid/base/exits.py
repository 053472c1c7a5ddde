"""How commands end: the one table of exit codes, from which help, README and guide are made."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum


class Exit(IntEnum):
    """An exit code, what it means, and what whoever called does then."""

    meaning: str
    then: str

    def __new__(cls, code: int, meaning: str, then: str) -> Exit:
        """The code with its texts."""
        made = int.__new__(cls, code)
        made._value_, made.meaning, made.then = code, meaning, then
        return made

    OK = 0, "a result to use, good or with reservations", "go on"
    LIMIT = 1, "a limit was exceeded: an error, a misfit, failed jobs of a batch", "alert"
    USAGE = 2, "the call or a file is wrong; one line says what to do", "correct it, do not retry"
    FAILED = (
        3,
        "failed, or some parameters not identifiable: do not use",
        "read the verdict and the report",
    )
    DATA_LOST = 4, "usable, but data were lost", "go on, and check the recorder"
    INTERNAL = 70, "a fault of algid", "report it"
    STOPPED = 130, "stopped by a signal (128 + its number); nothing half-written is left", "retry"


OF_COMMAND: Mapping[str, tuple[int, ...]] = {
    "inspect": (0, 2, 3, 4),
    "design": (0, 2, 3),
    "identify": (0, 2, 3, 4),
    "validate": (0, 1, 2),
    "batch": (0, 1, 2, 3, 4, 130),
    "track": (0, 2, 3, 4),
    "convert": (0, 2, 4),
}
"""The codes that a command ends with by itself; any other command ends with 0 or 2."""


def exit_of(*, failed: bool, lost: bool) -> Exit:
    """How a command ends whose result has `failed`, or from whose logs data are lost."""
    if failed:
        return Exit.FAILED
    if lost:
        return Exit.DATA_LOST
    return Exit.OK


def epilog(command: str) -> str:
    """The codes of a command as its help ends with them."""
    codes = [one for one in Exit if one in OF_COMMAND.get(command, (0, 2))]
    return "Exit codes: " + "; ".join(f"{int(one)} {one.meaning}" for one in codes) + "."
