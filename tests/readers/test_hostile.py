"""Damaged and hostile files: an answer or one clear line, in bounded memory, and never a silent
change.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import struct
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard

from algid.base.errors import LogError
from algid.readers import read_log
from algid.writers import write_log
from pipelines.mutations import clean_log
from tests.conftest import Limited
from tests.readers.logs import TRUTH, same


@pytest.mark.parametrize("columns", [5_000, 1_000_000])
def test_countless_columns_are_refused(columns: int, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(",".join(f"c{place}" for place in range(columns)) + "\n1\n")
    with pytest.raises(LogError, match=r"columns|line of more than"):
        read_log(tmp_path / "log.csv")


def test_names_with_control_characters_do_not_break_a_message(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,<script>x</script>,\u202eq1,tau1\n1,2,3,4\n2,3,4,5\n")
    with pytest.raises(LogError, match="no column for") as caught:
        read_log(tmp_path / "log.csv")
    assert "\u202e" not in str(caught.value)


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"bad\xff.csv")
    path.write_text("t,theta1,theta2,tau1,tau2\n0,0,0,0,0\n")
    with pytest.raises(LogError, match="not valid UTF-8; rename"):
        read_log(path)


TABLE = b"t,theta1,theta2,tau1,tau2\n" + b"".join(
    b"%d,0.%d,1,2.5,-3\n" % (row, row) for row in range(3000)
)


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_compressed_text_that_breaks_off_is_refused(share: float, tmp_path: Path) -> None:
    for name, packed in (
        ("log.csv.gz", gzip.compress(TABLE)),
        ("log.csv.zst", zstandard.compress(TABLE)),
    ):
        (tmp_path / name).write_bytes(packed)
        assert len(read_log(tmp_path / name)) == 3000
        (tmp_path / name).write_bytes(packed[: int(len(packed) * share)])
        with pytest.raises(LogError, match="damaged or cut off"):
            read_log(tmp_path / name)


def test_text_that_unpacks_to_more_than_any_table_is_refused(
    tmp_path: Path, limited: Limited
) -> None:
    limited(free_text_bytes=1 << 24)
    stream = zstandard.ZstdCompressor().compressobj()
    with (tmp_path / "log.csv.zst").open("wb") as file:
        file.write(stream.compress(TABLE))
        for _ in range(40):
            file.write(stream.compress(b"\n" * (1 << 23)))
        file.write(stream.flush())
    with pytest.raises(
        LogError, match="as no table of their size does; if it is one, unpack it first"
    ):
        read_log(tmp_path / "log.csv.zst")


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.csv")
    for path in (tmp_path / "log.csv", Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(LogError, match="no regular file"):
            read_log(path)


@pytest.mark.parametrize("name", ["col[1]", "a*", "q?", "**", "{a,b}", "~"])
@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_a_path_is_no_pattern(name: str, kind: str, tmp_path: Path) -> None:
    write_log(tmp_path / f"{name}.{kind}", clean_log(20))
    for other in ("col1", "ab", "qq", "a", "b"):
        write_log(tmp_path / f"{other}.{kind}", clean_log(10))
    assert same(read_log(tmp_path / f"{name}.{kind}"), clean_log(20))


def arm_table(rows: int = 2000) -> pa.Table:
    log = clean_log(rows)
    columns = {
        "t": log.t,
        "theta1": log.theta[0],
        "theta2": log.theta[1],
        "tau1": log.tau[0],
        "tau2": log.tau[1],
    }
    return pa.table({name: pa.array(values) for name, values in columns.items()})


@pytest.mark.parametrize(
    "options", [{"use_dictionary": False}, {"use_dictionary": True}, {"data_page_version": "2.0"}]
)
def test_checksums_of_parquet_pages_are_verified(options: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    pq.write_table(
        arm_table(),
        path,
        write_page_checksum=True,
        compression="none",
        row_group_size=500,
        **options,
    )
    assert len(read_log(path)) == 2000
    content = bytearray(path.read_bytes())
    content[content.index(struct.pack("<d", clean_log(2000).theta[0, 1234]))] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogError, match="CRC checksum"):
        read_log(path)


@pytest.mark.parametrize("number", [math.nan, math.inf, 10**400])
def test_a_truth_that_is_no_number_is_refused(number: float, tmp_path: Path) -> None:
    content = {"sums": {}, "arm": asdict(TRUTH.arm), "payload": number, "case": None}
    text = json.dumps(
        {**content, "crc32": zlib.crc32(json.dumps(content, sort_keys=True).encode())}
    )
    pq.write_table(arm_table().replace_schema_metadata({"algid": text}), tmp_path / "log.parquet")
    with pytest.raises(LogError, match=r"truth in the .* file is damaged"):
        read_log(tmp_path / "log.parquet")


@pytest.mark.parametrize(
    "header", ["t,theta1,theta2,tau1,tau2", '"t","theta1","theta2","tau1","tau2"']
)
@pytest.mark.parametrize("end", ["", "\n", "\n1,2,3,4,5\n"])
def test_lines_that_end_in_carriage_returns_alone_are_refused(
    header: str, end: str, tmp_path: Path
) -> None:
    rows = [f"{row},0,0,0,0" for row in range(30)]
    (tmp_path / "log.csv").write_bytes(("\r".join([header, *rows]) + end).encode())
    with pytest.raises(LogError, match="carriage returns alone"):
        read_log(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_bytes(("\r\n".join([header, *rows]) + "\r\n").encode())
    assert len(read_log(tmp_path / "log.csv")) == 30
