"""A result's errors beside their limits, row by row of Table 4."""

from __future__ import annotations

from pathlib import Path

import pytest

import algid
from algid.base.errors import ResultError, SettingError
from algid.results import LogSummary, Result, Table4Row
from algid.results.verdict import judged_errors

ROWS = (
    Table4Row(
        parameter="k1",
        unit="kg m^2",
        estimate=1.02,
        truth=1.0,
        error_percent=2.0,
        paper_error_percent=2.0,
    ),
    Table4Row(
        parameter="k2",
        unit="N m",
        estimate=3.0,
        truth=2.0,
        error_percent=50.0,
        paper_error_percent=1.234567,
    ),
    Table4Row(parameter="k3", unit="kg m^2", estimate=None, truth=1.0, paper_error_percent=9.0),
    Table4Row(parameter="m_p", unit="kg", estimate=0.5, truth=0.5, error_percent=0.0),
    Table4Row(parameter="l1", unit="m", estimate=0.5),
)


def _result(*rows: Table4Row) -> Result:
    log = LogSummary.model_construct(path="log.mcap")
    return Result.model_construct(table4=list(rows), log=log)


def _judged(
    largest: float | str | Path,
) -> list[tuple[str, float | None, float, bool]]:
    rows = algid.validate(_result(*ROWS), max_error=largest).judged
    return [(row.parameter, row.error, row.limit, row.passed) for row in rows]


def test_one_limit_holds_for_every_row_with_a_truth() -> None:
    assert [row[::3] for row in _judged(2.0)] == [
        ("k1", True),
        ("k2", False),
        ("k3", False),
        ("m_p", True),
    ]
    assert [row[2] for row in _judged(2.0)] == [2.0] * 4
    assert [row[3] for row in _judged(0)] == [False, False, False, True]


def test_a_file_names_the_rows_that_are_checked(tmp_path: Path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text("[max_error_percent]\nm_p = 0\nk2 = 49.9\n")
    for name in (file, str(file)):
        assert _judged(name) == [("k2", 50.0, 49.9, False), ("m_p", 0.0, 0.0, True)]
    file.write_text("[max_error_percent]\nl1 = 1\n")  # there, but without a truth
    with pytest.raises(
        SettingError, match=r"limits.toml: max_error_percent.l1: expected one of k1, k2, k3, m_p$"
    ):
        _judged(file)
    for text, said in (
        ("", "max_error_percent"),
        ("[max_error_percent]\n", "max_error_percent"),
        ("[max_error_percent]\nk1 = -1\n", "k1"),
        ("more = 1\n", "more"),
    ):
        file.write_text(text)
        with pytest.raises(SettingError, match=said):
            _judged(file)


def test_limits_that_are_none_are_refused() -> None:
    for largest in ("none", -1.0, float("nan"), "1e10"):
        with pytest.raises(SettingError, match=r"^--max-error: .*; paper; or a TOML file"):
            _judged(largest)
    with pytest.raises(
        ResultError, match=r"^log\.mcap: the log holds no true parameters; only synthetic logs"
    ):
        judged_errors(_result(ROWS[4]), 1.0)
    with pytest.raises(ResultError, match=r"^log\.mcap: not a case of the paper; give --max-error"):
        judged_errors(_result(ROWS[3]), "paper")


def test_one_row_over_its_limit_fails_the_check_and_every_row_is_a_line() -> None:
    rows = judged_errors(_result(*ROWS), "paper")
    assert [row.passed for row in rows] == [True, False, False]
    assert [row.text for row in rows] == [
        "ok    k1                     2 %  limit 2 %",
        "OVER  k2                    50 %  limit 1.235 %",
        "OVER  k3             no estimate  limit 9 %",
    ]
