"""What goes wrong outside algid: files, settings, results of another make.

Every message names the file or setting, the place, what was expected, what was found and what to do.
A caller's mistake is a `ValueError`; numerics that fail on one window are a status, not an exception.
"""

from __future__ import annotations

from collections.abc import Iterator

LONGEST_TEXT = 2000  # characters
LONGEST_CHAIN = 100


class AlgidError(Exception):
    """Base of every error that the user of the command line can mend. Exit code 2."""


class LogError(AlgidError):
    """A log cannot be read, or does not hold what was asked of it."""


class SettingError(AlgidError):
    """A flag, a profile, a case or an arm file is wrong."""


class ResultError(AlgidError):
    """A result file cannot be read, or comes from another schema version."""


class OutputError(AlgidError):
    """A file cannot be written where it was asked for."""


def text_of(error: BaseException) -> str:
    """What an exception says, cut to `LONGEST_TEXT`; with its type where algid did not raise it.

    Exceptions are anybody's: one that cannot even be printed is named by its type.
    """
    try:
        text = str(error)[:LONGEST_TEXT]
    except BaseException:  # its own fault, whatever it is
        return type(error).__name__
    return text if isinstance(error, AlgidError) else f"{type(error).__name__}: {text}"


def chain_of(error: BaseException) -> Iterator[BaseException]:
    """An exception and what it came from, each once: chains may be circles, and as long as a program runs."""
    seen: set[int] = set()
    following: BaseException | None = error
    while following is not None and id(following) not in seen and len(seen) < LONGEST_CHAIN:
        seen.add(id(following))
        yield following
        following = following.__cause__ or following.__context__
