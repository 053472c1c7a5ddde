"""Damaged and hostile files: an answer or one clear line, in bounded memory, and never a silent
change.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
import tracemalloc
import zlib
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow.parquet import encryption

from algid.batches.manifest import is_manifest
from algid.errors import LogError
from algid.files import read_whole, sha256_of
from algid.readers import read_log
from algid.readers.mcap.framing import DamagedError, unpack
from algid.writers import write_log
from pipelines.mutations import clean_files, clean_log, damage
from tests.conftest import Limited
from tests.readers.logs import TRUTH, same


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    paths = clean_files(tmp_path_factory.mktemp("clean"))
    content = {path.suffix: path.read_bytes() for path in paths}
    content["truth"] = paths[0].with_name("clean.csv.truth.json").read_bytes()
    return content


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32), kind=st.sampled_from([".mcap", ".csv", ".parquet"]))
def test_damage_is_refused_told_or_harmless(seed: int, kind: str, clean: dict[str, bytes]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{kind}"
        path.write_bytes(damage(clean[kind], random.Random(seed)))
        (Path(folder) / "log.csv.truth.json").write_bytes(clean["truth"])
        told = ""
        try:
            found = read_log(path)
        except LogError as error:
            told = str(error)
    if told:
        assert "\n" not in told
    else:
        assert found.notices or same(found, clean_log())


def chunk(size: int, packed: bytes, name: bytes = b"zstd", crc: int = 0) -> bytes:
    head = struct.pack("<QQQII", 0, 0, size, crc, len(name)) + name
    return head + struct.pack("<Q", len(packed)) + packed


def test_chunks_are_bounded_before_they_are_unpacked() -> None:
    import lz4.frame

    bomb = bytes(1 << 24)
    tracemalloc.start()
    for packed, name in ((zstandard.compress(bomb), b"zstd"), (lz4.frame.compress(bomb), b"lz4")):
        for claimed in (100, 1 << 40, 1 << 63):
            with pytest.raises(DamagedError):
                unpack(chunk(claimed, packed, name))
    # a frame that does not tell its size
    stream = zstandard.ZstdCompressor().compressobj()
    packed = stream.compress(bomb) + stream.flush()
    with pytest.raises(DamagedError):
        unpack(chunk(100, packed))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 26
    assert unpack(chunk(1 << 24, zstandard.compress(bomb), crc=zlib.crc32(bomb))) == bomb
    with pytest.raises(DamagedError, match="checksum"):
        unpack(chunk(1 << 24, zstandard.compress(bomb), crc=1))
    with pytest.raises(DamagedError, match="bz2"):
        unpack(chunk(1, b"x", b"bz2"))


def test_a_bomb_of_text_is_refused_in_bounded_memory(tmp_path: Path) -> None:
    text = b"t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n1,1,2,3,4\n" + b"5" * (1 << 25)
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text, 1))
    (tmp_path / "log.csv.zst").write_bytes(zstandard.compress(text))
    for name in ("log.csv.gz", "log.csv.zst"):
        with pytest.raises(LogError, match="line of more than"):
            read_log(tmp_path / name)


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


def test_a_finite_number_too_large_is_told_so(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,theta1,theta2,tau1,tau2\n0,0,0,0,0\n1,1e300,0,0,0\n")
    with pytest.raises(
        LogError, match=r"sample 2: expected a finite number below 1e\+30 in size, found 1e\+300"
    ):
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


def test_frames_of_zstd_behind_one_another_are_one_table(tmp_path: Path) -> None:
    (tmp_path / "log.csv.zst").write_bytes(
        zstandard.compress(TABLE[:5000]) + zstandard.compress(TABLE[5000:])
    )
    assert len(read_log(tmp_path / "log.csv.zst")) == 3000
    (tmp_path / "log.csv.zst").write_bytes(zstandard.compress(TABLE) + b"no frame")
    with pytest.raises(LogError, match="damaged or cut off"):
        read_log(tmp_path / "log.csv.zst")


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_empty_lines_without_end_take_no_memory(end: bytes, tmp_path: Path) -> None:
    text = TABLE.replace(b"\n", end)
    packed = zstandard.compress(b"# a log" + end * 3 + text + end * 500_000 + b"9999,1,1,1,1" + end)
    (tmp_path / "log.csv.zst").write_bytes(packed)
    (tmp_path / "small.csv").write_bytes(TABLE)
    read_log(tmp_path / "small.csv")  # what is loaded once is not counted, nor traced
    tracemalloc.start()
    assert len(read_log(tmp_path / "log.csv.zst")) == 3001
    assert tracemalloc.get_traced_memory()[1] < 1 << 24
    tracemalloc.stop()


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


@pytest.mark.skipif(not os.access("/proc/kmsg", os.R_OK), reason="needs a file that waits for ever")
def test_what_the_kernel_makes_up_is_an_empty_file(tmp_path: Path) -> None:
    endless = Path("/proc/kmsg")
    write_log(tmp_path / "log.csv", clean_log(20))
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").symlink_to(endless)
    (tmp_path / "endless.csv").symlink_to(endless)
    assert read_whole(endless) == b""
    assert not is_manifest(tmp_path / "endless.csv")
    assert sha256_of(tmp_path / "bag") == sha256_of(Path("/dev/null"))
    with pytest.raises(LogError, match="the file is empty"):
        read_log(endless)
    with pytest.raises(LogError, match="no relative_file_paths"):
        read_log(tmp_path / "bag")
    (tmp_path / "log.csv.truth.json").symlink_to(endless)
    with pytest.raises(LogError, match="the truth beside the log cannot be read"):
        read_log(tmp_path / "log.csv")


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
    with pytest.raises(LogError, match="the checksum of a page at byte"):
        read_log(path)


class Keys(encryption.KmsClient):  # type: ignore[misc]
    """Keys that are not secret."""

    def wrap_key(self, key: bytes, _name: str) -> bytes:
        return base64.b64encode(key)

    def unwrap_key(self, key: bytes, _name: str) -> bytes:
        return base64.b64decode(key)


def read_alone(*paths: Path) -> list[str]:
    """What a process of its own says of each file, which may end it: nothing, or the error's type
    and text.
    """
    code = (
        "import sys; from algid.readers import read_log\n"
        "for path in sys.argv[1:]:\n"
        "    try: print(len(read_log(path)))\n"
        "    except Exception as error: print(type(error).__name__, error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *paths], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr  # not -6, an abort
    told = done.stdout.splitlines()
    assert len(told) == len(paths)
    return told


KEYS: list[dict[str, Any]] = [
    {"column_keys": {"k": ["theta1"]}},
    {"column_keys": {"k": ["note"]}},
]
if hasattr(encryption.EncryptionConfiguration, "uniform_encryption"):  # not in older pyarrow
    KEYS.append({"uniform_encryption": True})


def test_encrypted_parquet_is_refused_and_ends_no_process(tmp_path: Path) -> None:
    factory = encryption.CryptoFactory(lambda _: Keys())
    table = arm_table(50).append_column("note", pa.array(["x"] * 50))
    made = [
        (tmp_path / f"{place}{plain}.parquet", plain, keys)
        for place, keys in enumerate(KEYS)
        for plain in (True, False)
    ]
    for path, plain, keys in made:
        configuration = encryption.EncryptionConfiguration(
            footer_key="k", plaintext_footer=plain, double_wrapping=False, **keys
        )
        properties = factory.file_encryption_properties(
            encryption.KmsConnectionConfig(), configuration
        )
        with pq.ParquetWriter(path, table.schema, encryption_properties=properties) as writer:
            writer.write_table(table)
    for (path, plain, _), told in zip(
        made, read_alone(*(path for path, _, _ in made)), strict=True
    ):
        assert told.startswith(f"LogError {path}: ")
        assert "encrypt" in told or not plain


def test_a_footer_that_is_none_is_refused(tmp_path: Path) -> None:
    for footer in (
        b"\x15\x02",
        b"\xff" * 40,
        b"\x19\xfc\xff\xff\xff\xff\x0f",
        b"\x1c" * 100,
        b"\x1b\x00",
        b"\x18\xff\xff\x03",
    ):
        (tmp_path / "log.parquet").write_bytes(
            b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1"
        )
        with pytest.raises(LogError, match="footer is damaged"):
            read_log(tmp_path / "log.parquet")


@pytest.mark.parametrize("number", [math.nan, math.inf, 10**400])
def test_a_truth_that_is_no_number_is_refused(number: float, tmp_path: Path) -> None:
    content = {"sums": {}, "arm": asdict(TRUTH.arm), "payload": number, "case": None}
    text = json.dumps(
        {**content, "crc32": zlib.crc32(json.dumps(content, sort_keys=True).encode())}
    )
    pq.write_table(arm_table().replace_schema_metadata({"algid": text}), tmp_path / "log.parquet")
    with pytest.raises(LogError, match="truth in the file's metadata cannot be read"):
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


def test_a_footer_that_claims_pages_beyond_the_file_is_refused(tmp_path: Path) -> None:
    whole = BytesIO()
    pq.write_table(arm_table(), whole, compression="none", use_dictionary=False)
    content = whole.getvalue()
    start = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    for cut in (100, start // 2):
        (tmp_path / "log.parquet").write_bytes(
            b"PAR1" + content[start - cut : start] + content[start:]
        )
        with pytest.raises(LogError, match="pages beyond the end of the file"):
            read_log(tmp_path / "log.parquet")


def test_statistics_that_contradict_their_column_do_not_end_the_process(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    pq.write_table(arm_table(), path, write_page_checksum=True, row_group_size=500)
    content = path.read_bytes()
    start = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    # SizeStatistics (field 16): a histogram of two repetition levels where a flat column has none
    levels = b"<)\x06\x19&"
    if levels not in content[start:-8]:
        pytest.skip("this pyarrow writes no SizeStatistics")
    footer = content[start:-8].replace(levels, b"<)&\x00\x00\x19&")
    path.write_bytes(content[:start] + footer + len(footer).to_bytes(4, "little") + b"PAR1")
    (told,) = read_alone(path)
    assert told == "2000" or told.startswith("LogError")


def test_a_page_that_claims_impossible_values_does_not_end_the_process(tmp_path: Path) -> None:
    options: list[dict[str, Any]] = [
        {"use_dictionary": False},
        {"use_dictionary": True},
        {"data_page_version": "2.0"},
    ]
    paths = [tmp_path / f"{place}.parquet" for place in range(3)]
    for path, own in zip(paths, options, strict=True):
        pq.write_table(arm_table(60), path, compression="none", **own)
        content = bytearray(path.read_bytes())
        values = bytes([0x15, 120, 0x15])  # 60 values, zigzag, in a data page's header
        place = content.index(values, 4) + 1
        content[place] = 119  # -60
        path.write_bytes(content)
    for told in read_alone(*paths):
        assert told.startswith("LogError")
        assert "claims -60 values" in told
