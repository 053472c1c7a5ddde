"""What goes wrong outside algid: files, settings, results of another make.

Every message names the file or setting, the place, what was expected, what was found and what to do.
A caller's mistake is a `ValueError`; numerics that fail on one window are a status, not an exception.
"""


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
