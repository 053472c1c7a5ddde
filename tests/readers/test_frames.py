"""What flat tables of every format share: their clock, dates, types, rows with gaps, and the look
at other joints.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from algid.base.errors import LogError
from algid.profile import Profile
from algid.readers import read_log

ROWS = 20_000
"""Samples that the message of other joints speaks of."""


def arm(rows: int = ROWS, joints: int = 3) -> pl.DataFrame:
    """Joints that all swing by 0.8 rad, at 1 kHz."""
    t = np.arange(rows) * 1e-3
    angles = {f"q{joint}": 0.4 * np.sin(9 * t + joint) for joint in range(1, joints + 1)}
    return pl.DataFrame(
        {"t": t, **angles, **{f"tau{joint}": np.cos(t + joint) for joint in range(1, joints + 1)}}
    )


def test_whole_stamps_in_lists_stay_exact() -> None:
    """Past 2^53 a float64 would lose the last digits."""
    stamps = [1_700_000_000_123_456_789 + 1_000_001 * row for row in range(5)]
    pairs = {"stamp_ns": [[stamp, 0] for stamp in stamps]}
    table = pa.table(pairs | dict.fromkeys(("q", "tau"), [[1.0, 2.0]] * 5))
    assert read_log(table, Profile(time="stamp_ns[0]")).stamp_ns.tolist() == stamps


SHORT = 300
REFUSED = {
    "union": pa.UnionArray.from_sparse(
        pa.array([0] * SHORT, pa.int8()), [pa.array(np.ones(SHORT))]
    ),
    "run-end encoded": pa.RunEndEncodedArray.from_arrays(
        pa.array([SHORT], pa.int32()), pa.array([1.0])
    ),
    "interval": pa.array([(1, 2, 3)] * SHORT, pa.month_day_nano_interval()),
    "map": pa.array([[("a", 1)]] * SHORT, pa.map_(pa.string(), pa.int64())),
    "binary": pa.array([b"x"] * SHORT),
    "nothing": pa.nulls(SHORT),
    "dates": pa.array(np.arange(SHORT), pa.timestamp("ms", "UTC")),
}


def feather(path: Path, table: pa.Table) -> Path:
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_file(sink, table.schema) as file:
        file.write_table(table, max_chunksize=100)
    return path


@pytest.mark.parametrize("kind", REFUSED)
def test_a_type_that_holds_no_numbers_is_refused_where_it_is_needed_alone(
    kind: str, tmp_path: Path
) -> None:
    table = arm(SHORT, 2).to_arrow()
    beside = feather(tmp_path / "log.feather", table.append_column("extra", REFUSED[kind]))
    assert np.array_equal(read_log(beside).theta[0], table["q1"])
    needed = table.drop(["q1"]).append_column("q1", REFUSED[kind])
    with pytest.raises(LogError, match=r"column 'q1' for theta1 holds .*; expected numbers"):
        read_log(feather(tmp_path / "log.feather", needed))


@pytest.mark.parametrize(
    "times",
    [
        pa.array(np.arange(SHORT) + (1 << 50), pa.duration("s")),
        pa.array(np.arange(SHORT) - (1 << 60), pa.duration("us")),
        pa.array(np.arange(SHORT) * 10 + (1 << 60), pa.timestamp("ms", "UTC")),
        pa.array(np.arange(SHORT, dtype=np.uint64) * np.uint64(10**7) + np.uint64(1 << 63)),
    ],
    ids=str,
)
def test_times_beyond_int64_nanoseconds_are_refused(times: pa.Array) -> None:
    table = arm(SHORT, 2).to_arrow().drop(["t"]).append_column("t", times)
    with pytest.raises(LogError, match="a time beyond 292 years in column 't'"):
        read_log(table)


def test_checksums_of_parquet_pages_are_verified(tmp_path: Path) -> None:
    path, frame = tmp_path / "log.parquet", arm(2000, 2)
    stored: dict[str, Any] = {"write_page_checksum": True, "compression": "none"}
    pq.write_table(frame.to_arrow(), path, row_group_size=500, **stored)
    content = bytearray(path.read_bytes())
    content[content.index(struct.pack("<d", frame["q1"][1234]))] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogError, match="CRC checksum"):
        read_log(path)


def test_structures_of_a_list_are_known_by_their_names_in_any_order() -> None:
    rows = []
    for row in range(50):
        joints = [{"name": one, "position": float(row), "effort": 0.1 * row} for one in "ab"]
        joints[1]["position"] = -float(row)
        rows.append(joints[:: -1 if row % 3 else 1])
    log = read_log(pa.table({"t": np.arange(50) * 1e-3, "joints": rows}))
    assert np.array_equal(log.theta, np.outer([1, -1], np.arange(50)))
    assert log.origin.mapping["tau2"] == "/joints/b/effort"
