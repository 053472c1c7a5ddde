"""What goes wrong outside algid: files, settings, results of another make.

Every message names the file or setting, the place, what was expected, what was found and what to
do. A caller's mistake is a `ValueError`; numerics that fail on one window are a status, not an
exception.
"""

from __future__ import annotations

import re

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
