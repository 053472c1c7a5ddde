"""The command line: one file a command; errors become one line and an exit code in one place."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType
from typing import TYPE_CHECKING

from algid.exits import Exit

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

SELDOM = (20_000, 20, 20)
"""Thresholds of Python's search for cycles: its own let a short command search for a seventh of its
time through what it has imported."""
PATIENCE = 5.0  # s to clear up in after a signal, before a second one is heard
AGAIN = 0.02  # s after which a signal comes again that an import put off or a callback swallowed


def main() -> None:
    """Run algid; the entry point of the console script."""
    if sys.platform == "win32":
        print("algid: it runs on Linux and macOS; on Windows, run it in WSL", file=sys.stderr)
        sys.exit(Exit.USAGE)
    from algid.cli.streams import harden_streams
    from algid.runtime import bound_by_environment, ending_signals

    gc.set_threshold(*SELDOM)
    stopping = _Stopping()
    for number in ending_signals():
        signal.signal(number, stopping)
    sys.unraisablehook = stopping.swallowed
    harden_streams()
    bound_by_environment()  # before anything loads numpy
    try:
        code = run(sys.argv[1:])
    finally:
        gc.freeze()  # else the interpreter's end searches all that was imported for cycles
    if code:
        sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run a command and return its exit code: the outermost place, where errors become lines.

    Raises
    ------
    SystemExit
        As the command ends by itself with an exit code of its own.
    _StoppedError
        If a signal stops it.
    KeyboardInterrupt
        If a signal stops a caller that hears signals by itself.
    """
    from algid.cli.output import complain, remark
    from algid.errors import AlgidError
    from algid.faults import TRACEBACK, fault
    from algid.runtime import check_environment

    try:
        try:
            check_environment()
            from algid.cli.app import called

            called(arguments)(list(arguments))
        finally:
            sys.stdout.flush()  # else a full disk is told by the interpreter, in its words
        return 0
    except BaseException as error:  # whatever a library raises, a panic too
        if (stop := _stop_behind(error)) is not None:
            _let_go(error)
            complain("stopped; nothing half-written is left")
            raise stop from None
        if isinstance(error, SystemExit | KeyboardInterrupt):
            raise
        if isinstance(error, AlgidError):
            line, code = str(error), int(Exit.USAGE)
        else:
            line, code = fault(error)
        cause = error
    if os.environ.get(TRACEBACK) == "1":
        import traceback

        remark("".join(traceback.format_exception(cause)))
    complain(line)
    return code


def _stop_behind(error: BaseException) -> _StoppedError | None:
    """The stop that an exception stands for, or None.

    A signal that comes while a library is imported, or reads, may be wrapped in its exception:
    Python 3.11 turns what is raised as a class is made into a RuntimeError.
    """
    return next((one for one in _behind(error) if isinstance(one, _StoppedError)), None)


def _behind(error: BaseException) -> list[BaseException]:
    """An exception, and those that it was raised in place of."""
    found: list[BaseException] = []
    behind: BaseException | None = error
    while behind is not None and behind not in found:
        found.append(behind)
        behind = behind.__cause__ or behind.__context__
    return found


def _let_go(error: BaseException) -> None:
    """End what was begun in the frames of an exception, and what no ``with`` had taken over yet.

    A signal may come when a context has been entered, and before its exit is known.
    """
    from traceback import clear_frames

    for one in _behind(error):
        clear_frames(one.__traceback__)


class _Stopping:
    """Leave by an exception, so that what is half-written is taken away.

    What comes meanwhile has to wait. So has a signal that comes while Python imports, whose locks
    an exception would leave taken: another thread would wait for them for ever.
    """

    def __init__(self) -> None:
        self._patient_until = 0.0
        self._put_off: int | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self._put_off is not None and number == signal.SIGALRM:
            number, self._put_off = self._put_off, None
        now = time.monotonic()
        if now < self._patient_until:
            return
        if _imports(frame):
            self._again(number)
            return
        self._patient_until = now + PATIENCE
        raise _StoppedError(number)

    def swallowed(self, what: UnraisableHookArgs) -> None:
        """Hear a signal again that came where no exception leaves.

        That is in a destructor, or in a function that a library written in C calls.
        """
        if not isinstance(what.exc_value, _StoppedError):
            sys.__unraisablehook__(what)
            return
        self._patient_until = 0.0
        self._again(what.exc_value.number)

    def _again(self, number: int) -> None:
        """Hear the signal once more, by the clock: a thread to send it may need an import."""
        self._put_off = number
        signal.signal(signal.SIGALRM, self)  # which may have been ignored
        signal.setitimer(signal.ITIMER_REAL, AGAIN)


def _imports(frame: FrameType | None) -> bool:
    """Whether a frame is one of Python's imports, or called by one."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


class _StoppedError(SystemExit):
    """A signal ends algid. typer passes it on, but turns `KeyboardInterrupt` into a silent exit."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number
