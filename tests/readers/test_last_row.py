"""A text whose writer died in the middle of a row: numbers that may lack digits are not used."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from algid.inspection.report import contents
from algid.readers import read_log
from algid.readers.last_row import LastRow, judged
from algid.readers.text import head_of
from tests.readers.logs import noise_log

ROWS = 400
LOG = noise_log(ROWS)
NAMES = ("t", "theta1", "theta2", "tau1", "tau2")
NUMBERS = np.column_stack([LOG.t, LOG.theta.T, LOG.tau.T])
MARKS = {"comma": ",", "blanks": "  ", "semicolon": ";"}


def lines(form: str, mark: str = ",", more: str = "") -> list[str]:
    """A header and the rows, `more` behind each of them."""
    header = mark.join(NAMES) + (f"{mark}temperature" if more else "")
    rows = [mark.join(format(number, form) for number in row) for row in NUMBERS.tolist()]
    return [header, *(row + (mark + more if more else "") for row in rows)]


def read(path: Path, text: str) -> tuple[int, list[tuple[str, bool]]]:
    """How many samples are read, and what is said of them: codes, and whether samples are lost."""
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    log = read_log(path)
    kept = len(log)
    assert np.allclose(log.theta, LOG.theta[:, :kept], atol=1e-6)
    assert np.allclose(log.tau, LOG.tau[:, :kept], atol=1e-6)
    return kept, [(notice.code, notice.lossy) for notice in log.notices]


WHOLE: tuple[int, list[tuple[str, bool]]] = (ROWS, [])
CUT = (ROWS - 1, [("CUT_OFF", True)])
DOUBTFUL = (ROWS - 1, [("NO_LINE_END", False)])


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
@pytest.mark.parametrize("mark", MARKS.values(), ids=MARKS)
@pytest.mark.parametrize("form", [".9f", ".18e"])
def test_a_row_of_fixed_form_is_used_if_its_last_number_is_whole(
    form: str, mark: str, name: str, tmp_path: Path
) -> None:
    whole = "\n".join(lines(form, mark))
    assert read(tmp_path / name, whole) == WHOLE
    assert read(tmp_path / name, whole + "\r") == WHOLE
    for left_off in (1, 2, 5, 12, 25, 40, 60):
        assert read(tmp_path / name, whole[:-left_off]) == CUT, left_off


@pytest.mark.parametrize("mark", MARKS.values(), ids=MARKS)
@pytest.mark.parametrize("rest", ["-", "1e", "1.2e-", "+", ".", "0.4", "4"])
def test_a_row_of_any_form_is_left_out_where_its_last_number_may_be_cut(
    rest: str, mark: str, tmp_path: Path
) -> None:
    *kept, last = lines("", mark)
    before = last[: last.rfind(mark) + len(mark)]
    assert read(tmp_path / "log.csv", "\n".join([*kept, before + rest])) == DOUBTFUL
    assert read(tmp_path / "log.csv", "\n".join([*kept, last, ""])) == WHOLE


@pytest.mark.parametrize("rest", ["-", "1e", "0.4"])
def test_a_number_that_lacks_the_cells_behind_it_breaks_off(rest: str, tmp_path: Path) -> None:
    *kept, last = lines("", more="20.5")
    before = last[: last.rfind(",", 0, last.rfind(",")) + 1]
    assert read(tmp_path / "log.csv", "\n".join([*kept, before + rest])) == CUT


@pytest.mark.parametrize("left_off", [0, 1, 3, 4])
def test_a_cell_that_nobody_needs_may_be_cut(left_off: int, tmp_path: Path) -> None:
    whole = "\n".join(lines("", more="20.5"))
    assert read(tmp_path / "log.csv", whole[: len(whole) - left_off]) == WHOLE


def test_a_first_cell_that_is_cut_is_told(tmp_path: Path) -> None:
    *kept, _ = lines(".9f")
    for rest in ("0", "-", "1e"):
        assert read(tmp_path / "log.csv", "\n".join([*kept, rest])) == CUT


def test_gaps_are_told_beside_a_last_row_that_is_left_out(tmp_path: Path) -> None:
    rows = lines("")
    rows[5] = rows[5].rpartition(",")[0] + ","
    (tmp_path / "log.csv").write_text("\n".join(rows))
    log = read_log(tmp_path / "log.csv")
    assert len(log) == ROWS - 2
    said = [(one.code, one.text[:11]) for one in log.notices]
    assert said == [("EMPTY_CELLS", "1 of 399 row"[:11]), ("NO_LINE_END", "row 400, th")]


def test_the_columns_stay_numbers_to_who_looks_into_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines(".3f")[:30]) + "-")
    assert {entry.type for entry in contents(path)[1]} == {"Float64"}


def test_a_short_table_has_no_form(tmp_path: Path) -> None:
    from algid.readers.dialect import detect

    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines(".3f")[:6]) + "\n")
    text = path.read_bytes()
    dialect = detect(path, head_of(path, "csv"))
    row = lines(".3f")[6].encode()
    assert judged(row, text, dialect, 4) is LastRow.DOUBTFUL
    assert judged(row, 3 * text, dialect, 4) is LastRow.WHOLE
    assert judged(row[:-1], 3 * text, dialect, 4) is LastRow.CUT
    assert judged(b"", text, dialect, 4) is LastRow.WHOLE


@pytest.mark.parametrize("mark", MARKS.values(), ids=MARKS)
@pytest.mark.parametrize(
    ("tail", "outcome"),
    [("   ", WHOLE), ("\t", WHOLE), ("\r", WHOLE), ("# the end", WHOLE), ('"', CUT), ('1,"', CUT)],
)
def test_what_stands_behind_the_last_line_end_is_a_row_or_nothing(
    tail: str, outcome: tuple[int, list[tuple[str, bool]]], mark: str, tmp_path: Path
) -> None:
    """A quote that is left open made polars panic."""
    whole = "# a comment\n" + "\n".join([*lines(".9f", mark), ""])
    kept, said = read(tmp_path / "log.csv", whole + tail.replace(",", mark))
    assert (kept, said) == (ROWS, outcome[1])
