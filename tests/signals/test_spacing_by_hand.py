"""Clusters of a few samples, put where they belong by hand."""

from __future__ import annotations

import numpy as np
import pytest

from algid.log import Log, Origin, join
from algid.signals.spacing import near_stamps, spaced

PERIOD = 1e-3
US = 1000  # ns


def log_of(us: list[int], angles: list[float], *, omega: bool = False) -> Log:
    """Stamps in µs.

    Both joints turn alike, joint 2 the other way round, torques ten times as large.
    """
    theta = np.array([angles, [-one for one in angles]], dtype=np.float64)
    return Log(
        np.array(us) * US,
        theta,
        10 * theta,
        Origin("log", "test", {}),
        100 * theta if omega else None,
    )


def settled(log: Log) -> Log:
    return join(spaced([log], PERIOD))


def test_a_sample_sent_twice_is_the_mean_of_both() -> None:
    log = log_of([0, 1000, 2000, 2002, 3000], [0.0, 1.0, 2.0, 2.2, 3.0], omega=True)
    found = settled(log)
    assert (found.stamp_ns // US).tolist() == [0, 1000, 2001, 3000]
    assert found.theta[0].tolist() == pytest.approx([0, 1, 2.1, 3], abs=1e-12)
    assert found.tau[1].tolist() == pytest.approx([0, -10, -21, -30], abs=1e-12)
    assert found.omega[0].tolist() == pytest.approx([0, 100, 210, 300], abs=1e-9)


def test_a_sample_that_comes_with_its_successor_goes_back_to_its_own_period() -> None:
    """The sample of 2 ms is stamped 2 µs before that of 3 ms; the angle turned evenly."""
    found = settled(log_of([0, 1000, 2998, 3000, 4000], [0.0, 1.0, 2.0, 3.0, 4.0]))
    assert (found.stamp_ns // US).tolist() == [0, 1000, 2000, 3000, 4000]
    assert found.theta[0].tolist() == [0, 1, 2, 3, 4]


def test_a_late_cluster_fills_as_many_periods_as_lack_samples_and_no_other() -> None:
    """Three samples of 2, 3, 4 ms come at once at 4 ms.

    The same three after four periods are one instant.
    """
    late = settled(log_of([0, 1000, 3996, 3998, 4000, 5000], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]))
    assert (late.stamp_ns // US).tolist() == [0, 1000, 2000, 3000, 4000, 5000]
    other = settled(log_of([0, 1000, 4996, 4998, 5000, 6000], [0.0, 1.0, 2.0, 3.0, 4.0, 6.0]))
    assert (other.stamp_ns // US).tolist() == [0, 1000, 4998, 6000]
    assert other.theta[0].tolist() == pytest.approx([0, 1, 3, 6], abs=1e-12)


@pytest.mark.parametrize(("step", "count"), [(300, 0), (299, 1)])
def test_near_is_less_than_three_tenths_of_a_period(step: int, count: int) -> None:
    stamps = np.array([0, 1000, 1000 + step, 2000]) * US
    assert near_stamps(stamps, PERIOD) == count
    log = Log(stamps, np.zeros((2, 4)), np.zeros((2, 4)), Origin("log", "test", {}))
    assert len(settled(log)) == 4 - count
