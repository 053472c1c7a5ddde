"""Tables on a terminal: what gives way in a narrow one."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from algid.report.document import Column, Table
from algid.report.tables import ESTIMATE_COLUMNS
from algid.report.terminal import print_table


def printed(table: Table, width: int) -> str:
    """The table on a terminal of that width."""
    console = Console(file=io.StringIO(), width=width)
    print_table(table, console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    return text


ESTIMATES = Table(
    "Parameters",
    ESTIMATE_COLUMNS,
    (
        (
            "k5+k3+z1+z2",
            "0.123456",
            "0.000123",
            "0.0123",
            "kg m²",
            "OK",
            "[0.123210, 0.123702]",
            "0.1234",
            "0.04",
            "1",
            "–",
        ),
        (
            "k6",
            "12.34567",
            "0.01234",
            "0.0999",
            "N m s/rad",
            "NOT_IDENTIFIABLE",
            "[−∞, ∞]",
            "12.3456",
            "0.05",
            "2.34",
            "viscous friction of joint 1",
        ),
    ),
)


@pytest.mark.parametrize("width", [80, 100])
def test_the_interval_stays_at_eighty_columns(width: int) -> None:
    text = printed(ESTIMATES, width)
    for cell in (
        "95 % interval",
        "[0.123210, 0.123702]",
        "[−∞, ∞]",
        "NOT_IDENTIFIABLE",
        "0.123456",
        "k5+k3+z1+z2",
    ):
        assert cell in text
    assert "Truth" not in text
    assert "viscous" not in text  # the meaning goes first


def test_everything_stays_where_there_is_room() -> None:
    text = printed(ESTIMATES, 170)
    assert all(column.heading in text for column in ESTIMATES.columns)
    assert all(cell in text for row in ESTIMATES.rows for cell in row)


def test_lines_break_between_words() -> None:
    headings = ("Job", "Robot", "What", "Parameter", "Value", "Slope, % a month", "95 % interval")
    kinds = ("name", "text", "text", "text", "number", "number", "number")
    row = (
        "r1/monday-morning",
        "left arm of the cell",
        "payload unlike its label",
        "k6",
        "0.50012",
        "+1.23",
        "[1.1, 1.4]",
    )
    table = Table("Logs", tuple(map(Column, headings, kinds)), (row,))  # type: ignore[arg-type]
    words = printed(table, 80).split()
    assert [word for cell in (*headings, *row) for word in cell.split() if word not in words] == []


def test_a_path_that_fits_nowhere_breaks_and_numbers_do_not() -> None:
    path = "/a/very/long/path/" + "x" * 100 + ".mcap"
    table = Table(
        "T", (Column("Log", "name"), Column("Samples", "number")), ((path, "1234567890"),)
    )
    text = printed(table, 60)
    assert "1234567890" in text
    assert "".join(path.split()) in "".join(part for part in text.split() if part != "1234567890")


@pytest.mark.parametrize(("rank", "kept"), [(2, False), (1, True), (0, True)])
def test_words_break_before_a_column_that_is_missed_most_goes(rank: int, kept: bool) -> None:
    columns = (Column("Name", "name"), Column("Why", "text"), Column("Extra", "text", rank=rank))
    table = Table("T", columns, (("k1", "some words that may well break into lines", "aside"),))
    text = printed(table, 40)
    assert ("Extra" in text) is ("aside" in text) is kept
    assert all(word in text for word in table.rows[0][1].split())
    assert "Extra" in printed(table, 80)
