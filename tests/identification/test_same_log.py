"""A log that is given twice counts once."""

from __future__ import annotations

import shutil
from pathlib import Path

from algid.identification.identify import identify
from algid.settings import Settings
from algid.writers import write_log
from tests.inspection.test_checks import moving_log


def test_one_log_as_unloaded_and_as_loaded_is_told_in_one_line(tmp_path: Path) -> None:
    write_log(tmp_path / "one.csv", moving_log(4000))
    shutil.copy(tmp_path / "one.csv", tmp_path / "copy.csv")
    settings = Settings(estimator="weak", model="plain")
    result = identify(tmp_path / "one.csv", tmp_path / "copy.csv", settings, report=False)
    (said,) = (one for one in result.notices if one.code == "SAME_LOG")
    assert said.numbers == {
        "case": "loaded",
        "name": str(tmp_path / "copy.csv"),
        "twin": str(tmp_path / "one.csv"),
        "share": 100.0,
    }
