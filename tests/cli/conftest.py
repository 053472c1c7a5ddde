"""What several tests of commands read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.processes import Outcome


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result of a short log of case 1, which stands beside it."""
    folder = tmp_path_factory.mktemp("result")
    noisy = ("--position-noise", "1e-3", "--torque-noise", "1e-2")
    assert (
        Outcome("synth", "case1", "-o", folder, "--torque", "wide", "--duration", "4", *noisy).code
        == 0
    )
    assert (
        Outcome("identify", folder / "case1-unloaded.mcap", "-o", folder, "--no-report", "-q").code
        == 0
    )
    return folder / "case1-unloaded.algid"
