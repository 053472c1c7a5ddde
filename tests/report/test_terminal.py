"""Tables on a terminal: what gives way in a narrow one."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from algid.report.document import Table
from algid.report.terminal import print_table


def printed(table: Table, width: int) -> str:
    """The table on a terminal of that width."""
    console = Console(file=io.StringIO(), width=width)
    print_table(table, console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    return text


HEADS = "Parameter | Estimate | ± 95 % | Unit | Status | ±, % | Truth | Error, % | Meaning"
ROWS = """\
k5+k3+z1+z2 | 0.123456 | 0.000123 | kg m² | OK | 0.0123 | 0.12340 | +0.04 | –
k6 | 12.34567 | 0.01234 | N m s/rad | NOT_IDENTIFIABLE | 0.0999 | 12.3456 | +0.05 | viscous"""
ESTIMATES = Table("Parameters", HEADS, [tuple(row.split(" | ")) for row in ROWS.splitlines()])


def test_the_interval_and_the_status_stay_at_eighty_columns() -> None:
    text = printed(ESTIMATES, 80)
    for cell in ("± 95 %", "0.000123", "NOT_IDENTIFIABLE", "0.123456", "k5+k3+z1+z2", "N m s/rad"):
        assert cell in text
    assert "Meaning" not in text  # the last ones go first
    assert "viscous" not in text


@pytest.mark.parametrize("width", range(36, 52))
def test_words_give_way_before_digits(width: int) -> None:
    """The widest column is no narrower for the others' sake where all of it are numbers."""
    rows = (("k6", "136010.4567 ± 2.7e-5", "N m s/rad", "-0.00439"),)
    text = printed(Table("T", "Name | Estimate | Unit | Δ %", rows), width)
    assert rows[0][1] in text
    assert ("Δ" in text) == ("-0.00439" in text)


def test_a_path_that_fits_nowhere_breaks_and_numbers_do_not() -> None:
    path = "/a/very/long/path/" + "x" * 100 + ".mcap"
    table = Table("T", "Log | Samples", ((path, "1234567890"),), "a note")
    text = printed(table, 60)
    assert "1234567890" in text
    assert "a note" in text
    assert path in "".join(part for part in text.split() if part != "1234567890")
