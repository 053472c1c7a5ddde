"""Tables without a time or a header: what a user says in their place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import algid
from algid.base.errors import LogError
from algid.writers import write_log


@pytest.fixture(scope="module")
def log() -> algid.Log:
    return algid.synthesise("case1", duration=1.0, rate=200.0, torque="wide")[0]


def columns(log: algid.Log) -> dict[str, np.ndarray]:
    return {
        "theta1": log.theta[0],
        "theta2": log.theta[1],
        "tau1": log.tau[0],
        "tau2": log.tau[1],
    }


def test_a_row_that_lacks_a_value_has_no_time_to_be_counted_by(log: algid.Log) -> None:
    torque = [None if row == 7 else value for row, value in enumerate(log.tau[1].tolist())]
    frame = pl.DataFrame(columns(log)).with_columns(tau2=pl.Series(torque))
    with pytest.raises(LogError, match="rows lack a value, and without a time"):
        algid.read_log(frame, algid.Profile(rate=200.0))


def test_columns_of_a_table_without_a_header_are_named(log: algid.Log, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    write_log(path, algid.Log.from_arrays(log.t, log.theta, log.tau))
    rows = path.read_text(encoding="utf-8").splitlines()[1:]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    seen = algid.inspect(path)
    assert [one.name for one in seen.entries] == [f"column {n}" for n in range(1, 6)]
    assert seen.refused is not None
    assert "no column for t, theta1, theta2, tau1, tau2; found 'column 1', 'co" in seen.refused
    found = algid.inspect(path, columns="t,theta1,theta2,tau1,tau2")
    assert found.refused is None
    own = algid.read_log(path, algid.Profile(columns=("t", "theta1", "theta2", "tau1", "tau2")))
    assert own.theta == pytest.approx(log.theta)
    assert len(own) == len(log)
    with pytest.raises(LogError, match=r"5 columns, and 2 names for them: t, q1; name each"):
        algid.read_log(path, algid.Profile(columns=("t", "q1")))
