"""The outermost place: what nobody foresaw is one line and an exit code, and what is printed
drives no terminal.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from algid.base.errors import Exit
from algid.base.text import printable
from algid.cli.app import run as run_command
from tests.cli.commands import call
from tests.processes import begin


class PanicError(BaseException):
    """Raised as pyo3 raises what it calls a panic: no `Exception`."""


def raising(error: BaseException) -> Callable[..., Any]:
    """What raises it, from a file that is not algid's."""

    def raise_it(*_: object, **__: object) -> object:
        raise error

    return raise_it


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., Any]:
    """Runs a command in this process as the console script does.

    Gives its exit code and standard error.
    """
    (tmp_path / "log.csv").write_text("t,theta1\n0,1\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ALGID_TRACEBACK", raising=False)

    def running(*arguments: str) -> tuple[object, str]:
        monkeypatch.setattr(sys, "argv", ["algid", *arguments])
        try:
            code: object = run_command(arguments)
        except SystemExit as end:
            code = end.code
        return code, capsys.readouterr().err

    return running


@pytest.mark.parametrize(
    ("raised", "code", "line"),
    [
        (
            PanicError("index out of bounds\nnote: run with RUST_BACKTRACE"),
            2,
            (
                "while opening log.csv: a library cannot take it (PanicError: index out of "
                "bounds); look at the file, "
                "or write it anew in another format; see where with ALGID_TRACEBACK=1"
            ),
        ),
        (
            MemoryError("Unable to allocate 9 GiB"),
            2,
            (
                "while opening log.csv: not enough memory (MemoryError: Unable to allocate 9 "
                "GiB); cut the log with "
                "--start and --end"
            ),
        ),
        (
            OSError(5, "Input/output error", "log.csv"),
            2,
            (
                "while opening log.csv: log.csv: Input/output error; mend that and run it again, "
                "or see where with "
                "ALGID_TRACEBACK=1"
            ),
        ),
    ],
)
def test_what_a_library_raises_names_the_file_and_the_stage(
    raised: BaseException,
    code: int,
    line: str,
    run: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("algid.inspection.checks.format_of", raising(raised))
    assert run("inspect", "log.csv") == (code, f"algid: {line}\n")


def test_a_fault_of_algid_is_called_one(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    # then algid's own line fails
    monkeypatch.setattr("algid.inspection.checks.format_of", lambda _path: None)
    line = (
        "algid: internal error: while opening log.csv: AttributeError: 'NoneType' object has no "
        "attribute 'name'; "
        "this is a fault of algid: report it, see where with ALGID_TRACEBACK=1\n"
    )
    assert run("inspect", "log.csv") == (Exit.INTERNAL, line)
    monkeypatch.setenv("ALGID_TRACEBACK", "1")
    code, told = run("inspect", "log.csv")
    assert code == Exit.INTERNAL
    assert told.startswith("Traceback")
    assert told.endswith(line)


def test_an_end_that_is_meant_keeps_its_meaning(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("algid.inspection.checks.format_of", raising(SystemExit(3)))
    assert run("inspect", "log.csv") == (3, "")


def test_a_full_standard_output_is_one_line_of_every_command(result: Path, tmp_path: Path) -> None:
    log = result.parent / "case1-unloaded.mcap"
    calls: tuple[tuple[object, ...], ...] = (
        ("--help",),
        ("--version",),
        ("guide", "start"),
        ("inspect", log),
        ("identify", log, "-o", tmp_path, "--no-report"),
        ("validate", result, log, "--format", "json"),
        ("report", result),
        ("synth", "case1", "-o", tmp_path, "--duration", "0.1"),
        ("inspect", log, "--write-profile", tmp_path / "new.toml"),
    )
    for arguments in calls:
        with Path("/dev/full").open("wb") as full, (tmp_path / "err").open("wb") as err:
            code = begin(*arguments, stdout=full.fileno(), stderr=err.fileno())()
        lines = (tmp_path / "err").read_text().splitlines()
        told = [line for line in lines if not line.startswith(("wrote", "note"))]
        assert code == 2, arguments
        assert len(told) == 1, arguments
        assert told[0].startswith("algid: standard output: No space left on device; mend that")


def test_a_full_standard_error_changes_no_exit_code(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full, (tmp_path / "out").open("wb") as out:
        assert begin("report", "absent.algid", stdout=out.fileno(), stderr=full.fileno())() == 2
        assert begin("--version", stdout=out.fileno(), stderr=full.fileno())() == 0


def test_closed_streams_are_none_of_the_files_that_are_written(tmp_path: Path) -> None:
    command = (
        f"exec {sys.executable} -m algid synth case1 --duration 0.1 --format csv -o "
        f"{tmp_path} >&- 2>&-"
    )
    assert subprocess.run(["sh", "-c", command], check=False, env={**os.environ}).returncode == 0
    assert (tmp_path / "case1-loaded.csv").read_text().startswith("t,")
    assert b".csv\n" not in (tmp_path / "case1-loaded.csv").read_bytes()


HOSTILE = "a\x1b[31m\x07\x9b2J\u202e\u2028\U000e0041\x7f b"


def test_a_tampered_result_drives_no_terminal(result: Path, tmp_path: Path) -> None:
    content = json.loads((result / "result.json").read_text())
    for row in content["table4"]:
        row["parameter"] = HOSTILE
    content |= {
        "version": HOSTILE,
        "estimator": HOSTILE,
        "notices": [{"code": HOSTILE, "text": HOSTILE, "note": note} for note in (True, False)],
    }
    content["log"]["path"] = HOSTILE
    content["parameters"][HOSTILE] = content["parameters"].pop("k3") | {"unit": HOSTILE}
    folder = tmp_path / "tampered.algid"
    folder.mkdir()
    (folder / "result.json").write_text(json.dumps(content))
    for arguments in (
        ("validate", folder, "--max-error", "50"),
        ("compare", folder, result),
        ("compare", folder, result, "--format", "json"),
        ("report", folder),
        ("report", folder, "--format", "json"),
        ("export", folder, "--to", "c"),
        ("validate", folder, result.parent / "case1-unloaded.mcap"),
    ):
        done = call(*arguments)
        shown = done.out + done.err
        assert shown, arguments
        assert printable(shown) == shown, (arguments, shown)
        if "json" in arguments:
            json.loads(done.out)


def test_an_escape_is_jsons() -> None:
    assert json.loads(f'"{printable(HOSTILE)}"') == HOSTILE
    assert printable("θ ± 1\n\tok") == "θ ± 1\n\tok"
