"""Uniform segments: independent of blocks, exact where stamps are even, cubic where
they are not.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.log import Log, Origin
from algid.signals.segments import segments


def log_at(stamp_ns: np.ndarray) -> Log:
    t = stamp_ns * 1e-9
    theta, tau = np.stack([np.sin(7 * t), t]), np.stack([np.cos(3 * t), t**3])
    return Log(stamp_ns.astype(np.int64), theta, tau, Origin("log", "test", {}))


def blocks(log: Log, rows: int) -> list[Log]:
    return [log.part(first, min(first + rows, len(log))) for first in range(0, len(log), rows)]


EVEN = np.arange(9000) * 1_000_000
JITTERED = np.sort(EVEN + np.random.default_rng(0).normal(0, 1e5, EVEN.size).astype(np.int64))
HOLED = np.delete(JITTERED, [*range(5000, 5020), 100, 101, 7000])


@pytest.mark.parametrize("stamps", [EVEN, JITTERED, HOLED], ids=["even", "jittered", "holed"])
@pytest.mark.parametrize("rows", [333, 4096, 7001])
def test_segments_do_not_depend_on_the_blocks(stamps: np.ndarray, rows: int) -> None:
    log = log_at(stamps)
    whole, cut = list(segments([log])), list(segments(blocks(log, rows)))
    for name in ("theta", "tau"):
        one, other = (
            np.concatenate([getattr(part, name) for part in parts], axis=1)
            for parts in (whole, cut)
        )
        np.testing.assert_array_equal(one, other)
    assert [part.start for part in cut if not part.continues] == [
        part.start for part in whole if not part.continues
    ]
