"""The command line: a guarded process that runs the application."""

from __future__ import annotations

import gc
import sys
import warnings

from algid.base.errors import Exit

SELDOM = (20_000, 20, 20)
"""Thresholds of Python's search for cycles: its own let a short command search for a seventh of its
time through what it has imported."""


def main() -> None:
    """Run algid, guarded; the entry point of the console script."""
    if sys.platform == "win32":
        print("algid: it runs on Linux and macOS; on Windows, run it in WSL", file=sys.stderr)
        sys.exit(Exit.USAGE)
    from algid.cli.output import clear_line, complain, harden_streams
    from algid.guard import supervise

    harden_streams()
    code, broken = supervise(_command)
    if broken is not None:
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
    from algid.cli.app import run

    try:
        return run(sys.argv[1:])
    finally:
        gc.freeze()  # else the interpreter's end searches all that was imported for cycles
