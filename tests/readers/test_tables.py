"""Tables as people have them: titles, units under the header, dates, empty cells."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.readers import read_log

ROWS = [(0.0, 10, 20, 30, 40), (0.001, 11, 21, 31, 41), (0.002, 12, 22, 32, 42)]


def text_of(
    rows: Sequence[tuple[float, ...]],
    header: str = "time,q1,q2,tau1,tau2",
    above: str = "",
    units: str = "",
) -> str:
    lines = [",".join(f"{value:g}" for value in row) for row in rows]
    return above + "\n".join([header, *([units] if units else []), *lines]) + "\n"


def written(folder: Path, text: str) -> Path:
    (folder / "log.csv").write_text(text)
    return folder / "log.csv"


@pytest.mark.parametrize(
    "units", ["s,deg,deg,mNm,Nm", "[s],[deg],[deg],[mN m],[N m]", ",degrees,degrees,(mNm),"]
)
def test_a_row_of_units_under_the_header(units: str, tmp_path: Path) -> None:
    log = read_log(written(tmp_path, text_of(ROWS, units=units)))
    assert np.allclose(log.theta[0], np.radians([10, 11, 12]))
    assert np.allclose(log.tau, [[0.030, 0.031, 0.032], [40.0, 41.0, 42.0]])
    assert log.origin.reading.channels["tau1"].unit == "mN m"
    assert len(log) == 3


@pytest.mark.parametrize(
    "above",
    [
        "Recorded by the test bench\n",
        "Arm 7, run 3\nOperator: N. N.\n\n",
        "a;b;c\nDate,2026-01-01\nrate [Hz],1000\n",
    ],
)
@pytest.mark.parametrize("units", ["", "s,rad,rad,Nm,Nm"])
def test_titles_above_the_header(above: str, units: str, tmp_path: Path) -> None:
    log = read_log(written(tmp_path, text_of(ROWS, above=above, units=units)))
    assert log.theta.tolist() == [[10, 11, 12], [20, 21, 22]]
    assert log.stamp_ns.tolist() == [0, 1_000_000, 2_000_000]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2026-01-02T03:04:05.000000", "2026-01-02T03:04:05.001000"),
        ("2026-01-02 03:04:05", "2026-01-02 03:04:05.001"),
        ("2026-01-02T03:04:05.000Z", "2026-01-02T03:04:05.001Z"),
        ("2026-01-02T05:04:05.000+02:00", "2026-01-02T05:04:05.001+02:00"),
    ],
)
def test_dates_as_times(first: str, second: str, tmp_path: Path) -> None:
    text = f"timestamp,q1,q2,tau1,tau2\n{first},1,2,3,4\n{second},1,2,3,4\n"
    log = read_log(written(tmp_path, text))
    start = int(np.datetime64("2026-01-02T03:04:05", "ns").astype(np.int64))
    assert log.stamp_ns.tolist() == [start, start + 1_000_000]
    assert log.origin.reading.time_unit == "ns"


def test_topics_that_share_no_row_are_refused(tmp_path: Path) -> None:
    rows = [f"{place * 1e-3:g},{'1,2,,' if place % 2 else ',,3,4'}" for place in range(10)]
    with pytest.raises(LogError, match="no row has a value in every column"):
        read_log(written(tmp_path, "time,q1,q2,tau1,tau2\n" + "\n".join(rows) + "\n"))
