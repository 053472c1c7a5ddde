"""The command line: one file a command; errors become one line and an exit code in one place."""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Sequence

from algid.base.exits import Exit

SELDOM = (20_000, 20, 20)
"""Thresholds of Python's search for cycles: its own let a short command search for a seventh of its
time through what it has imported."""


def main() -> None:
    """Run algid, guarded; the entry point of the console script."""
    if sys.platform == "win32":
        print("algid: it runs on Linux and macOS; on Windows, run it in WSL", file=sys.stderr)
        sys.exit(Exit.USAGE)
    from algid.cli.streams import harden_streams
    from algid.guard import supervise

    harden_streams()
    code, broken = supervise(_command)
    if broken is not None:
        from algid.cli.output import clear_line, complain

        clear_line()
        complain(broken)
    if code:
        sys.exit(code)


def _command() -> int:
    """Run the command of this process's arguments."""
    from algid.base.runtime import bound_by_environment

    gc.set_threshold(*SELDOM)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # of libraries, about each other
    bound_by_environment()  # before anything loads numpy
    try:
        return run(sys.argv[1:])
    finally:
        gc.freeze()  # else the interpreter's end searches all that was imported for cycles


def run(arguments: Sequence[str]) -> int:
    """Run a command and return its exit code: the outermost place, where errors become lines.

    Raises
    ------
    SystemExit
        As the command ends by itself with an exit code of its own.
    KeyboardInterrupt
        If a caller without a guard is stopped.
    """
    from click import UsageError

    from algid.base.errors import AlgidError
    from algid.base.faults import fault
    from algid.cli import app
    from algid.cli.output import complain, remark
    from algid.guard import TRACEBACK
    from algid.moved import refuse_moved

    try:
        try:
            refuse_moved(arguments)
            return app.called(arguments)
        finally:
            sys.stdout.flush()  # else a full disk is told by the interpreter, in its words
    except (SystemExit, KeyboardInterrupt):
        raise
    except BaseException as error:  # whatever a library raises, a panic too
        line, code = fault(error)
        if isinstance(error, AlgidError | UsageError):
            line, code = str(error), Exit.USAGE
        if isinstance(error, UsageError):
            more = "" if error.ctx is None else f"; {error.ctx.command_path} --help lists all"
            line = error.format_message().rstrip(".?") + more
        cause = error
    if os.environ.get(TRACEBACK) == "1":
        import traceback

        remark("".join(traceback.format_exception(cause)))
    complain(line)
    return code
