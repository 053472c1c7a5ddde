"""What is written to keep names no folder that stood for a moment only."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.cli.commands import app

TRACE = re.compile(rb"\.[\w.-]+\.(?:algid|track|design)\.[0-9a-f]{8}\b|algid-[a-z0-9_]{8}\b")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A synthetic pair of logs, and what each command makes of them."""
    place = tmp_path_factory.mktemp("traces")
    calls = (
        [
            "synth",
            "case1",
            "-o",
            "{}",
            "--duration",
            "2",
            "--torque",
            "wide",
            "--position-noise",
            "1e-3",
        ],
        [
            "identify",
            "{}/case1-unloaded.mcap",
            "--loaded",
            "{}/case1-loaded.mcap",
            "-o",
            "{}",
            "--export",
            "mcap",
        ],
        ["track", "{}/case1-loaded.mcap", "--parameters", "{}/case1-unloaded.algid", "-o", "{}"],
        ["compare", "{}/case1-unloaded.algid", "{}/case1-unloaded.algid", "-o", "{}/compared"],
    )
    for call in calls:
        done = CliRunner().invoke(app, [word.format(place) for word in call])
        assert done.exit_code in (0, 3), done.output
    return place


def test_nothing_names_a_folder_that_is_gone(folder: Path) -> None:
    written = [path for path in folder.rglob("*") if path.is_file()]
    assert {"report.html", "report.md", "result.json", "estimates.mcap", "compare.html"} <= {
        p.name for p in written
    }
    traces = {
        path.name: TRACE.findall(path.read_bytes()) for path in written if path.suffix != ".gz"
    }
    assert not {name: found for name, found in traces.items() if found}
