"""Formats told from content, text in pieces, and the dialect of a table: refusals to the letter."""

from __future__ import annotations

import gzip
import io
import random
import tempfile
import zipfile
from pathlib import Path

import polars as pl
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from algid.api.guide import text_of
from algid.errors import LogError
from algid.readers import read_log
from algid.readers.csv import counted_rows
from algid.readers.dialect import Dialect, detect, kinds, split
from algid.readers.formats import FORMATS, SUFFIXES, sniff
from algid.readers.text import head_of, looks_like_text, pieces, whole_lines

CONTENT = {
    "mcap": b"\x89MCAP0\r\n...", "parquet": b"PAR1...", "bag": b"#ROSBAG V2.0\n",
    "db3": b"SQLite format 3\x00...", "feather": b"ARROW1\0\0", "npy": b"\x93NUMPY\x01",
    "mat": b"MATLAB 5.0 MAT-file", "csv": b"t,q1\n",
    "csv.gz": gzip.compress(b"t,q1\n", mtime=0), "csv.zst": zstandard.compress(b"t,q1\n"),
}  # fmt: skip


@pytest.mark.parametrize("kind", CONTENT)
def test_a_format_is_told_by_its_content_whatever_its_name(kind: str, tmp_path: Path) -> None:
    (tmp_path / "log.dat").write_bytes(CONTENT[kind])
    assert sniff(tmp_path / "log.dat") == kind


def test_a_zip_is_a_log_of_numpy_by_its_name_alone(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("t.npy", b"")
    for name, kind in (("log.NPZ", "npz"), ("log.docx", None)):
        (tmp_path / name).write_bytes(buffer.getvalue())
        if kind:
            assert sniff(tmp_path / name) == kind
        else:
            with pytest.raises(
                LogError,
                match=r"unknown format, it begins with b'PK\\x03\\x04.*MCAP, Parquet or CSV",
            ):
                sniff(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty; expected a log"),
        (b"\x00\x01", "unknown format, it begins with"),
        (
            gzip.compress(CONTENT["mcap"], mtime=0),
            "an MCAP file compressed as a whole, .* unpack it first: gunzip log.dat",
        ),
        (zstandard.compress(CONTENT["mcap"]), "unpack it first: zstd -d log.dat"),
        (gzip.compress(b"\x00", mtime=0), "compressed, but not a table of text"),
        (zstandard.compress(b""), "compressed, but not a table of text"),
    ],
)
def test_what_is_no_log_is_refused(content: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / "log.dat").write_bytes(content)
    with pytest.raises(LogError, match=words):
        sniff(tmp_path / "log.dat")


def test_folders(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"a folder without metadata.yaml or \*.mcap"):
        sniff(tmp_path)
    for name in ("log.mcap", "log.db3", "metadata.yaml"):
        folder = tmp_path / name.partition(".")[2]
        folder.mkdir()
        (folder / name).touch()
        assert sniff(folder) == "rosbag2"
    with pytest.raises(LogError, match="there is no such file; expected"):
        sniff(tmp_path / "none.csv")
    with pytest.raises(LogError, match=r"the log cannot be read .*check the name and rights"):
        sniff(tmp_path / ("x" * 300))


def test_text_may_be_cut_within_a_letter_and_nowhere_else() -> None:
    text = "Gelenk, θ₁ ✓".encode()
    assert all(looks_like_text(text[:end]) for end in range(1, len(text) + 1))
    assert not looks_like_text(text[:-1] + b", q1")
    assert not looks_like_text(b"t,q1\x07")
    assert looks_like_text(b"a\tb\f\r\n")
    assert looks_like_text("t".encode("utf-16"))


@settings(max_examples=30, deadline=None)
@given(
    lines=st.lists(st.sampled_from([b"1,2", b"", b"\r", b"33,4"]), max_size=30),
    size=st.integers(1, 40),
)
def test_pieces_add_up(lines: list[bytes], size: int) -> None:
    text = b"\n".join(lines)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        for name, packed in (
            ("csv", text),
            ("csv.gz", gzip.compress(text)),
            ("csv.zst", zstandard.compress(text)),
        ):
            path.write_bytes(packed)
            parts = list(pieces(path, name, size))
            assert b"".join(parts) == text
            assert name == "csv.zst" or all(len(part) == size for part in parts[:-1])
            assert b"".join(whole_lines(path, name)) == text  # as long as its head


def test_empty_lines_go_behind_the_head_only(tmp_path: Path) -> None:
    head = b"t,q1\n" + b"1,2\n" * 20_000
    (tmp_path / "log.csv").write_bytes(b"\n\n" + head + b"\n\r\n\n3,4\n5,6")
    found = list(whole_lines(tmp_path / "log.csv", "csv"))
    assert b"".join(found) == b"\n\n" + head + b"3,4\n5,6"
    assert all(piece.endswith(b"\n") for piece in found[:-1])
    assert head_of(tmp_path / "log.csv", "csv") == (b"\n\n" + head)[: 1 << 16]
    dialect = Dialect(("t", "q1"), ",", False, 3, "#", frozenset(), False)
    assert counted_rows(tmp_path / "log.csv", "csv", dialect) == 20_002


def found(text: str) -> Dialect:
    return detect(Path("log.csv"), text.encode())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# only a comment\n", "no table in the text; expected a header"),
        ("t,q1\n", "a header and no rows below it"),
        ("t,q1\ns,rad\n", "a header and no rows below it"),
        ("time\n1\n2\n", "'time' has one column; expected columns split by"),
        (
            "1,2\n3,4\n",
            "no header, its first line is '1, 2'; put a line with the columns' names above it, or",
        ),
        ("# t q1 q2\n1,2\n3,4\n", "no header"),
        ("t,q1,t\n1,2,3\n4,5,6\n", "the column 't' stands in the header twice; rename one"),
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
            detect(Path("log.csv"), "\ufefft,q1\n".encode(code))


def test_the_dialect_of_a_table() -> None:
    dialect = found(
        'made by hand\n\n"t" ; q1; "on, off" ;day\n1 ; 2,5;7;2024-01-02 '
        "03:04:05\n-2;.5;8;2024-01-02T03:04:06\n"
    )
    assert dialect.columns == ("t", "q1", "on, off", "day")
    assert (dialect.separator, dialect.decimal_comma, dialect.skip, dialect.padded) == (
        ";",
        True,
        3,
        True,
    )
    assert (set(dialect.whole), set(dialect.dates)) == ({"t", "on, off"}, {"day"})
    plain = found("% rate 5\n% t q1\n1 2.5\n2 3\n")
    assert (plain.columns, plain.separator, plain.comment, plain.skip) == (("t", "q1"), "", "%", 2)
    assert (plain.decimal_comma, plain.padded) == (False, False)
    assert found("t,q1\n1,2\n").decimal_comma is False
    # a cell more than nineteen digits long is no int64
    assert found("t,q1\n12345678901234567890,1\n").whole == {"q1"}


def test_titles_may_hold_separators_and_rows_may_break_off() -> None:
    dialect = found("run;7;b\nDate,2026-01-01\nt,q1,q2\n1,2,3\n2,3,4\n3,4")
    assert (dialect.columns, dialect.skip) == (("t", "q1", "q2"), 3)
    # of a table none of whose rows fits its header, the first separator that makes more than four
    # cells of it
    assert found("a|b|c|d|e\n1|2|3|4|5\n1|2\n1|2|3\n").separator == "|"


def test_the_units_of_a_row_beat_those_above() -> None:
    dialect = found("# tau1 in mNm, q1 in deg\nt,q1,tau1\n,rad,-\n1,2,3\n")
    assert (dict(dialect.units), dialect.skip) == ({"q1": "rad", "tau1": "mNm"}, 3)


def test_kinds_of_columns_are_those_of_polars() -> None:
    text = "t,q1,note\n# stopped\n1,2.5,a\n2,3,\n3,,b\n4\n"
    table = pl.read_csv(text.encode(), comment_prefix="#", truncate_ragged_lines=True)
    assert kinds(Path("log.csv"), text.encode(), found(text)) == {
        name: str(kind) for name, kind in table.schema.items()
    }


def test_cells_in_quotes() -> None:
    assert split('"a, b" , c,"d ""e"""', ",") == ["a, b", "c", 'd "e']
    assert split('"a" b', "") == ["a", "b"]


def test_a_row_of_too_many_cells_is_told_by_its_number(tmp_path: Path) -> None:
    rows = [f"{place},2,3,4,5" for place in range(40)]
    (tmp_path / "log.csv").write_text(
        "\n".join(["t,q1,q2,tau1,tau2", *rows, "1,2,3,4,5,6", *rows]) + "\n"
    )
    with pytest.raises(LogError, match="row 41 has more cells than the header's 5; mend that row"):
        read_log(tmp_path / "log.csv")


def test_a_cell_that_is_no_number_is_told_by_its_column(tmp_path: Path) -> None:
    rows = [f"{place},2,3,{'off' if place == 30 else 4},5" for place in range(600)]
    (tmp_path / "log.csv").write_text("\n".join(["t,q1,q2,tau1,tau2", *rows]) + "\n")
    with pytest.raises(
        LogError, match="column 'tau1', past row 0: expected a number, found 'off'; mend the file"
    ):
        read_log(tmp_path / "log.csv")


def test_each_format_is_one_entry() -> None:
    names = [form.name for form in FORMATS]
    assert len(set(names)) == len(names)
    assert len(set(SUFFIXES)) == len(SUFFIXES)
    assert set(names) >= {*CONTENT, "npz", "rosbag2"}


def test_the_guide_lists_every_format() -> None:
    guide = text_of("logs")
    for form in FORMATS:
        ends = ", ".join(f"`{suffix}`" for suffix in form.suffixes) or "a folder"
        assert f"| {form.title} | {ends} |" in guide


@pytest.mark.parametrize("comment", [None, "#", "//"])
def test_rows_are_counted_as_line_by_line(comment: str | None, tmp_path: Path) -> None:
    """Blank lines and comments are none, wherever they stand."""
    parts = ["1,2", "3", "\n", "\n", "\n\n", "\r\n", " \n", "\t", "#", "//", "/1", "\n#x", "\v\n"]
    path = tmp_path / "log.csv"
    for seed in range(300):
        draw = random.Random(seed)
        text = "".join(draw.choices(parts, k=draw.randrange(12)))
        skip = draw.randrange(3)
        path.write_bytes(text.encode())
        lines = text.split("\n")[skip:]
        counted = sum(
            1 for one in lines if one.strip() and not (comment and one.startswith(comment))
        )
        dialect = Dialect(("t", "q1"), ",", False, skip, comment, frozenset(), False)
        assert counted_rows(path, "csv", dialect) == counted, (text, skip)
