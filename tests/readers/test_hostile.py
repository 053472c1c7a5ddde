"""Damaged and hostile files: an answer or one clear line, in bounded memory, and never a silent change."""

from __future__ import annotations

import gzip
import os
import random
import struct
import tempfile
import tracemalloc
import zlib
from pathlib import Path

import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from algid.errors import LogError
from algid.readers import read_log
from algid.readers.mcap.framing import DamagedError, unpack
from pipelines.mutations import clean_files, clean_log, damage
from tests.readers.logs import same


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
    text = b"t,theta1,theta2,tau1,tau2\n0,1,2,3,4\n1,1,2,3,4\n" + b"5" * (1 << 27)
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
    with pytest.raises(LogError, match=r"sample 2: expected a finite number below 1e\+100 in size, found 1e\+300"):
        read_log(path)
