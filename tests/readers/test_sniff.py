"""Formats told from content, text in pieces, and the dialect of a table: refusals to the letter."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import zstandard

from algid.api.guide import text_of
from algid.base.errors import LogError
from algid.readers import read_log
from algid.readers.dialect import Dialect, detect, looks_like_text
from algid.readers.formats import FORMATS, format_of

CONTENT = {
    "mcap": b"\x89MCAP0\r\n...", "parquet": b"PAR1...", "bag": b"#ROSBAG V2.0\n",
    "db3": b"SQLite format 3\x00...", "feather": b"ARROW1\0\0",
    "mat": b"MATLAB 5.0 MAT-file", "csv": b"t,q1\n",
    "csv.gz": gzip.compress(b"t,q1\n", mtime=0), "csv.zst": zstandard.compress(b"t,q1\n"),
}  # fmt: skip


@pytest.mark.parametrize("kind", CONTENT)
def test_a_format_is_told_by_its_content_whatever_its_name(kind: str, tmp_path: Path) -> None:
    (tmp_path / "log.dat").write_bytes(CONTENT[kind])
    assert format_of(tmp_path / "log.dat").name == kind


def test_a_zip_is_a_log_of_numpy_by_its_name_alone(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", t=[0])
    assert format_of((tmp_path / "log.npz").rename(tmp_path / "log.NPZ")).name == "npz"
    words = r"unknown format, it begins with b'PK\\x03\\x04.*MCAP, Parquet or CSV"
    with pytest.raises(LogError, match=words):
        format_of((tmp_path / "log.NPZ").rename(tmp_path / "log.docx"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty; expected a log"),
        (b"\x00\x01", "unknown format, it begins with"),
        (b"\x00\x00", "unknown format, it begins with"),
        (gzip.compress(CONTENT["mcap"], mtime=0), "compressed, but not a table of text; unpack"),
        (gzip.compress(b"\x00", mtime=0), "compressed, but not a table of text"),
        (zstandard.compress(b""), "compressed, but not a table of text"),
    ],
)
def test_what_is_no_log_is_refused(content: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / "log.dat").write_bytes(content)
    with pytest.raises(LogError, match=words):
        format_of(tmp_path / "log.dat")


def test_folders(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"no file of .*; expected metadata.yaml, \*.mcap or \*.db3"):
        read_log(tmp_path)
    for name in ("log.mcap", "log.db3", "metadata.yaml"):
        folder = tmp_path / name.partition(".")[2]
        folder.mkdir()
        (folder / name).touch()
        assert format_of(folder).name == "rosbag2"
    with pytest.raises(LogError, match="there is no such file; expected"):
        format_of(tmp_path / "none.csv")
    with pytest.raises(LogError, match=r"the log cannot be read .*check the name and rights"):
        format_of(tmp_path / ("x" * 300))


def test_text_may_be_cut_within_a_letter_and_nowhere_else() -> None:
    text = "Gelenk, θ₁ ✓".encode()
    assert all(looks_like_text(text[:end]) for end in range(1, len(text) + 1))
    assert not looks_like_text(text[:-1] + b", q1")
    assert not looks_like_text(b"t,q1\x07")
    assert looks_like_text(b"a\tb\f\r\n")
    assert looks_like_text("t".encode("utf-16"))


def found(text: str) -> Dialect:
    return detect(text.encode())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# only a comment\n", "no table in the text; expected a header"),
        ("t,q1\n", "a header and no rows below it"),
        ("t,q1\ns,rad\n", "a header and no rows below it"),
        ("time\n1\n2\n", "'time' has one column; expected columns split by"),
        (
            "t,q1,q2,tau1,tau2\n1,2,3\n4,5,6\n",
            "line 2 has 3 cells under a header of 5; mend the header",
        ),
    ],
)
def test_tables_that_are_none(text: str, words: str) -> None:
    with pytest.raises(LogError, match=words):
        found(text)


def test_text_of_other_encodings_is_refused() -> None:
    for code in ("utf-16-le", "utf-16-be"):
        with pytest.raises(LogError, match="UTF-16; save it as UTF-8"):
            detect("\ufefft,q1\n".encode(code))


def test_a_cell_of_more_than_nineteen_digits_is_no_int64() -> None:
    types = found("t,q1\n12345678901234567890,1\n").schema.types
    assert [str(kind) for kind in types] == ["double", "int64"]


def test_titles_may_hold_separators_and_rows_may_break_off() -> None:
    dialect = found("run;7;b\nDate,2026-01-01\nt,q1,q2\n1,2,3\n2,3,4\n3,4")
    assert (dialect.schema.names, dialect.skip) == (["t", "q1", "q2"], 3)
    # of a table none of whose rows fits its header, the first separator that makes more than four
    # cells of it
    assert found("a|b|c|d|e\n1|2|3|4|5\n1|2\n1|2|3\n").separator == "|"


def test_a_row_of_units_and_comments_above_and_below_it() -> None:
    dialect = found("# tau1 in mNm\nt,q1,tau1\n,[rad],-\n# q1 in deg\n1,2,3\n")
    assert (dialect.schema.field("q1").metadata, dialect.skip) == ({b"unit": b"rad"}, 4)
    assert dialect.schema.field("tau1").metadata is None
    assert dialect.said == ("tau1 in mNm", " q1 in deg")


def test_the_guide_lists_every_format() -> None:
    guide = text_of("logs")
    for form in FORMATS:
        ends = ", ".join(f"`{suffix}`" for suffix in form.suffixes) or "a folder"
        assert f"| {form.title} | {ends} |" in guide
