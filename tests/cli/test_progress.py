"""The line of progress as a terminal gets it; silence everywhere else."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import algid
from algid.identification.identify import identify
from algid.log import Log
from algid.settings import Settings
from tests.processes import Outcome
from tests.terminals import on_a_terminal


@pytest.fixture(scope="module")
def log() -> Log:
    found, _ = algid.synthesise("case1", duration=2.0, torque="wide", torque_noise=1e-2, seed=1)
    return replace(found, omega=None)


@pytest.fixture(scope="module")
def path(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from algid.writers import write_log

    path = tmp_path_factory.mktemp("progress") / "log.parquet"
    write_log(path, log)
    return path


@pytest.mark.slow
def test_a_terminal_is_shown_stages_and_samples_and_is_left_clean(
    path: Path, tmp_path: Path
) -> None:
    with tempfile.TemporaryFile() as file:
        code, seen = on_a_terminal("identify", path, "-o", tmp_path, stdout=file.fileno())
        file.seek(0)
        printed = file.read().decode()
    assert code == 0, seen
    assert "reading" in seen
    assert "of 2,001 (" in seen
    assert "k1" in printed
    assert "\x1b" not in printed
    bar, _, after = seen.rpartition("wrote ")
    assert bar.endswith("\x1b[2K")  # the line is cleared
    assert "\x1b" not in after


@pytest.mark.parametrize("command", ["identify", "convert"])
def test_a_pipe_gets_none_of_it(command: str, path: Path, tmp_path: Path) -> None:
    arguments: dict[str, list[str | Path]] = {
        "identify": ["-q", path, "-o", tmp_path],
        "convert": ["-q", path, "-o", tmp_path / "log.csv"],
    }
    colour = {**os.environ, "FORCE_COLOR": "1"}  # asks for colour, not for a terminal's bars
    done = Outcome(command, *arguments[command], env=colour)
    assert (done.code, done.err) == (0, "")


@pytest.mark.parametrize("estimator", ["refined", "weak", "paper"])
def test_every_stage_comes_to_its_end(estimator: str, log: Log, tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    settings = Settings(estimator=estimator)
    other = replace(log, tau=np.random.default_rng(0).normal(log.tau, 1e-2))  # else it is the same
    logs = [log, other] if estimator != "paper" else log
    identify(logs, None, settings, out=tmp_path, progress=lambda *c: calls.append(c))
    stages = dict.fromkeys(stage for stage, _, _ in calls)
    samples = (2 if estimator != "paper" else 1) * len(log)
    assert next(iter(stages)) == "reading"
    assert list(stages)[-1] == "report"
    for stage in stages:
        done = [(done, total) for told, done, total in calls if told == stage and total]
        assert all(0 <= one <= total for one, total in done)
        # whose last one is the first log's alone
        if done and not (stage == "series" and estimator == "refined"):
            assert done[-1] == (samples, samples)
