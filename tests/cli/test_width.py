"""What every command prints fits a terminal of 80 columns, there and in a pipe, and nothing is
cut.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from tests.processes import Outcome
from tests.terminals import WIDTH, on_a_terminal

HEIGHT = 25
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")
ERASED = "\x1b[2K"
RESULTS = ("identify", "validate", "track", "batch", "synth", "export", "convert")
"""What has a screen at most; a log's channels, tables of a report and comparisons may be many."""
CALLS = [
    "synth case1 --duration 1 -o {out}",
    "inspect {log}",
    "identify {log} --estimator weak --no-report -o {out}",
    "identify {log} --estimator paper --no-report -o {out}",
    "identify {short} --no-report -o {out}",
    "validate {result} {log}",
    "track {log} --parameters {result} --l1 0.1626 --l2 0.1232 -o {out}",
    "compare {result} {result} {result}",
    "validate {result} --max-error 5",
    "report {result}",
    "export {result} --to urdf -o {out}/arm.urdf",
    "convert {log} -o {out}/arm.csv",
    "batch {log} -o {out} --no-report",
]


@pytest.fixture(scope="module")
def short(result: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The beginning of a log, which tells little, so that much is said of it."""
    path = tmp_path_factory.mktemp("short") / "short.csv"
    log = result.with_suffix(".mcap")
    assert Outcome("convert", log, "-o", path).code == 0
    path.write_text("\n".join(path.read_text().splitlines()[:400]) + "\n")
    path.with_name("short.csv.truth.json").unlink(missing_ok=True)
    return path


def words(call: str, result: Path, short: Path, out: Path) -> list[str]:
    """The words of a call, by which no two ways write over one another."""
    places = {"log": result.with_suffix(".mcap"), "result": result, "short": short, "out": out}
    return [word.format(**places) for word in call.split()]


def left(printed: str) -> list[str]:
    """The lines that stay once the last bar of progress has erased itself."""
    return CONTROL.sub("", printed.rpartition(ERASED)[2]).rstrip().splitlines()


@pytest.mark.parametrize("call", CALLS)
def test_what_is_printed_fits_eighty_columns(
    call: str, result: Path, short: Path, tmp_path: Path
) -> None:
    env = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
    piped = Outcome(*words(call, result, short, tmp_path / "pipe"), cwd=tmp_path, env=env)
    _, seen = on_a_terminal(*words(call, result, short, tmp_path / "screen"), cwd=tmp_path)
    shown = left(seen)
    assert piped.code in (0, 3), piped.err
    for lines in ([*piped.out.splitlines(), *piped.err.splitlines()], shown):
        for line in lines:
            # a path stays whole, that it can be taken over
            rest = re.sub(r"\S*/\S*", "", line)
            assert len(rest if rest != line else line) <= WIDTH, line
            assert "…" not in line, line
        if call.partition(" ")[0] in RESULTS:
            assert len(lines) <= HEIGHT + 2, lines  # and where the files are
