"""What a table loses is counted or refused: rows of commas, rows between quotes, times that wrap,
a clock set back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.log import Log
from algid.readers import read_log

HEAD = "t,theta1,theta2,tau1,tau2"
N = 1000
T = np.arange(N) / 100


def signals(t: FloatArray) -> dict[str, FloatArray]:
    return {
        "theta1": np.sin(2 * t),
        "theta2": np.cos(3 * t),
        "tau1": np.cos(t),
        "tau2": np.sin(2 * t),
    }


def rows_of(stamps: list[Any], t: FloatArray) -> list[str]:
    columns = zip(stamps, *(values.tolist() for values in signals(t).values()), strict=True)
    return [",".join(map(str, row)) for row in columns]


ROWS = rows_of(T.tolist(), T)


def read(folder: Path, *lines: str) -> Log:
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    return read_log(folder / "log.csv")


def lost(log: Log) -> list[str]:
    return [notice.text for notice in log.notices if notice.lossy]


@pytest.mark.parametrize("row", [",,,,,", " , ,,, ,", ",,,,,x", '"","",,,,'])
@pytest.mark.parametrize("place", [500, 900])
def test_rows_without_a_value_are_counted(row: str, place: int, tmp_path: Path) -> None:
    noted = [f"{one},x" for one in ROWS]
    log = read(tmp_path, f"{HEAD},note", *noted[:place], *[row, ""] * 50, *noted[place + 50 :])
    assert len(log) == N - 50
    assert lost(log) == ["50 of 1,000 rows dropped for want of a value"]


@pytest.mark.parametrize("quoted", ['"x', 'a"b', '"'])
@pytest.mark.parametrize("closed", [True, False])
def test_rows_between_quotes_are_refused(quoted: str, closed: bool, tmp_path: Path) -> None:
    noted = [f"{one},x" for one in ROWS]
    noted[500] = f"{ROWS[500]},{quoted}"
    noted[700] = f'{ROWS[700]},x"' if closed else noted[700]
    with pytest.raises(LogError, match=r"past row \d+: .*(quotes|malformed)|row 501 .* quotes"):
        read(tmp_path, f"{HEAD},note", *noted)


@pytest.mark.parametrize("note", ['"x, y"', '"x\ny"', '"x ""y"" z"', "x"])
def test_texts_in_quotes_are_texts(note: str, tmp_path: Path) -> None:
    log = read(tmp_path, f"{HEAD},note", *(f"{one},{note}" for one in ROWS))
    assert len(log) == N
    assert lost(log) == []


@pytest.mark.parametrize(
    "day", ["0001-01-01", "1600-02-29", "1677-09-21", "2262-04-12", "2300-01-01", "9999-12-31"]
)
def test_dates_beyond_int64_nanoseconds_are_refused(day: str, tmp_path: Path) -> None:
    dates = [f"{day}T00:00:{second:05.2f}Z" for second in T]
    with pytest.raises(LogError, match=r"past row 0: .*expected dates of 1678 to 2261"):
        read(tmp_path, HEAD, *rows_of(dates, T))


WRITERS: Mapping[str, Callable[[pa.Table, Path], Any]] = {
    "parquet": pq.write_table,
    "feather": lambda table, path: feather.write_feather(table, path, compression="uncompressed"),
}


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    "times",
    [
        pa.array(np.arange(N) + (1 << 50), pa.duration("s")),
        pa.array(np.arange(N) - (1 << 60), pa.duration("us")),
        pa.array(np.arange(N) + (1 << 40), pa.timestamp("s")),
        pa.array(np.arange(N) * 10 + (1 << 60), pa.timestamp("ms", "UTC")),
        pa.array(np.arange(N, dtype=np.uint64) * np.uint64(10**7) + np.uint64(1 << 63)),
    ],
    ids=str,
)
def test_times_beyond_int64_nanoseconds_are_refused(
    kind: str, times: pa.Array, tmp_path: Path
) -> None:
    WRITERS[kind](pa.table({"t": times, **signals(T)}), tmp_path / "log")
    with pytest.raises(LogError, match="a time beyond 292 years in column 't'"):
        read_log(tmp_path / "log")
