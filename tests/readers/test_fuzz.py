"""A short run of the hostile files of `make fuzz`: each is read, told or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.log import Log, Origin
from algid.notices import Notice
from pipelines import fuzz_files as fuzz
from pipelines.hostile import FINE, corpus
from pipelines.mutations import clean_log

SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (50, 100))]


@pytest.mark.parametrize("seed", SEEDS)
def test_hostile_files_are_read_told_or_refused(seed: int, tmp_path: Path) -> None:
    outcomes = {path.name: fuzz.outcome(path, one.log) for path, one in corpus(tmp_path, 50, seed)}
    assert not [one for one in outcomes.items() if one[1][0] not in FINE]
    assert {kind for kind, _ in outcomes.values()} >= {"refused", "same"}


def test_the_judge_sees_what_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    log = clean_log(20)

    def judged(found: Log) -> str:
        monkeypatch.setattr(fuzz, "read_log", lambda _: found)
        return fuzz.outcome(Path("log.mcap"), log)[0]

    lossy, other = Notice("CUT_OFF", "cut", lossy=True), Notice("GAPS", "gaps")
    assert judged(log) == "same"
    assert judged(log.part(0, 19)) == "silent"
    assert judged(_noting(log.part(0, 19), other)) == "silent"
    assert judged(_noting(log.part(0, 19), lossy)) == "told"
    assert (
        judged(Log(log.stamp_ns, log.theta + 1, log.tau, Origin("", "", {}), log.omega)) == "silent"
    )

    def fewest(found: Log, rows: int) -> str:
        """The judgement on a file of which only the number of its samples is known."""
        monkeypatch.setattr(fuzz, "read_log", lambda _: found)
        return fuzz.outcome(Path("log.h5"), None, rows)[0]

    assert fewest(log, 20) == "read"
    assert fewest(log, 21) == fewest(_noting(log, other), 21) == "silent"
    assert fewest(_noting(log, lossy), 21) == "read"
    twice = Notice("UNEVEN_STAMPS", "1 sample repeats a stamp; the first of each was kept")
    assert [fewest(_noting(log, twice), rows) for rows in (21, 22)] == ["read", "silent"]

    def fails(_: Path) -> Log:
        raise RuntimeError

    monkeypatch.setattr(fuzz, "read_log", fails)
    assert fuzz.outcome(Path("log.mcap"), log)[0] == "traceback"


def _noting(log: Log, notice: Notice) -> Log:
    return Log(log.stamp_ns, log.theta, log.tau, log.origin, log.omega, (notice,))


@pytest.mark.parametrize("seed", [1, pytest.param(1000, marks=pytest.mark.slow)])
def test_damaged_bytes_of_every_format_are_read_told_or_refused(seed: int, tmp_path: Path) -> None:
    found = [case() for case in fuzz.damaged(tmp_path, range(seed, seed + 120))]
    assert not [one for one in found if one[0] not in FINE]
    assert {"refused", "read", "same"} <= {kind for kind, _ in found}
