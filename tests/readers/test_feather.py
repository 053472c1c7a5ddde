"""Feather files of every type and make: read, or refused in one line, and nothing unpacked that no
log has.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from algid.base.errors import LogError
from algid.log import Log
from algid.readers import read_log

N = 300
T = np.arange(N) / 100
LOG: dict[str, Any] = {
    "t": T,
    "theta1": np.sin(T),
    "theta2": np.cos(2 * T),
    "tau1": 3 * np.cos(T),
    "tau2": np.sin(3 * T),
}
DECIMALS = [Decimal(int(1000 * value)) / 1000 for value in np.sin(T)]
REFUSED = {
    "union": pa.UnionArray.from_sparse(pa.array([0] * N, pa.int8()), [pa.array(T)]),
    "dense union": pa.UnionArray.from_dense(
        pa.array([0] * N, pa.int8()), pa.array(range(N), pa.int32()), [pa.array(T)]
    ),
    "run-end encoded": pa.RunEndEncodedArray.from_arrays(
        pa.array([N], pa.int32()), pa.array([1.0])
    ),
    "interval": pa.array([(1, 2, 3)] * N, pa.month_day_nano_interval()),
    "list view": pa.array([[1.0]] * N, pa.list_view(pa.float64())),
    "map": pa.array([[("a", 1)]] * N, pa.map_(pa.string(), pa.int64())),
    "binary": pa.array([b"x"] * N),
    "nothing": pa.nulls(N),
}


def write(
    path: Path, columns: dict[str, Any], names: list[str] | None = None, **options: Any
) -> Path:
    arrays = [pa.array(one) if isinstance(one, np.ndarray) else one for one in columns.values()]
    table = pa.Table.from_arrays(arrays, names or list(columns))
    written = pa.ipc.IpcWriteOptions(**options)
    with (
        pa.OSFile(str(path), "wb") as sink,
        pa.ipc.new_file(sink, table.schema, options=written) as file,
    ):
        file.write_table(table, max_chunksize=100)
    return path


def right(log: Log) -> bool:
    return len(log) == N and np.allclose(log.theta, [np.sin(T), np.cos(2 * T)], atol=1e-3)


@pytest.mark.parametrize("kind", REFUSED)
def test_a_type_that_holds_no_numbers_is_refused_where_it_is_needed_alone(
    kind: str, tmp_path: Path
) -> None:
    assert right(read_log(write(tmp_path / "log.feather", {**LOG, "extra": REFUSED[kind]})))
    with pytest.raises(LogError, match=r"column 'theta1' for theta1 holds .*; expected numbers"):
        read_log(write(tmp_path / "log.feather", {**LOG, "theta1": REFUSED[kind]}))


@pytest.mark.parametrize(
    "values",
    [
        pa.array(DECIMALS, pa.decimal256(60, 3)),
        pa.array(DECIMALS, pa.decimal128(20, 3)),
        pa.array(np.sin(T).astype(np.float32)),
        pa.array(np.sin(T).astype(np.float16)),
        pa.array(np.sin(T)).dictionary_encode(),
    ],
    ids=lambda values: str(values.type),
)
def test_numbers_of_every_make_are_read(values: pa.Array, tmp_path: Path) -> None:
    assert right(read_log(write(tmp_path / "log.feather", {**LOG, "theta1": values})))
