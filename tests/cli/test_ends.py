"""How commands end: what a batch prints and returns, what `synth` writes, and what `design` is
asked.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from shutil import copyfile
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest

import algid
from algid.api.batch import answer
from algid.api.design import answer as planned_answer
from algid.api.identify import answer as identified
from algid.api.options import stem_of
from algid.base.errors import SettingError
from algid.batches.jobs import Job, JobRecord, JobStatus
from algid.batches.run import Batched
from algid.cli.output import shown
from algid.designs.prior import PriorKnowledge, noise_for, prior_of
from algid.estimators.whitening import NoiseLevels
from tests.cli.commands import call


def record(name: str, status: JobStatus, reason: str = "") -> JobRecord:
    return JobRecord(Job(name, ("a.csv",)), status, reason, "", (), {}, "")


GOOD, PART = record("a", JobStatus.OK), record("b", JobStatus.INCOMPLETE)
BAD, DEAD = (
    record("c", JobStatus.FAILED, "no\x1b[31m torque"),
    record("d", JobStatus.KILLED, "three times"),
)


@pytest.mark.parametrize(
    ("ended", "stopped", "code", "lines"),
    [
        (Batched([], 0, 0), False, 0, ["nothing done; 0 run now, 0 left; out/jobs.parquet"]),
        (Batched([PART], 1, 0), False, 3, ["1 incomplete; 1 run now, 0 left; out/jobs.parquet"]),
        (
            Batched([GOOD, PART, BAD, DEAD], 4, 0),
            False,
            1,
            [
                "c: failed: no\\u001b[31m torque",
                "d: killed: three times",
                "1 ok, 1 incomplete, 1 failed, 1 killed; 4 run now, 0 left; out/jobs.parquet",
            ],
        ),
        (Batched([GOOD], 2, 3), True, 130, ["1 ok; 2 run now, 3 left; out/jobs.parquet"]),
        (Batched([GOOD], 1, 0, "full"), True, 1, ["1 ok; 1 run now, 0 left; out/jobs.parquet"]),
    ],
)
def test_a_batch_says_what_became_of_its_jobs(
    ended: Batched,
    stopped: bool,
    code: int,
    lines: list[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    told = answer(replace(ended, out="out", interrupted=stopped), {})
    assert told.exit == code
    for quiet in (False, True):
        shown(told, False, quiet)
        printed = capsys.readouterr()
        assert printed.out.splitlines() == ([] if quiet else lines)
        assert printed.err == ("" if ended.stopped is None else f"algid: {ended.stopped}\n")


def test_results_are_named_by_their_folders(tmp_path: Path) -> None:
    assert stem_of(tmp_path / "mon/a.algid") == "a"
    assert stem_of(tmp_path / "b.algid/result.json") == "b"
    assert call("compare", tmp_path / "b.algid").err == (
        "algid: compare: expected two results or more, found 1; name another one\n"
    )


def test_a_batch_says_what_it_ran_anew_and_what_it_passed_over() -> None:
    anew, torn = {"other settings": 2, "a new log": 1}, {"b.json": "torn"}
    told = answer(Batched([GOOD], 1, 0, None, torn, anew, "out", links=["mon"]), {})
    assert next(iter(told.shown)) == "run anew: 2 other settings, 1 a new log"
    record, links = told.complaints
    assert record == "out/b.json: no record of a job (torn); it counts as none: remove it"
    assert links == ("links to folders are not entered (mon); name what they lead to as sources")
    assert told.exit == 0


@pytest.mark.parametrize(("lacks", "code"), [([], 0), (["k5"], 3)])
def test_a_design_that_leaves_a_parameter_open_ends_with_3(lacks: list[str], code: int) -> None:
    planned: Any = SimpleNamespace(open_parameters=lacks)
    told = planned_answer(planned, {"prior": "case1", "out": Path()})
    assert (told.exit, told.remarks) == (code, ["wrote case1.design"])


def test_a_result_of_a_cut_log_ends_with_4(result: Path) -> None:
    found, given = algid.read_result(result), {"verbose": False, "out": Path()}
    lost = found.model_copy(update={"data_lost": True})
    assert [identified(one, given).exit for one in (found, lost)] == [0, 4]


def test_commands_say_where_their_files_are(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for of, to, file in (
        (result, "c", "case1-unloaded.c"),
        (result / "result.json", "python", "case1_unloaded.py"),  # as Python imports it
    ):
        done = call("export", of, "--to", to)
        assert (done.code, done.out) == (0, "")
        assert done.err.endswith(f"wrote {file}\n")
        assert Path(file).is_file()
    draws = ("export", result, "--to", "csv", "--draws", "2")
    ends = [call(*draws, *flags).code for flags in ((), (), ("--force",))]
    assert ends == [0, 2, 0]  # a folder that is there stays, unless it is to be replaced
    done = call("compare", result, result, "-o", ".")
    assert (done.code, done.err) == (0, "wrote compare.html\n")
    assert Path("compare.html").is_file()
    again = ("--estimator", "weak", "--no-report", "-v", "--name", "mine")
    done = call("identify", result.with_suffix(".mcap"), *again)
    assert done.err.endswith("wrote mine.algid\n")
    assert done.out == call("report", "mine.algid").out


def test_validate_ends_with_4_where_samples_are_missing_and_with_1_past_a_limit(
    result: Path, tmp_path: Path
) -> None:
    content = result.with_suffix(".mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 3 // 4])
    done = call("validate", result, tmp_path / "cut.mcap", "--format", "json")
    assert (done.code, json.loads(done.out)["data_lost"]) == (4, True)
    assert call("validate", result, tmp_path / "cut.mcap", "--max-nrmse", "1e-9").code == 1


def test_a_batch_beside_an_arms_result_takes_its_logs_for_loaded_ones(
    result: Path, tmp_path: Path
) -> None:
    copyfile(result.parent / "case1-loaded.mcap", tmp_path / "monday.mcap")
    quick = ("--estimator", "weak", "--workers", "1", "--no-report")
    done = call("batch", tmp_path, "-o", tmp_path / "out", "--parameters", result, *quick)
    assert done.code == 0, done.out
    found = algid.read_result(tmp_path / "out" / "monday.algid").payload["m_p"]
    assert found.estimate == pytest.approx(0.3515, rel=0.05)


SHORT = ("--format", "csv", "--rate", "200", "--duration", "0.5")


def synthetic(folder: Path, *flags: str, role: str = "unloaded") -> pl.DataFrame:
    done = call("synth", "case1", "-o", folder, *SHORT, *flags)
    assert done.code == 0, done.err
    return pl.read_csv(folder / f"case1-{role}.csv")


def test_a_start_and_a_schedule_are_taken(tmp_path: Path) -> None:
    for year in (1970, 2037):
        options: dict[str, Any] = {"duration": 0.1, "start_time": f"{year}-01-02"}
        stamp = algid.synthesise("case1", **options)[0].stamp_ns[0] / 1e9
        assert datetime.fromtimestamp(stamp, UTC) == datetime(year, 1, 2, tzinfo=UTC)
    began = synthetic(tmp_path / "began", "--set", "initial=-1,0.25,0.5,-0.75")
    first = began.select("theta1", "theta2", "omega1", "omega2").row(0)
    assert first == (-1, 0.25, 0.5, -0.75)
    bare = synthetic(tmp_path / "bare")
    picked = synthetic(tmp_path / "picked", "--payload-schedule", "0.2=0.3,0.4=0", role="schedule")
    written = sorted(path.name for path in (tmp_path / "picked").iterdir())
    assert written == ["case1-schedule.csv", "case1-schedule.csv.truth.json"]
    apart = np.abs(picked["theta1"].to_numpy() - bare["theta1"].to_numpy())
    assert apart[:41].max() < 1e-9  # until it is grasped at 0.2 s
    assert apart[60] > 1e-6
    again = call(
        "synth", "case1", "-o", tmp_path / "picked", *SHORT, "--payload-schedule", "0.2=0.3"
    )
    assert "case1-schedule.csv: exists already" in again.err


def test_no_torque_and_a_replayed_one(tmp_path: Path) -> None:
    still = synthetic(tmp_path / "still", "--torque", "none")
    assert still["tau1"].abs().max() == 0
    assert still["theta1"].to_numpy() == pytest.approx(-math.pi / 2, abs=1e-9)  # hanging at rest
    wide = synthetic(tmp_path / "wide", "--torque", "wide")
    replayed = ("--torque", str(tmp_path / "wide" / "case1-unloaded.csv"))
    off = list[Any]()
    for name, flags in (("held", ()), ("linear", ("--torque-hold", "foh"))):
        again = synthetic(tmp_path / name, *replayed, *flags)
        assert again["tau1"].to_numpy() == pytest.approx(wide["tau1"].to_numpy(), abs=1e-9)
        off.append((again["theta1"] - wide["theta1"]).abs().max())
    assert off[1] < 0.1 * off[0]
    held = synthetic(tmp_path / "zoh", "--torque", "wide", "--torque-hold", "zoh")
    assert (held["theta1"] - wide["theta1"]).abs().max() == pytest.approx(off[0], rel=1e-3)


def test_noise_is_the_flags_then_a_logs_then_the_results(tmp_path: Path) -> None:
    prior: Any = prior_of("case1", None, PriorKnowledge(None, None, None, None))
    by_flags = noise_for(prior, 1e-3, 2e-2, None)
    assert (by_flags.theta.tolist(), by_flags.tau.tolist()) == ([1e-3, 1e-3], [2e-2, 2e-2])
    noisy = ("--position-noise", "1e-3", "--torque-noise", "2e-2")
    synthetic(tmp_path, *noisy, "--rate", "1000", "--duration", "2")
    log = algid.read_log(tmp_path / "case1-unloaded.csv")
    measured = noise_for(prior, None, None, log)
    # a first guess from differences: to a fifth or so
    assert measured.theta == pytest.approx(1e-3, rel=0.3)
    assert measured.tau == pytest.approx(2e-2, rel=0.3)
    mixed = noise_for(prior, 5e-3, None, log)
    assert mixed.theta.tolist() == [5e-3, 5e-3]
    assert mixed.tau.tolist() == measured.tau.tolist()
    known: Any = SimpleNamespace(
        source="arm", noise=NoiseLevels(np.full(2, 3e-4), np.array([0.1, np.nan]))
    )
    assert noise_for(known, None, 0.2, None).theta.tolist() == [3e-4, 3e-4]
    with pytest.raises(
        SettingError, match=r"^--torque-noise: arm does not tell how noisy the sensors are; give it"
    ):
        noise_for(known, None, None, None)
