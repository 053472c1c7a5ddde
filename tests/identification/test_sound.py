"""Logs with nothing wrong bring no warning, also where dry friction makes the torque jump."""

from __future__ import annotations

import pytest

from pipelines.false_alarms import alarms


@pytest.mark.slow
@pytest.mark.parametrize("number", [33, 113, 209, 289])
def test_a_sound_log_brings_no_warning(number: int) -> None:
    """Of steps taken for spikes, jumps for model errors, wide chosen terms and many tests."""
    assert alarms(number) == []
