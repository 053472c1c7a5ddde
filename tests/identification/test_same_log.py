"""A log that is given twice counts once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from algid.identification.identify import identify
from algid.identification.source import open_sources
from algid.profile import Profile
from algid.settings import Settings
from algid.writers import write_log
from tests.inspection.test_checks import moving_log


def test_a_log_given_twice_counts_once_and_is_told(tmp_path: Path) -> None:
    log = moving_log(4000)
    write_log(tmp_path / "one.csv", log)
    shutil.copy(tmp_path / "one.csv", tmp_path / "copy.csv")
    weak = Settings(estimator="weak")
    once = identify(tmp_path / "one.csv", settings=weak, report=False)
    twice = identify([tmp_path / "one.csv", tmp_path / "copy.csv"], settings=weak, report=False)
    assert [one.path for one in twice.logs] == [str(tmp_path / "one.csv")]
    assert {name: one.std for name, one in twice.parameters.items()} == {
        name: one.std for name, one in once.parameters.items()
    }
    assert any("SAME_LOG" in warning and "copy.csv" in warning for warning in twice.warnings)


def test_logs_of_one_length_and_other_content_stay() -> None:
    logs = [moving_log(4000), moving_log(4000).part(0, 4000)]
    logs[1].theta[0, 7] += 1e-9
    assert len(open_sources(logs, "unloaded", None, 9.81)) == 2
    assert len(open_sources([logs[0], logs[0]], "unloaded", None, 9.81)) == 1


def test_a_cut_that_was_asked_for_is_a_note_and_no_warning(tmp_path: Path) -> None:
    write_log(tmp_path / "one.csv", moving_log(4000))
    result = identify(tmp_path / "one.csv", settings=Settings(estimator="weak"), profile=Profile(start=1), report=False)
    assert result.warnings == []
    (note,) = result.notes
    assert "1000 samples before 1 s" in note
    assert result.log.duration == pytest.approx(2.999)
