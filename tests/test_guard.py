"""The guard round a command: whatever breaks it is one line and an exit code, and nothing is left.

Each command here is a script that stands in for one of algid's and does what its first argument
says, reading a file or not.
"""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from algid.guard import Notes

ROOT = Path(__file__).parents[1]
SCRIPT = """
import contextlib, os, pathlib, signal, sys, time
import algid.cli, algid.cli.app, algid.guard
from algid.base.staging import staged
from algid.base.faults import during

def spin(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass

def deep():
    nested = []
    for _ in range(1_000_000):
        nested = [nested]
    sys.setrecursionlimit(1 << 30)
    repr(nested)

def hang_on(_number, _frame):
    os.write(1, b"heard\\n")  # print may be what it interrupts

def work(kind):
    if kind == "half":
        with staged(pathlib.Path("result"), pathlib.Path.mkdir) as temporary:
            (temporary / "part").write_text("x")
            print("making", flush=True)
            spin(60)
    if kind == "deaf":
        signal.signal(signal.SIGTERM, hang_on)
        print("making", flush=True)
        while True:
            time.sleep(60)
    if kind == "finishing":
        heard = []
        signal.signal(signal.SIGTERM, lambda *_: heard.append(1))
        print("making", flush=True)
        while not heard:
            time.sleep(0.01)
        print("finished")
        raise SystemExit(130)
    if kind == "terminal":
        print("half a line", end="", file=sys.stderr, flush=True)
        os.abort()
    if kind == "says":
        os.write(2, b"terminate called after throwing\\n")
        os.abort()
    if kind == "segv":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "memory":
        bytearray(600 << 20)
    if kind == "stack":
        deep()
    if kind == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "spin":
        spin(60)
    if kind == "three":
        raise SystemExit(3)

def command(words):
    for _ in range(3 if words[0] == "samples" else 1):
        with during("reading", words[1]) if len(words) > 1 else contextlib.nullcontext():
            spin(0.3) if words[0] == "samples" else work(words[0])
    spin(1.0) if words[0] == "samples" else None
    return 0

algid.guard.SILENCE = float(os.environ.get("SILENCE", "10"))
algid.cli.app.app.main = lambda words, *_, **__: command(words)
algid.cli.main()
"""
FORMAT = "; look at the file, or write it anew in another format\n"


def command(*words: str, limit: str = "true") -> list[str]:
    """The command line of the script, in a shell that has set a limit."""
    return ["sh", "-c", f'{limit}; exec "$0" -c "$@"', sys.executable, SCRIPT, *words]


def environment(**more: str) -> Mapping[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


def ended(*words: str, limit: str = "true", **more: str) -> tuple[int, str]:
    """Exit code and standard error of the script."""
    done = subprocess.run(
        command(*words, limit=limit),
        capture_output=True,
        text=True,
        env=environment(**more),
        timeout=120,
        check=False,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        ("segv", "a library broke on it (SIGSEGV)"),
        ("says", "a library broke on it (SIGABRT)"),
        ("stack", "a library broke on it (SIGSEGV)"),
        ("killed", "it was killed, as a system out of memory does"),
    ],
)
def test_what_breaks_a_library_on_a_file_is_one_line_that_names_it(kind: str, why: str) -> None:
    assert ended(kind, "a/log.csv") == (2, f"algid: while reading a/log.csv: {why}{FORMAT}")


@pytest.mark.parametrize(
    ("kind", "code", "line"),
    [
        ("segv", 70, "internal error: a library broke (SIGSEGV); report it"),
        ("stack", 70, "internal error: a library broke (SIGSEGV); report it"),
        ("killed", 137, "stopped; nothing half-written is left"),
    ],
)
def test_what_breaks_while_no_file_is_read_names_none(kind: str, code: int, line: str) -> None:
    assert ended(kind) == (code, f"algid: {line}\n")


def test_a_command_that_ends_by_itself_keeps_its_exit_code() -> None:
    assert ended("three", "log.csv") == (3, "")
    assert ended("nothing") == (0, "")


@pytest.mark.skipif(sys.platform != "linux", reason="macOS bounds no process's memory")
def test_memory_is_bounded_by_the_machines_or_by_a_lower_limit() -> None:
    code, told = ended("memory", "log.csv", limit="ulimit -d 500000")
    assert code == 2
    assert told.startswith("algid: while reading log.csv: not enough memory (MemoryError")
    assert told.count("\n") == 1
    script = "import algid.guard as g, os, resource; g.begin(print, os.getppid()); "
    script += "print(resource.getrlimit(resource.RLIMIT_DATA)[0])"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, env=environment(), check=True
    )
    all_of_it = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < int(done.stdout) <= 0.9 * all_of_it


def test_reading_without_a_sample_ends_and_each_sample_counts() -> None:
    line = "no sample came within 10 s of processor time"
    told = f"algid: while reading log.csv: {line}{FORMAT}"
    assert ended("spin", "log.csv", SILENCE="0.5") == (2, told)
    assert ended("samples", "log.csv", SILENCE="0.5") == (0, "")


def test_a_large_file_has_more_time(tmp_path: Path) -> None:
    for place in (tmp_path / "large.npz", tmp_path / "bag/part.db3"):
        place.parent.mkdir(exist_ok=True)
        with place.open("wb") as file:
            file.truncate(20_000_000)
    for name in ("large.npz", "bag"):
        assert ended("samples", str(tmp_path / name), SILENCE="0.1") == (0, "")


def started(*words: str) -> subprocess.Popen[str]:
    """The script, once it has something under construction."""
    running = subprocess.Popen(
        command(*words),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
    )
    assert running.stdout.readline() == "making\n"
    return running


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1])
@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["process", "group"])
def test_a_signal_ends_a_command_at_once_and_leaves_nothing(
    number: signal.Signals,
    send: Callable[[int, int], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    running = started("half", "log.csv")
    assert len(list(tmp_path.iterdir())) == 1
    send(running.pid, number)
    _, told = running.communicate(timeout=30)
    assert told == "algid: stopped; nothing half-written is left\n"
    assert running.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []


def test_a_break_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    running = started("half", "log.csv")
    os.kill(child_of(running.pid), signal.SIGSEGV)
    running.communicate(timeout=30)
    assert running.returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_a_command_that_finishes_by_itself_ends_with_the_signals_code() -> None:
    running = started("finishing")
    running.send_signal(signal.SIGTERM)
    assert running.communicate(timeout=30) == ("finished\n", "")
    assert running.returncode == 143


def test_a_second_signal_kills_and_an_echo_of_the_first_does_not() -> None:
    running = started("deaf")
    running.send_signal(signal.SIGINT)
    running.send_signal(signal.SIGTERM)
    assert running.stdout.readline() == "heard\n"
    time.sleep(1.1)
    assert running.poll() is None
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=30)
    assert (running.returncode, told) == (130, "algid: stopped; nothing half-written is left\n")


def test_the_command_dies_with_the_process_that_was_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    running = started("half", "log.csv")
    child = child_of(running.pid)
    running.kill()
    running.communicate()
    until = time.monotonic() + 10
    while lives(child):
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_terminal_gets_its_cursor_and_a_blank_line_back() -> None:
    ours, theirs = pty.openpty()
    with subprocess.Popen(command("terminal"), stderr=theirs, env=environment()) as running:
        os.close(theirs)
        told = b""
        while not told.endswith(b"report it\r\n"):
            told += os.read(ours, 1000)
    os.close(ours)
    assert running.returncode == 70
    assert told.startswith(b"half a line\r\x1b[2Kalgid: internal error")


def child_of(pid: int) -> int:
    """The guarded child of a process."""
    listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, check=True)
    pairs = [map(int, line.split()) for line in listed.stdout.splitlines()]
    (found,) = [one for one, parent in pairs if parent == pid]
    return found


def lives(pid: int) -> bool:
    """Whether a process runs; one that is dead and not yet collected does not."""
    command = ["ps", "-o", "stat=", "-p", str(pid)]
    state = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    return bool(state) and not state.startswith("Z")


def test_notes_of_two_files_name_the_one_that_was_opened_last() -> None:
    notes = Notes()
    for note in ("<a.csv", "<b.csv", ">a.csv", "+/x", "-/x"):
        notes.take(note)
    assert (notes.reading, notes.making) == (["b.csv"], [])
    assert notes.end(signal.SIGABRT)[1].startswith("while reading b.csv: ")
