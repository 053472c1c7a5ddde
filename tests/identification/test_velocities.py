"""Where velocities come from: the log, the paper's observer, or the zero-phase differentiator,
stretch by stretch.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.identification.passes import with_velocities
from algid.identification.recordings import Recordings
from algid.log import Log, Origin
from algid.settings import Settings
from algid.signals.filters import differentiator, half_length
from algid.signals.segments import Segment, append
from tests.identification.fits import in_blocks

DT = 1e-3
BANDWIDTH = 60.0
REACH = half_length(DT, BANDWIDTH)


def log_at(stamps: FloatArray, omega: FloatArray | None = None) -> Log:
    """Angles that wander at random at `stamps` in whole periods."""
    theta = np.cumsum(np.random.default_rng(0).normal(0, 1e-2, (2, stamps.size)), axis=1)
    stamp_ns = (stamps * 1_000_000).astype(np.int64)
    return Log(stamp_ns, theta, 5 * np.cos(theta), Origin("walk.csv", "csv", {}), omega)


def observed(log: Log, rows: int, *, luenberger: bool = False, **settings: object) -> list[Segment]:
    """The log, read in blocks of `rows` samples, with velocities: each stretch in one segment."""
    source = in_blocks(log, range(rows, len(log), rows))
    whole: list[Segment] = []
    wanted = Settings(bandwidth=BANDWIDTH).but(**settings)
    for part in with_velocities(Recordings([source]), source, wanted, luenberger=luenberger):
        if part.continues:
            whole[-1] = append(whole[-1], part)
        else:
            whole.append(part)
    return whole


def differentiated(theta: FloatArray) -> FloatArray:
    """By NumPy's convolution, both ends turned about their last sample."""
    extended = np.pad(theta, ((0, 0), (REACH, REACH)), mode="reflect", reflect_type="odd")
    return np.stack([np.correlate(row, differentiator(DT, BANDWIDTH), "valid") for row in extended])


TWO = np.concatenate([np.arange(6000.0), np.arange(6100.0, 6900.0)])


@pytest.mark.parametrize("rows", [6800, 700, 97])
def test_the_differentiator_does_not_see_blocks_and_starts_anew_behind_a_gap(rows: int) -> None:
    log = log_at(TWO)
    first, second = observed(log, rows)
    for found, own in ((first, slice(0, 6000)), (second, slice(6000, None))):
        np.testing.assert_array_equal(found.theta, log.theta[:, own])
        np.testing.assert_allclose(found.omega, differentiated(log.theta[:, own]), atol=1e-9)
    assert second.start == pytest.approx(6.1, abs=1e-9)


def test_measured_velocities_are_the_logs_whatever_the_observer() -> None:
    omega = np.random.default_rng(1).normal(size=(2, 300))
    for luenberger in (False, True):
        (found,) = observed(
            log_at(np.arange(300.0), omega), 300, luenberger=luenberger, velocity="measured"
        )
        np.testing.assert_array_equal(found.omega, omega)


def test_a_log_without_velocities_is_refused_in_one_line_that_says_what_to_do() -> None:
    with pytest.raises(
        LogError,
        match=r"^walk\.csv: expected velocities omega1, omega2 for --set velocity=measured, found "
        r"none; "
        r"they are observed by --set velocity=observer$",
    ):
        observed(log_at(np.arange(300.0)), 300, velocity="measured")
