"""Round trips through every format, other libraries as oracles, recorded logs, and what must be
refused.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from algid.base.errors import LogError
from algid.log import Log, Origin
from algid.readers import read_log
from algid.writers import FORMATS, write_log
from tests.readers.logs import same

FINITE = st.floats(-1e29, 1e29, allow_subnormal=True)


@settings(max_examples=25, deadline=None)
@given(
    values=arrays(np.float64, (4, 2, 5), elements=FINITE),
    steps=arrays(np.int64, 5, elements=st.integers(1, 10**15)),
    kind=st.sampled_from(FORMATS),
)
def test_any_finite_log_survives(
    values: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    steps: np.ndarray[tuple[int, ...], np.dtype[np.int64]],
    kind: str,
) -> None:
    theta, tau, omega, reference = values
    log = Log(np.cumsum(steps), theta, tau, Origin("", "", {}), omega, reference=reference)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log.{kind}"
        write_log(path, log)
        found = read_log(path)
    assert same(found, log)
    assert np.array_equal(found.reference, log.reference)


def test_recorded_mcap_and_csv_of_one_run_agree(shared_data: Path) -> None:
    mcap = read_log(shared_data / "mcap" / "dfki_C1_143601_jointstate.mcap")
    csv = read_log(shared_data / "dfki" / "C1_sysid" / "20230629-143601.csv")
    assert csv.origin.mapping["tau1"] == "tau_meas1"
    assert np.array_equal(mcap.theta, csv.theta)
    assert np.array_equal(mcap.tau, csv.tau)
    assert np.abs(mcap.t - csv.t).max() < 2e-9  # the bag rounds its stamps to nanoseconds


def test_a_repeated_first_stamp_is_dropped_and_told(shared_data: Path) -> None:
    log = read_log(shared_data / "dfki" / "A0_noise" / "down_dt0.002.csv")
    assert [notice.code for notice in log.notices] == ["UNEVEN_STAMPS"]
    assert np.all(np.diff(log.stamp_ns) > 0)


@pytest.mark.parametrize(
    "name",
    [
        "rosbag2_cdr_test_0.mcap",
        "rosbag2_wrong_rmw_test_0.mcap",
        "lichtblick_example_logs_json.mcap",
    ],
)
def test_logs_without_joints_are_refused(name: str, shared_data: Path) -> None:
    with pytest.raises(LogError, match="topic"):
        read_log(shared_data / "mcap" / name)
