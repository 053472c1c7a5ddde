"""The guard: a command runs in a child, and what breaks a library there ends in one line.

The child is forked before any library is imported, bounded in memory, and dies with its parent. It
tells through a pipe which file it reads and what it has under construction, so that the parent can
name the one and remove the other, however the child ends. A worker of a batch is guarded alike by
the process that has started it. Whoever imports algid has no guard.
"""

from __future__ import annotations

import os
import resource
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from algid.base.errors import Exit

SILENCE = 10.0  # s of processor time within which reading hands on a sample
BYTES_A_SECOND = 10_000_000  # of a file's size, for which reading has one second more
SHARE = 0.9  # of the machine's memory
PATIENCE = 1.0  # s in which a second signal is the first one's echo: `timeout` sends two
STOPPED = "stopped; nothing half-written is left"
TRACEBACK = "ALGID_TRACEBACK"
"""A variable of the environment: set to 1, it shows where an error came from."""

_ENDING = tuple(
    getattr(signal, f"SIG{name}")
    for name in ["HUP", "INT", "QUIT", "TERM", "USR1", "USR2", "ALRM", "XCPU"]
)
BREAKING = tuple(
    getattr(signal, f"SIG{name}") for name in ["SEGV", "BUS", "FPE", "ILL", "ABRT", "TRAP"]
)
_READING = {
    signal.SIGKILL: "it was killed, as a system out of memory does",
    signal.SIGPROF: f"no sample came within {SILENCE:g} s of processor time",
}
_PR_SET_PDEATHSIG = 1  # of linux/prctl.h

_tell: Callable[[str], object] | None = None
_allowances: list[float] = []  # s of processor time for each file that is being read


def tell(note: str) -> None:
    """Send a note, as `Notes.take` takes it, to whoever guards this process."""
    if _tell is not None:
        _tell(note)


@contextmanager
def reading(path: str) -> Iterator[None]:
    """A file is read within the block, which ends as soon as a sample is handed on.

    Processor time without one is bounded: libraries that unpack or sort a file as a whole need the
    more of it the larger the file is.
    """
    if _tell is None:
        yield
        return
    size = 0
    with suppress(OSError, ValueError):  # reading will say why
        for file in (Path(path), *Path(path).glob("*")):
            size += file.stat().st_size
    allowance = SILENCE + size / BYTES_A_SECOND
    tell(f"<{path}")
    _allowances.append(allowance)
    try:
        signal.setitimer(signal.ITIMER_PROF, max(_allowances))
        yield
    finally:
        _allowances.remove(allowance)
        signal.setitimer(signal.ITIMER_PROF, max(_allowances, default=0.0))
        tell(f">{path}")


def delete(place: Path) -> None:
    """Delete a file, a link or a folder, as far as it goes."""
    shutil.rmtree(place, ignore_errors=True)
    with suppress(OSError):
        place.unlink()


class Notes:
    """What a guarded process reads and has under construction, as it tells."""

    def __init__(self) -> None:
        self.reading: list[str] = []
        self.making: list[str] = []

    def take(self, note: str) -> None:
        """Take ``<FILE`` and ``>FILE`` round reading, ``+PATH`` and ``-PATH`` round making."""
        held = self.reading if note[0] in "<>" else self.making
        (held.append if note[0] in "<+" else held.remove)(note[1:])

    def remove_unfinished(self) -> None:
        """Remove what a process that is gone had under construction."""
        for place in self.making:
            delete(Path(place))

    def end(self, number: int) -> tuple[int, str]:
        """Exit code and line for a process that the signal of a number has ended."""
        name = signal.Signals(number).name
        if self.reading and number in (*_READING, *BREAKING):
            why = _READING.get(signal.Signals(number), f"a library broke on it ({name})")
            remedy = "look at the file, or write it anew in another format"
            return Exit.USAGE, f"while reading {self.reading[-1]}: {why}; {remedy}"
        if number in BREAKING:
            return Exit.INTERNAL, f"internal error: a library broke ({name}); report it"
        return 128 + number, STOPPED


def begin(send: Callable[[str], object], parent: int, memory: int | None = None) -> None:
    """Start the life of a guarded process.

    Parameters
    ----------
    send : callable
        Takes notes to the process that guards this one.
    parent : int
        That process's number; this one dies with it.
    memory : bytes of data, which are `SHARE` of the machine's by default
    """
    global _tell  # a process has one guard
    _tell = send
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent too, which decides
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    # data, not address space: allocators and threads reserve far more addresses than they use
    with suppress(ValueError):  # the process has a lower bound already
        resource.setrlimit(resource.RLIMIT_DATA, (memory or int(SHARE * _memory()), hard))
    if os.environ.get(TRACEBACK) != "1":  # a library that breaks has lines of its own
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it has died before
            os._exit(128 + signal.SIGKILL)
    else:
        threading.Thread(target=_die_with, args=(parent,), daemon=True).start()


def _memory() -> float:
    """Bytes of memory that this machine, or the container on it, has."""
    sizes = [float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))]
    for file in ("memory.max", "memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):  # ValueError: max
            sizes.append(float(Path("/sys/fs/cgroup", file).read_text()))
    return min(sizes)


def _die_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.1)
    os.kill(os.getpid(), signal.SIGKILL)


def supervise(command: Callable[[], int]) -> tuple[int, str | None]:
    """Run a command in a child.

    Parameters
    ----------
    command : callable
        Gives its exit code; called in the child, where this returns what it gives.

    Returns
    -------
    int
        The exit code: the command's own, or as `Notes.end` has it.
    str or None
        What to say of a child that ended otherwise.
    """
    listening, telling = os.pipe()
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(listening)
        begin(lambda note: os.write(telling, os.fsencode(note) + b"\0"), parent)
        return command(), None
    os.close(telling)
    stops: list[tuple[int, float]] = []

    def stop(number: int, _frame: FrameType | None) -> None:
        stops.append((number, time.monotonic()))
        with suppress(ProcessLookupError):
            if len(stops) == 1:
                os.kill(child, signal.SIGTERM)
            elif stops[-1][1] - stops[0][1] > PATIENCE:
                os.kill(child, signal.SIGKILL)

    for number in _ENDING:  # nohup has a process ignore SIGHUP
        if number in (signal.SIGINT, signal.SIGTERM) or not signal.getsignal(number):
            signal.signal(number, stop)
    notes, rest = Notes(), b""
    while content := os.read(listening, 1 << 16):
        *told, rest = (rest + content).split(b"\0")
        for note in told:
            notes.take(os.fsdecode(note))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code >= 0:
        return 128 + stops[0][0] if stops and code == Exit.STOPPED else code, None
    notes.remove_unfinished()
    return (128 + stops[0][0], STOPPED) if stops else notes.end(-code)
