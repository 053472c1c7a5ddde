"""Logs with nothing wrong are neither withheld nor accused: one of each kind."""

from __future__ import annotations

import pytest

from pipelines.false_alarms import KINDS, judged

APART = 200_000  # numbers of logs that no figure of the guide rests on
WIDE_STEP = 100_050
"""Friction's step is a tenth as wide as noise makes it: no iteration settles at that width."""


@pytest.mark.slow
@pytest.mark.parametrize("number", [*range(APART, APART + 2 * len(KINDS)), WIDE_STEP])
def test_a_sound_log_is_neither_withheld_nor_accused(number: int) -> None:
    assert not judged(number).withheld
