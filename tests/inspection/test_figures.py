"""Figures of a signal against what it was made with."""

from __future__ import annotations

import numpy as np
import pytest

from algid.inspection.figures import saturated_share


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ([0, 1, 2, 3, 4, 3, 2, 1], 0),
        ([1, 4, 4, 1, 4, 4, 1, 0, 0], 0),  # pairs
        ([1, 4, 4, 4, 1, 2, 0, 3], 1),
        ([1, 4, 4, 4, 4, 4, 2, 0, 0, 0], 4),
        ([4, 0, 4, 1, 2, 4], 1),  # from stop to stop
        ([3, 4, 2, 4, 4, 3, 0], 0),
        ([2, 2, 2, 2], 0),  # that never moves is none that stops
        ([0, 4], 0),
    ],
)
def test_samples_between_two_others_at_a_stop_are_counted(values: list[float], count: int) -> None:
    assert saturated_share(np.array(values, dtype=np.float64)) == pytest.approx(count / len(values))
