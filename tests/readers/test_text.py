"""Tables of text: what is lost is counted or refused, and what is hostile costs nothing."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
import zstandard

import algid
from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from tests.conftest import Limited
from tests.readers.logs import noise_log

N = 1000
LOG = noise_log(N)
NAMES = ("t", "theta1", "theta2", "tau1", "tau2")
HEAD = ",".join(NAMES)
VALUES = np.column_stack([LOG.t, LOG.theta.T, LOG.tau.T]).tolist()
ROWS = [",".join(map(repr, row)) for row in VALUES]


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


def noted(quoted: str, closed: bool) -> list[str]:
    """A table of which a note holds a quote, which a later one may close."""
    rows = [f"{one},x" for one in ROWS]
    rows[500] = f"{ROWS[500]},{quoted}"
    rows[700] += '"' * closed
    return [f"{HEAD},note", *rows]


def dated(day: str) -> list[str]:
    return [HEAD, *(f"{day}T00:00:{second:02d}Z,1,2,3,4" for second in range(50))]


QUOTES = r"past row \d+: .*(quotes|malformed)|row 501 .* quotes"
DAYS = ("0001-01-01", "1677-09-21", "2262-04-12", "9999-12-31")
NULS = [*ROWS[:500], "\0" * 500, *ROWS[500:]]
REFUSED: list[tuple[list[str], str]] = [
    *((noted(quoted, False), QUOTES) for quoted in ('"x', 'a"b', '"')),
    *((noted(quoted, True), QUOTES) for quoted in ('"x', 'a"b', '"')),
    *((dated(day), r"past row 0: .*expected dates of 1678 to 2261") for day in DAYS),
    ([HEAD, *NULS], "could not parse .*; mend that row"),
    ([HEAD, *ROWS * 40, *NULS], "could not parse .*; mend that row"),  # behind the first bytes
    (
        [",".join(f"c{place}" for place in range(5_000)), "1," * 4_999 + "1"],
        "more than 4096 columns",
    ),
    (["\r".join([HEAD, *ROWS[:30]])], "a header and no rows below it; .* a line feed behind each"),
    ([HEAD, ROWS[0], "0.1,1,x,3,4", ROWS[2]], r"could not parse `x` .* column '3: theta2'"),
    ([HEAD, ROWS[0], "0.1,1,2,3,4,5", ROWS[2]], "row 2 has more cells"),
    (["t,theta1,theta1,tau1,tau2", ROWS[0]], "twice"),
]


@pytest.mark.parametrize("row", range(len(REFUSED)))
def test_text_that_cannot_be_right_is_refused_in_one_clear_line(row: int, tmp_path: Path) -> None:
    lines, words = REFUSED[row]
    with pytest.raises(LogError, match=words) as refused:
        read(tmp_path, *lines)
    assert str(refused.value).startswith(str(tmp_path / "log.csv"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("note", ['"x, y"', '"x\ny"', '"x ""y"" z"', "x"])
def test_texts_in_quotes_are_texts(note: str, tmp_path: Path) -> None:
    log = read(tmp_path, f"{HEAD},note", *(f"{one},{note}" for one in ROWS))
    assert len(log) == N
    assert lost(log) == []


def text_of(kind: str) -> bytes:
    if kind == "jsonl":
        rows = [json.dumps(dict(zip(NAMES, row, strict=True))) for row in VALUES]
        return "\n".join([*rows, ""]).encode()
    text = "\n".join([HEAD, *ROWS, ""])
    return (text if kind == "csv" else text.replace(",", "  ")).encode()


@pytest.mark.parametrize("nul", [0, 1, 4096, 70_000, 1 << 21])
@pytest.mark.parametrize("kind", ["csv", "blanks", "jsonl"])
def test_a_row_that_breaks_off_is_dropped_and_told(kind: str, nul: int, tmp_path: Path) -> None:
    """Its last number may lack digits: 0.4 may have been 0.4711, or 0.4e-05."""
    whole = text_of(kind)
    place = whole.rfind(b"\n", 0, len(whole) // 2) + 12  # in the midst of a row
    kept = whole[:place].count(b"\n") - (kind != "jsonl")
    path = tmp_path / f"log.{'jsonl' if kind == 'jsonl' else 'csv'}"
    path.write_bytes(whole[:place] + bytes(nul))
    log = read_log(path)
    assert np.array_equal(log.theta, LOG.theta[:, :kept])
    assert np.array_equal(log.tau, LOG.tau[:, :kept])
    assert [(one.code, one.lossy) for one in log.notices] == [("CUT_OFF", True)]


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_compressed_text_that_breaks_off_is_refused(share: float, tmp_path: Path) -> None:
    for name, pack in (("log.csv.gz", gzip.compress), ("log.csv.zst", zstandard.compress)):
        packed = pack(text_of("csv"))
        (tmp_path / name).write_bytes(packed)
        assert len(read_log(tmp_path / name)) == N
        (tmp_path / name).write_bytes(packed[: int(len(packed) * share)])
        with pytest.raises(LogError, match="damaged or cut off"):
            read_log(tmp_path / name)


def test_text_that_unpacks_to_more_than_any_table_is_refused(
    tmp_path: Path, limited: Limited
) -> None:
    limited(free_text_bytes=1 << 24)
    stream = zstandard.ZstdCompressor().compressobj()
    with (tmp_path / "log.csv.zst").open("wb") as file:
        file.write(stream.compress(text_of("csv")))
        for _ in range(40):
            file.write(stream.compress(b"\n" * (1 << 23)))
        file.write(stream.flush())
    with pytest.raises(
        LogError, match="as no table of their size does; if it is one, unpack it first"
    ):
        read_log(tmp_path / "log.csv.zst")


def test_a_row_that_lacks_a_value_has_no_time_to_be_counted_by(tmp_path: Path) -> None:
    rows = [line.partition(",")[2] for line in ROWS]
    rows[7] = rows[7].rpartition(",")[0] + ","
    (tmp_path / "log.csv").write_text("\n".join([HEAD.removeprefix("t,"), *rows, ""]))
    with pytest.raises(LogError, match="rows lack a value, and without a time"):
        read_log(tmp_path / "log.csv", Profile(rate=200.0))


def test_columns_of_a_table_without_a_header_are_named(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*ROWS, ""]))
    seen = algid.inspect(path)
    assert [one.name for one in seen.entries] == [f"column {n}" for n in range(1, 6)]
    assert "no column for t, theta1, theta2, tau1, tau2; found 'column 1', 'co" in seen.refused
    assert """as --set 'columns=["t", "theta1", "theta2", "tau1", "tau2"]'""" in seen.refused
    assert np.array_equal(read_log(path, Profile(columns=NAMES)).theta, LOG.theta)
    seen = algid.inspect(path, columns=["0", *NAMES[1:]])  # a name may be a number
    assert [one.name for one in seen.entries] == [f"column {n}" for n in range(1, 6)]
    assert "found '0', 'theta1'" in seen.refused
    path.write_text("\n".join(["# " + HEAD, *ROWS, ""]))  # the user's names beat the comment's
    with pytest.raises(LogError, match=r"5 columns, and 2 names for them: t, q1; name each"):
        read_log(path, Profile(columns=("t", "q1")))
