"""A short run of the hostile files of `make fuzz`: each is read, told or refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from algid.log import Log
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


CLEAN = clean_log(20)
SHORT = CLEAN.part(0, 19)
LOSSY, OTHER = Notice("CUT_OFF", "cut", lossy=True), Notice("GAPS", "gaps")
TWICE = Notice("UNEVEN_STAMPS", "1 sample repeats a stamp; the first of each was kept")


def _noting(log: Log, notice: Notice) -> Log:
    return replace(log, notices=(notice,))


@pytest.mark.parametrize(
    ("found", "rows", "end"),
    [
        (CLEAN, 0, "same"),
        (SHORT, 0, "silent"),
        (_noting(SHORT, OTHER), 0, "silent"),
        (_noting(SHORT, LOSSY), 0, "told"),
        (replace(CLEAN, theta=CLEAN.theta + 1), 0, "silent"),
        # of a file of which only the number of its samples is known
        (CLEAN, 20, "read"),
        (CLEAN, 21, "silent"),
        (_noting(CLEAN, OTHER), 21, "silent"),
        (_noting(CLEAN, LOSSY), 21, "read"),
        (_noting(CLEAN, TWICE), 21, "read"),
        (_noting(CLEAN, TWICE), 22, "silent"),
        (None, 0, "traceback"),
    ],
)
def test_the_judge_sees_what_is_silent(
    found: Log | None, rows: int, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(_: Path) -> Log:
        if found is None:
            raise RuntimeError
        return found

    monkeypatch.setattr(fuzz, "read_log", read)
    assert fuzz.outcome(Path("log.h5"), None if rows else CLEAN, rows)[0] == end


@pytest.mark.parametrize("seed", [1, pytest.param(1000, marks=pytest.mark.slow)])
def test_damaged_bytes_of_every_format_are_read_told_or_refused(seed: int, tmp_path: Path) -> None:
    found = [case() for case in fuzz.damaged(tmp_path, range(seed, seed + 120))]
    assert not [one for one in found if one[0] not in FINE]
    assert {"refused", "read", "same"} <= {kind for kind, _ in found}
