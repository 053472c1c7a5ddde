"""What a stretch of a log is cut to."""

from __future__ import annotations

import numpy as np
import pytest

from algid.signals.differences import Stencil
from algid.signals.segments import Segment
from algid.tracks.payload import cut_to


@pytest.mark.parametrize("shift", [0.0, 0.004, 0.0125, -0.007])
@pytest.mark.parametrize("dt", [1e-3, 2e-3])
def test_the_torques_of_a_cut_are_those_of_its_stretch(dt: float, shift: float) -> None:
    n = 2000
    segment = Segment(5.0, dt, np.zeros((2, n)), np.arange(2.0 * n).reshape(2, n))
    start, end = 5.0 + 300 * dt, 5.0 + 1100 * dt
    part = cut_to(segment, start, end, shift)
    assert part is not None
    told = Stencil(dt, shift).torques(len(part))
    assert part.start + told.start * dt == pytest.approx(start, abs=1e-9)
    assert part.start + told.stop * dt == pytest.approx(end, abs=1e-9)
    assert part.tau[0, told.start] == 300
    whole = cut_to(segment, 0.0, 100.0, shift)
    assert whole is not None
    assert len(whole) == n
    assert cut_to(segment, 0.0, 4.0, shift) is None
