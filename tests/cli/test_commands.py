"""The commands as their users call them: outputs, exit codes, one clear line for what is wrong."""

from __future__ import annotations

import json
import math
import re
import shlex
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from algid.results import read_result
from tests.processes import Outcome


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    made = Outcome(
        "synth", "case1", "-o", folder, "--torque", "wide", "--duration", "2", "--format", "csv"
    )
    assert made.code == 0, made.err
    assert made.out.split() == [
        str(folder / f"case1-{role}.csv") for role in ("unloaded", "loaded")
    ]
    return folder


def test_synth_identify_check(logs: Path, tmp_path: Path) -> None:
    found = Outcome(
        "identify",
        logs / "case1-unloaded.csv",
        "--loaded",
        logs / "case1-loaded.csv",
        "-o",
        tmp_path,
        "--format",
        "json",
    )
    assert found.code == 0, found.err
    content = json.loads(found.out)
    folder = tmp_path / "case1-unloaded.algid"
    assert found.out == (folder / "result.json").read_text()
    assert content["settings"]["command"].startswith("algid identify /")
    good = Outcome("validate", folder, "--max-error", "0.5")
    assert good.code == 0, good.out
    assert good.out.count("ok") == 12
    tight = tmp_path / "tight.toml"
    tight.write_text("[max_error_percent]\nk1 = 1e-12\nk2 = 5\n")
    bad = Outcome("validate", folder, "--max-error", tight)
    assert bad.code == 1
    assert bad.out.splitlines()[0].startswith("OVER  k1")
    assert bad.out.splitlines()[1].startswith("ok    k2")


def test_a_loaded_log_among_unloaded_ones_is_told(logs: Path, tmp_path: Path) -> None:
    found = Outcome("identify", logs / "case1-loaded.csv", "-o", tmp_path)
    assert found.code == 2
    assert "give it as a loaded one" in found.err


def test_a_failed_result_ends_with_three_and_says_what_to_run(logs: Path, tmp_path: Path) -> None:
    table = (
        pl.read_csv(logs / "case1-unloaded.csv")
        .with_columns(-pl.col("theta2"))
        .drop("omega1", "omega2")
    )
    table.write_csv(tmp_path / "wrong.csv")
    found = Outcome(
        "identify", tmp_path / "wrong.csv", "-o", tmp_path, "--estimator", "weak", "--no-report"
    )
    assert found.code == 3
    lines = found.out.splitlines()
    assert lines[0].startswith("Failed: ")
    assert "do not use these\nnumbers." in found.out
    assert "[UNKNOWN_CAUSE]" in found.out
    said = found.out.replace(" \\\n    ", " ").splitlines()  # a long command goes on below
    assert f"Run first: algid inspect {tmp_path / 'wrong.csv'}" in said
    assert " OK " not in found.out


def test_a_result_has_the_name_and_the_call_that_were_typed(logs: Path, tmp_path: Path) -> None:
    flags = ("--name", "monday", "--no-report", "--estimator", "weak")
    call = ("identify", logs / "case1-unloaded.csv", "-o", tmp_path, *flags)
    found = Outcome(*call)
    assert found.code == 0, found.err
    typed = read_result(tmp_path / "monday.algid").settings["command"]
    assert typed == shlex.join(map(str, ("algid", *call)))


def test_how_a_log_was_read_is_reused_and_compared(logs: Path, tmp_path: Path) -> None:
    """θ1 of the log counts from hanging: said once, for the arm.

    Its later logs are read the same way.
    """
    hanging = {
        role: pl.read_csv(logs / f"case1-{role}.csv").with_columns(pl.col("theta1") + math.pi / 2)
        for role in ("unloaded", "loaded")
    }
    for role, table in hanging.items():
        table.drop("omega1", "omega2").write_csv(tmp_path / f"{role}.csv")

    def identified(*arguments: object) -> Any:
        quick = ["--estimator", "weak", "--model", "plain", "--no-report", "--format", "json"]
        done = Outcome("identify", *map(str, arguments), "-o", tmp_path, *quick)
        assert done.code in (0, 3), done.err
        return json.loads(done.out)

    unloaded, loaded, arm = (tmp_path / f for f in ("unloaded.csv", "loaded.csv", "unloaded.algid"))
    content = identified(unloaded, "--zero", "hanging")
    assert content["profile"] == {"zero": "hanging"}
    assert content["log"]["reading"]["zero"] == "hanging"
    alike = identified("--parameters", arm, loaded)
    assert alike["log"]["reading"]["zero"] == "hanging"
    assert alike["payload"]["m_p"]["estimate"] == pytest.approx(0.3515, rel=0.02)
    flat = ("--zero", "horizontal")
    other = identified("--parameters", arm, loaded, *flat, "--name", "other")
    (warning,) = [one["text"] for one in other["notices"] if one["code"] == "OTHER_ARM"]
    assert "zero horizontal instead of hanging" in warning
    good, wrong = (Outcome("validate", arm, unloaded, *more) for more in ((), flat))
    scores = re.findall(r"^all logs +\d +\S+ +\S+ +(\S+)", good.out, re.MULTILINE)
    assert min(map(float, scores)) > 0.999
    assert good.err == ""
    assert "zero horizontal instead of hanging" in wrong.err
    pair = (tmp_path / "loaded.algid", tmp_path / "other.algid")
    compared = json.loads(Outcome("compare", *pair, "--format", "json").out)
    assert compared["settings"]["loaded log.zero"] == ["hanging", "horizontal"]


def test_validate_predicts_another_log(tmp_path: Path) -> None:
    noisy = [
        "--torque",
        "wide",
        "--duration",
        "4",
        "--position-noise",
        "1e-4",
        "--torque-noise",
        "1e-2",
    ]
    logs = []
    for seed in "01":
        folder = tmp_path / seed
        Outcome("synth", "case1", "-o", folder, "--seed", seed, *noisy)
        logs.append((folder / "case1-unloaded.mcap", "--loaded", folder / "case1-loaded.mcap"))
    Outcome("identify", *logs[0], "-o", tmp_path, "--no-report", "--model", "plain")
    folder = tmp_path / "case1-unloaded.algid"
    good = Outcome("validate", folder, *logs[1], "--max-nrmse", "0.3")
    assert good.code == 0, good.err + good.out
    lines = [line.split() for line in good.out.splitlines() if line.startswith("all logs")]
    assert [words[2] for words in lines] == ["1", "2"]
    assert "Filter: zero-phase Butterworth" in good.out
    assert Outcome("validate", folder, logs[1][0], "--max-nrmse", "1e-9").code == 1
