"""A log that is given twice counts once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from algid.identification.identify import identify
from algid.results import read_result
from algid.settings import Settings
from algid.writers import write_log
from tests.cli.commands import app
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


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ((), 0.0),
        (("--gravity", "9.81"), 9.81),
        (("--set", "gravity=3.7"), 3.7),
    ],
)
def test_gravity_flag_over_profile_over_default(
    flags: tuple[str, ...], expected: float, tmp_path: Path
) -> None:
    write_log(tmp_path / "one.csv", moving_log(4000))
    (tmp_path / "algid.toml").write_text("gravity = 0\n")
    command = [
        "identify",
        str(tmp_path / "one.csv"),
        "-o",
        str(tmp_path),
        "--profile",
        str(tmp_path / "algid.toml"),
    ]
    more = ["--estimator", "weak", "--model", "plain", "--no-report", "-q", *flags]
    CliRunner().invoke(app, [*command, *more])
    assert read_result(tmp_path / "one.algid").settings["gravity"] == expected
