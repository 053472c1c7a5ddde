"""Forms of output for programs, and dates of synthetic logs."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
from typer.testing import CliRunner

import algid
from tests.cli.commands import app


def run(*arguments: str | Path, code: int = 0) -> str:
    """What a command prints."""
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == code, done.output
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("forms")
    noisy = (
        "--torque",
        "wide",
        "--duration",
        "2",
        "--position-noise",
        "1e-3",
        "--torque-noise",
        "1e-2",
    )
    run("synth", "case1", "-o", place, *noisy, "--set", "start_time=2026-01-31T12:00:00")
    run("identify", place / "case1-unloaded.mcap", "-o", place, "--no-report", "-q")
    return place


def test_a_synthetic_log_starts_when_it_is_told_to(folder: Path) -> None:
    stamps = algid.read_log(folder / "case1-unloaded.mcap").stamp_ns
    assert stamps[0] == int(datetime(2026, 1, 31, 12, tzinfo=UTC).timestamp()) * 10**9
    assert stamps[-1] - stamps[0] == 2 * 10**9


def test_validate_prints_json_of_what_it_prints_in_words(folder: Path) -> None:
    command = ("validate", folder / "case1-unloaded.algid", folder / "case1-unloaded.mcap")
    words = run(*command)
    content = json.loads(run(*command, "--format", "json", "--max-nrmse", "1e-9", code=1))
    assert content["over"] is True
    assert list(content["logs"]) == [str(folder / "case1-unloaded.mcap")]
    for joint, rmse in enumerate(content["total"]["rmse"], 1):
        rows = [line.split() for line in words.splitlines() if line.startswith("all logs")]
        assert float(rows[joint - 1][3]) == pytest.approx(rmse, rel=1e-3)
    assert json.loads(run(*command, "--format", "json"))["over"] is False
