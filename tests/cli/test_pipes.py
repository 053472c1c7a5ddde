"""A pipe is no file: whatever option, argument or folder names one, a command says so at once
instead of waiting.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree

import click
import pytest

from algid.base.files import read_whole
from algid.base.limits import LIMITS
from algid.cli.app import COMMANDS, command
from tests.cli.commands import call

WRITTEN = {"out", "scratch", "write_profile"}
"""Options that name what is written, not what is read."""


@contextmanager
def soon(seconds: float = 60.0) -> Iterator[None]:
    """Break off what waits for ever."""

    def stop(*_: object) -> None:
        raise TimeoutError("it waits for the pipe")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


LOG, RESULT = "case1-unloaded.mcap", "case1-unloaded.algid"
CALLS = {
    "batch": f"{LOG} -o batch",
    "convert": f"{LOG} -o out.csv",
    "design": f"{RESULT} -o design",
    "identify": f"{LOG} -o again",
    "inspect": LOG,
    "synth": "case1 -o synth --duration 2",
    "track": f"{LOG} -o track --parameters {RESULT}",
    "validate": f"{RESULT} {LOG}",
}
ARGUMENTS = """
design pipe.toml --range 1 --speed 3 --torque 2
synth pipe.toml -o synth
synth case1 --motion piped -o synth
identify pipe
validate pipe.urdf case1-unloaded.mcap
validate pipe case1-unloaded.mcap
export pipe --to c
batch pipe.toml -o batch
track pipe --parameters case1-unloaded.algid
validate pipe.json --max-error 1
report pipe.json
compare pipe case1-unloaded.algid
convert pipe -o out.csv
inspect pipe
"""


@pytest.fixture(scope="module")
def place(result: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, its result, and pipes of every suffix."""
    folder = tmp_path_factory.mktemp("pipes")
    for made in (LOG, RESULT):
        (folder / made).symlink_to(result.with_name(made))
    (folder / "piped").mkdir()
    inside = ("piped/result.json", "piped/jobs.parquet", "piped/trajectory.csv")
    for name in ("pipe", "pipe.toml", "pipe.csv", "pipe.urdf", "pipe.json", *inside):
        os.mkfifo(folder / name)
    return folder


def _calls() -> Iterator[str]:
    """Every option of every command that names a file or a folder to read, and every argument."""
    for name in COMMANDS:
        for option in command(name).params:
            reads = isinstance(option.type, click.Path) and option.name not in WRITTEN
            if reads and isinstance(option, click.Option):
                yield f"{name} {CALLS[name]} {option.opts[0]} pipe"
    yield from ARGUMENTS.strip().splitlines()


@pytest.mark.parametrize("words", [*_calls()])
def test_what_names_a_pipe_is_refused_in_a_line(
    words: str, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    with soon():
        done = call(*words.split())
    text = done.err.strip()
    if "--torque-file" in words and words.startswith("batch"):
        text = done.out.splitlines()[-2]
    if "--torque-file" in words and words.startswith("inspect"):
        # its last words, in as many lines as the terminal needs
        text = " ".join(done.out[done.out.rindex("refused: ") :].split())
    assert done.code != 0
    assert len(text.splitlines()) == 1, done
    assert "no regular file" in text or (words.startswith("batch") and "found none" in text), text


def test_a_pipe_among_a_batchs_logs_fails_alone(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    with soon():
        done = call("batch", "pipe.csv", "-o", "batch")
    assert done.code == 1
    assert "pipe: failed: pipe.csv: it is no regular file" in " ".join(done.out.split())


@pytest.mark.parametrize("command", [["report"], ["report", "--export", "mcap"]], ids=" ".join)
def test_a_series_of_a_result_that_is_a_pipe_is_absent(
    command: list[str], place: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "x.algid"
    copytree(place / "case1-unloaded.algid", folder)
    for series in folder.glob("*.parquet"):
        series.unlink()
        os.mkfifo(series)
    with soon():
        assert call(*command, folder).code == 0
    assert (folder / "report.html").exists()


def test_devices_and_giants_are_not_read_whole(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="no regular file"):
        read_whole(Path("/dev/zero"))
    with (tmp_path / "giant").open("wb") as stream:
        stream.truncate(LIMITS.text_bytes + 1)
    with pytest.raises(OSError, match="more than 64 MiB"):
        read_whole(tmp_path / "giant")
