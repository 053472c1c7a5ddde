"""How much memory long logs take, read in blocks as identification reads them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow as pa
import pytest
import zstandard

from algid.arm import FloatArray
from tests.readers.large import WRITERS as MESSAGES
from tests.readers.large import peak_of_reading
from tests.readers.ways import store, store_table

MOST_BYTES = 600e6
"""What reading 1e7 samples may take."""
MOST_PACKED = 420e6
"""Of 4e6 samples: blocks in hand and their arrays once, 160 MB, beside 100 MB of the program."""
MOST_MESSAGES = 160e6
"""Of 1.5e6 messages: the samples' arrays alone take 60 MB, beside some 60 MB of a program that
reads nothing."""
INDEXED = 200
"""Bytes a message that rosbags takes for the index of a ROS 1 bag."""
ROW = 50  # bytes of a row of text, which polars unpacks whole where it is packed

Columns = dict[str, FloatArray]


WRITERS: dict[str, Callable[[Path, Columns], object]] = {
    "csv": lambda path, columns: pl.DataFrame(columns).write_csv(path, float_precision=6),
    "csv.zst": lambda path, columns: path.write_bytes(
        zstandard.compress(pl.DataFrame(columns).write_csv(float_precision=6).encode(), 1)
    ),
    "parquet": lambda path, columns: store_table(path, pa.table(columns)),
    "feather": lambda path, columns: store_table(path, pa.table(columns)),
    "one.feather": lambda path, columns: pl.DataFrame(columns).write_ipc(path),
    "npz": store,
    "packed.npz": partial(store, packed=True),
    "mat": store,
    "packed.mat": partial(store, packed=True),
}


def _write(path: Path, kind: str, rows: int) -> None:
    one = 2 * np.pi * np.arange(1000) / 1000  # a second, over and over: it packs quickly
    motion = {
        "theta1": np.sin(2 * one),
        "theta2": np.cos(3 * one),
        "tau1": np.cos(one),
        "tau2": np.sin(one),
    }
    columns: Columns = {"t": np.arange(rows) / 1000}
    columns |= {name: np.tile(values, rows // 1000) for name, values in motion.items()}
    WRITERS[kind](path, columns)


def _size(kind: str) -> tuple[int, float]:
    """Samples of a log, and the most bytes that reading it may take."""
    if kind in MESSAGES:
        samples = 1_500_000
        return samples, MOST_MESSAGES + INDEXED * samples * (kind == "bag")
    if kind.startswith("packed") or kind.endswith(".zst"):  # which takes long to make
        samples = 4_000_000
        return samples, MOST_PACKED + ROW * samples * (kind == "csv.zst")
    return 10_000_000, MOST_BYTES


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="the system does not tell a program's peak"
)
@pytest.mark.parametrize("kind", [*WRITERS, *MESSAGES])
def test_long_logs_are_read_in_bounded_memory(kind: str, tmp_path: Path) -> None:
    samples, most = _size(kind)
    path = tmp_path / f"log.{kind}"
    try:
        if kind in MESSAGES:
            MESSAGES[kind](path, samples)
        else:
            _write(path, kind, samples)
        rows, peak = peak_of_reading(path)
    finally:
        path.unlink(missing_ok=True)
    assert rows == samples
    print(f"{kind}: {peak / 1e6:.0f} MB")
    assert peak < most, f"{peak / 1e6:.0f} MB"
