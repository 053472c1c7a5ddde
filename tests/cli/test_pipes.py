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
from click.testing import CliRunner

from algid.base.errors import AlgidError
from algid.base.files import read_whole
from algid.base.limits import LIMITS
from algid.cli.app import COMMANDS, command
from tests.cli.commands import app

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


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, its result, and pipes of every suffix."""
    folder = tmp_path_factory.mktemp("pipes")
    run = CliRunner().invoke
    made = ["synth", "case1", "-o", str(folder), "--duration", "2", "--torque", "wide"]
    assert run(app, made).exit_code == 0
    log = str(folder / "case1-unloaded.mcap")
    assert run(app, ["identify", log, "-o", str(folder), "--no-report", "-q"]).exit_code == 0
    for name in ("pipe", "pipe.toml", "pipe.csv", "pipe.urdf", "pipe.json"):
        os.mkfifo(folder / name)
    return folder


def _files() -> list[tuple[str, str]]:
    """Every option of every command that names a file or a folder to read."""
    return [
        (name, option.opts[0])
        for name in COMMANDS
        for option in command(name).params
        if isinstance(option, click.Option)
        and isinstance(option.type, click.Path)
        and option.name not in WRITTEN
    ]


@pytest.mark.parametrize(("command", "option"), _files())
def test_an_option_that_names_a_pipe_is_refused(command: str, option: str, place: Path) -> None:
    log, result = str(place / "case1-unloaded.mcap"), str(place / "case1-unloaded.algid")
    arguments = {
        "batch": [log, "-o", str(place / "batch")],
        "convert": [log, "-o", str(place / "out.csv")],
        "design": [result, "-o", str(place / "design")],
        "identify": [log, "-o", str(place / "again")],
        "inspect": [log],
        "synth": ["case1", "-o", str(place / "synth"), "--duration", "2"],
        "track": [
            log,
            "-o",
            str(place / "track"),
            *([] if option == "--parameters" else ["--parameters", result]),
        ],
        "validate": [result, log],
    }
    refused([command, *arguments[command], option, str(place / "pipe")])


@pytest.mark.parametrize(
    "arguments",
    [
        ["design", "pipe.toml", "--range", "1", "--speed", "3", "--torque", "2"],
        ["synth", "pipe.toml", "-o", "synth"],
        ["synth", "case1", "--motion", "piped", "-o", "synth"],
        ["identify", "pipe"],
        ["validate", "pipe.urdf", "case1-unloaded.mcap"],
        ["validate", "pipe", "case1-unloaded.mcap"],
        ["export", "pipe", "--to", "c"],
        ["batch", "pipe.toml", "-o", "batch"],
        ["track", "pipe", "--parameters", "case1-unloaded.algid"],
        ["validate", "pipe.json", "--max-error", "1"],
        ["report", "pipe.json"],
        ["compare", "pipe", "case1-unloaded.algid"],
        ["convert", "pipe", "-o", "out.csv"],
        ["inspect", "pipe"],
    ],
    ids=" ".join,
)
def test_an_argument_that_names_a_pipe_is_refused(
    arguments: list[str], place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    Path("piped").mkdir(exist_ok=True)
    for name in ("result.json", "jobs.parquet", "trajectory.csv"):
        if not Path("piped", name).exists():
            os.mkfifo(Path("piped", name))
    refused(arguments)


def refused(arguments: list[str]) -> None:
    """Run a command that has to end with one line of its own."""
    with soon():
        done = CliRunner().invoke(app, arguments)
    text = str(done.exception) if isinstance(done.exception, AlgidError) else done.stderr.strip()
    assert done.exit_code != 0
    if arguments[0] == "batch" and "--torque-file" in arguments:
        text = done.stdout.strip().splitlines()[-2]
    if arguments[0] == "inspect" and "--torque-file" in arguments:
        # its last words, in as many lines as the terminal needs
        text = " ".join(done.stdout[done.stdout.rindex("refused: ") :].split())
    assert len(text.splitlines()) == 1, (done.output, done.exception)
    assert "no regular file" in text or (arguments[0] == "batch" and "found none" in text), text


def test_a_pipe_among_a_batchs_logs_fails_alone(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    with soon():
        done = CliRunner().invoke(app, ["batch", "pipe.csv", "-o", "batch"])
    assert done.exit_code == 1
    assert "pipe: failed: pipe.csv: it is no regular file" in " ".join(done.output.split())


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
        assert CliRunner().invoke(app, [*command, str(folder)]).exit_code == 0
    assert (folder / "report.html").exists()


def test_devices_and_giants_are_not_read_whole(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="no regular file"):
        read_whole(Path("/dev/zero"))
    with (tmp_path / "giant").open("wb") as stream:
        stream.truncate(LIMITS.text_bytes + 1)
    with pytest.raises(OSError, match="more than 64 MiB"):
        read_whole(tmp_path / "giant")
