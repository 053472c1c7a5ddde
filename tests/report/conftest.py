from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from algid.report.series import Drawn, drawn
from algid.results import Result, read_result
from tests.report.folders import build


@pytest.fixture(scope="session")
def case_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete result folder of case 1, to be read only."""
    folder = tmp_path_factory.mktemp("results") / "case1.algid"
    build(folder, duration=4.0)
    return folder


@pytest.fixture
def folder(case_folder: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    return Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))


@pytest.fixture(scope="session")
def result(case_folder: Path) -> Result:
    return read_result(case_folder)


@pytest.fixture(scope="session")
def raw(case_folder: Path) -> Drawn:
    found = drawn(case_folder / "torque.parquet")
    assert found is not None
    return found
