"""Logs with nothing wrong are neither withheld nor accused: one of each kind."""

from __future__ import annotations

import pytest

from pipelines.false_alarms import KINDS, draw

APART = 33_333
"""Of draws that no figure of the guide rests on. Of the last one friction's step is a tenth as wide
as noise makes it: no iteration settles at that width."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "number"),
    [
        *((kind, APART + place) for place in range(2) for kind in KINDS),
        (KINDS[0], 16_675),
        ("balanced", 6_072),  # half a turn of θ2 explains it better, by rounding
    ],
)
def test_a_sound_log_is_neither_withheld_nor_accused(kind: str, number: int) -> None:
    assert "withheld" not in draw(kind, 0, number)
