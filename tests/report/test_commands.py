from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from algid.base.errors import SettingError
from tests.cli.commands import app


@pytest.fixture
def folder(case_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))


def run(*arguments: object) -> tuple[str, str]:
    done = CliRunner().invoke(
        app, [str(argument) for argument in arguments], catch_exceptions=False
    )
    assert done.exit_code == 0
    return done.stdout, done.stderr


def test_compare_tells_sigma_in_every_format(folder: Path) -> None:
    table, _ = run("compare", folder, folder / "result.json")
    assert "Every setting is the same, and every log was read the same way." in " ".join(
        table.split()
    )
    found = json.loads(run("compare", folder, folder, "--format", "json")[0])
    assert found["parameters"]["k1"]["sigma"] == [None, 0.0]
    assert found["settings"] == {}


def test_one_result_is_too_few(folder: Path) -> None:
    with pytest.raises(SettingError, match="expected two results or more, found 1"):
        run("compare", folder)
