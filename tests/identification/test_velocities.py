"""Where velocities come from: the log, or the paper's observer, stretch by stretch."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError, SettingError
from algid.identification.by_paper import run_paper
from algid.identification.passes import with_velocities
from algid.identification.recordings import Recordings, open_source
from algid.log import Log, Origin
from algid.settings import Settings
from algid.signals.segments import Segment, append
from tests.identification.fits import in_blocks


def log_at(stamps: FloatArray, omega: FloatArray | None = None) -> Log:
    """Angles that wander at random at `stamps` in whole periods."""
    theta = np.cumsum(np.random.default_rng(0).normal(0, 1e-2, (2, stamps.size)), axis=1)
    stamp_ns = (stamps * 1_000_000).astype(np.int64)
    return Log(stamp_ns, theta, 5 * np.cos(theta), Origin("walk.csv", "csv", {}), omega)


def observed(log: Log, rows: int, **settings: object) -> list[Segment]:
    """The log, read in blocks of `rows` samples, with velocities: each stretch in one segment."""
    source = in_blocks(log, range(rows, len(log), rows))
    whole: list[Segment] = []
    for part in with_velocities(Recordings([source]), source, Settings().but(**settings)):
        if part.continues:
            whole[-1] = append(whole[-1], part)
        else:
            whole.append(part)
    return whole


def test_the_papers_method_has_its_own_observer() -> None:
    refused = (
        "--set observer zero-phase: the paper's method observes as the paper does; leave it out, "
        "say --set velocity=measured, or use --estimator refined or weak"
    )
    settings = Settings(estimator="paper", observer="zero-phase")
    with pytest.raises(SettingError) as said:
        run_paper(Recordings([open_source(log_at(np.arange(300.0)), "unloaded")]), settings)
    assert str(said.value) == refused


def test_measured_velocities_are_the_logs_whatever_the_observer() -> None:
    omega = np.random.default_rng(1).normal(size=(2, 300))
    (found,) = observed(log_at(np.arange(300.0), omega), 300, velocity="measured")
    np.testing.assert_array_equal(found.omega, omega)


def test_a_log_without_velocities_is_refused_in_one_line_that_says_what_to_do() -> None:
    with pytest.raises(
        LogError,
        match=r"^walk\.csv: expected velocities omega1, omega2 for --set velocity=measured, found "
        r"none; "
        r"they are observed by --set velocity=observer$",
    ):
        observed(log_at(np.arange(300.0)), 300, velocity="measured")
