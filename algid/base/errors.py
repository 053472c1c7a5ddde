"""How things end: what goes wrong outside algid, and the exit codes of its commands.

Every message names the file or setting, the place, what was expected, what was found and what to
do. A caller's mistake is a `ValueError`; numerics that fail on one window are a status, not an
exception. Help, README and guide are made from the one table of exit codes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import IntEnum

LONGEST_TEXT = 2000  # characters


# What stands before the @ of a URL; a slash in it should have been written %2F, and may
# not have been.
_USER = re.compile(
    r"\b([a-z][a-z0-9+.-]*)(:/{1,2})([^\s/?#]*@|[^\s/?#@]*:[^\s?#]*@)", re.IGNORECASE
)
_SECRET = re.compile(
    r"([?&][a-z_]*(?:secret|sig|key|password|token)[a-z_]*=)[^&\s]*", re.IGNORECASE
)


class AlgidError(Exception):
    """Base of every error that the user of the command line can mend. Exit code 2.

    Credentials in the URLs that its text names are left out.
    """

    def __init__(self, text: str = "") -> None:
        super().__init__(without_credentials(text))


class LogError(AlgidError):
    """A log cannot be read, or does not hold what was asked of it."""

    is_named = False
    """Whether the text begins with the log's name."""


class SettingError(AlgidError):
    """A flag, a profile, a case or an arm file is wrong."""


class ResultError(AlgidError):
    """A result file cannot be read, or comes from another schema version."""


class OutputError(AlgidError):
    """A file cannot be written where it was asked for."""


def without_credentials(text: str) -> str:
    """`text` with every URL of an object stripped of users' names, passwords and tokens.

    In Azure's URLs a name before the @ is the container's or the account's, and stays.
    """

    def kept(url: re.Match[str]) -> str:
        scheme, mark, user = url.groups()
        name = user.partition(":")[0].rstrip("@")
        if name and scheme.lower().startswith(("az", "abfs")):
            return f"{scheme}{mark}{name}@"
        return f"{scheme}{mark}"

    if ":/" not in text:
        return text
    return _SECRET.sub(r"\1", _USER.sub(kept, text))


def text_of(error: BaseException) -> str:
    """What an exception says, cut to `LONGEST_TEXT`; with its type where algid did not raise it.

    Exceptions are anybody's: one that cannot even be printed is named by its type.
    """
    try:
        text = without_credentials(str(error))[:LONGEST_TEXT]
    except BaseException:  # its own fault, whatever it is
        return type(error).__name__
    if isinstance(error, AlgidError):
        return text
    return f"{type(error).__name__}: {text}"


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
    "validate": (0, 1, 2, 4),
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
