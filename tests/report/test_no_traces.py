"""What is written to keep names no folder that stood for a moment only."""

from __future__ import annotations

import re
from pathlib import Path

from click.testing import CliRunner

from tests.cli.commands import app

TRACE = re.compile(rb"\.[\w.-]+\.(?:algid|track|design)\.[0-9a-f]{8}\b|algid-[a-z0-9_]{8}\b")
CALLS = """\
synth case1 -o {} --duration 2 --torque wide --position-noise 1e-3
identify {}/case1-unloaded.mcap --loaded {}/case1-loaded.mcap -o {} --export mcap
track {}/case1-loaded.mcap --parameters {}/case1-unloaded.algid -o {}
compare {}/case1-unloaded.algid {}/case1-unloaded.algid -o {}/compared
"""


def test_nothing_names_a_folder_that_is_gone(tmp_path: Path) -> None:
    for call in CALLS.replace("{}", str(tmp_path)).splitlines():
        done = CliRunner().invoke(app, call.split())
        assert done.exit_code in (0, 3), done.output
    written = {path.name: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert {"report.html", "report.md", "result.json", "estimates.mcap", "compare.html"} <= {
        *written
    }
    assert not {name for name, content in written.items() if TRACE.search(content)}
