"""A URL where a file is meant: no door makes a folder of it, and none prints its secret."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import algid
from tests.processes import Outcome

PLACES = ["s3://KEY:SECRET@lab/x", "s3:/KEY:SECRET@lab/x", "S3://KEY:SECRET@lab/x"]
PLACES += ["http://KEY:SECRET@lab/x", "https://KEY:SEC/RET@lab/x"]
QUICK = ("--estimator", "weak", "--model", "plain")
WRITING = {
    "identify": ("identify", "LOG", *QUICK, "-o", "URL"),
    "convert": ("convert", "LOG", "-o", "URL.csv"),
    "synth": ("synth", "case1", "--duration", "1", "-o", "URL"),
    "track": ("track", "LOG", "--parameters", "RESULT", "-o", "URL"),
    "export": ("export", "RESULT", "--to", "urdf", "-o", "URL.urdf"),
    "compare": ("compare", "RESULT", "RESULT", "-o", "URL.html"),
    "example": ("synth", "example", "-o", "URL"),
    "design": ("design", "RESULT", "--range", "1", "--speed", "1", "--torque", "9", "-o", "URL"),
    "batch": ("batch", "LOG", *QUICK, "-o", "URL"),
    "batch on Dask": ("batch", "LOG", "-o", "URL", "--scheduler", "tcp://127.0.0.1:1"),
}
READING = {
    "inspect": ("inspect", "URL.csv"),
    "identify": ("identify", "URL.csv", "--profile", "URL.toml"),
    "a log": ("identify", "URL.csv", "-o", "out"),
    "a torque file": ("identify", "LOG", "--torque-file", "URL.csv"),
    "validate": ("validate", "URL", "LOG"),
    "report": ("report", "URL"),
    "export": ("export", "URL", "--to", "urdf"),
    "compare": ("compare", "URL", "URL"),
    "limits": ("validate", "URL", "--max-error", "URL.toml"),
    "track": ("track", "URL.csv", "--parameters", "URL"),
    "batch": ("batch", "URL.toml", "-o", "out"),
    "an argument too many": ("inspect", "LOG", "URL"),
}


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``log.csv`` and its result."""
    folder = tmp_path_factory.mktemp("arm")
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide", seed=0)
    algid.write_log(folder / "log.csv", log)
    algid.identify(
        folder / "log.csv", estimator="weak", model="plain", out=folder, report=False, name="arm"
    )
    return folder


def _told(words: tuple[str, ...], url: str, arm: Path, place: Path) -> Outcome:
    known = {"LOG": str(arm / "log.csv"), "RESULT": str(arm / "arm.algid")}
    return Outcome(*(known.get(word, word.replace("URL", url)) for word in words), cwd=place)


@pytest.mark.parametrize("url", PLACES)
@pytest.mark.parametrize("door", WRITING)
def test_no_folder_is_made_of_a_url(door: str, url: str, arm: Path, tmp_path: Path) -> None:
    if door.startswith("batch") and url.startswith("s3://"):
        return  # it is meant there
    done = _told(WRITING[door], url, arm, tmp_path)
    assert (done.code, list(tmp_path.iterdir())) == (2, [])
    assert done.err.count("\n") == 1
    assert "expected a folder of this machine, found a URL" in done.err
    for secret in ("SECRET", "SEC/RET", "KEY"):
        assert secret not in done.out + done.err


@pytest.mark.parametrize("door", READING)
def test_no_reading_door_prints_a_secret(door: str, arm: Path, tmp_path: Path) -> None:
    for url in PLACES:
        if door == "batch" and url.startswith("s3://"):
            continue  # it is meant there
        done = _told(READING[door], url, arm, tmp_path)
        assert done.code == 2, done.out
        assert done.err
        for secret in ("SECRET", "SEC/RET", "KEY"):
            assert secret not in done.out + done.err
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
