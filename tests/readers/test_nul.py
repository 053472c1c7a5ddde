"""Text that ends in NUL bytes, as a file does that had grown when the power went."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.readers import read_log
from tests.readers.logs import noise_log

LOG = noise_log(400)
NAMES = ("t", "theta1", "theta2", "tau1", "tau2")
ROWS = np.column_stack([LOG.t, LOG.theta.T, LOG.tau.T])


def text_of(kind: str) -> bytes:
    if kind == "jsonl":
        rows = [json.dumps(dict(zip(NAMES, row, strict=True))) for row in ROWS.tolist()]
        return "".join(row + "\n" for row in rows).encode()
    mark = {"csv": ",", "blanks": "  "}[kind]
    rows = [mark.join(map(repr, row)) for row in ROWS.tolist()]
    return "\n".join([mark.join(NAMES), *rows, ""]).encode()


@pytest.mark.parametrize("nul", [1, 4096, 70_000, 1 << 21])
@pytest.mark.parametrize("kind", ["csv", "blanks", "jsonl"])
def test_rows_before_nul_bytes_are_kept_and_the_loss_is_counted(
    kind: str, nul: int, tmp_path: Path
) -> None:
    whole = text_of(kind)
    place = whole.rfind(b"\n", 0, len(whole) // 2) + 12  # in the midst of a row
    kept = whole[:place].count(b"\n") - (kind != "jsonl")
    path = tmp_path / f"log.{'jsonl' if kind == 'jsonl' else 'csv'}"
    path.write_bytes(whole[:place] + bytes(nul))
    log = read_log(path)
    assert np.array_equal(log.theta, LOG.theta[:, :kept])
    assert np.array_equal(log.tau, LOG.tau[:, :kept])
    assert [(one.code, one.lossy) for one in log.notices] == [("CUT_OFF", True)]


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("kind", ["csv", "blanks"])
def test_a_last_row_without_a_line_end_is_left_out_and_told(
    kind: str, packed: bool, tmp_path: Path
) -> None:
    """Its last number may lack digits: 0.4 may have been 0.4711, or 0.4e-05."""
    path, text = tmp_path / "log.csv", text_of(kind)[:-4]
    path.write_bytes(gzip.compress(text) if packed else text)
    log = read_log(path)
    assert np.array_equal(log.tau, LOG.tau[:, :-1])
    assert [(one.code, one.lossy) for one in log.notices] == [("CUT_OFF", True)]


@pytest.mark.parametrize("rows", [1, 40])  # within the first bytes, and behind them
def test_nul_bytes_among_the_rows_are_refused(rows: int, tmp_path: Path) -> None:
    header, _, body = text_of("csv").partition(b"\n")
    whole = header + b"\n" + rows * body
    place = len(whole) // 2
    path = tmp_path / "log.csv"
    path.write_bytes(whole[:place] + bytes(500) + whole[place + 500 :])
    with pytest.raises(LogError, match=r"line 2 has .*mend|could not parse .*; mend that row"):
        read_log(path)
