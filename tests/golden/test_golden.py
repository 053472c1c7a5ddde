"""What users rely on stays what it was: estimates within 1e-6 of their own σ, codes and statuses
as they stand.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden.cases import SHARED, Case, cases
from tests.golden.record import EXPECTED

SHARE = 1e-6
"""Of a standard deviation: kernels sum in different orders, amplified to 1e-8 by weak problems."""
OF_SPREAD = 1e-5
"""Of a deviation itself: along what a log hardly tells, kernels differ by 2e-6."""
EXACT = 1e-7
"""Of a number's own size, if its deviation is smaller: kernels differ by 1e-8 without noise."""
ROUNDING = 1e-6
"""Of a number's own size: a smaller deviation is rounding, on a log without noise."""

ALL = list(cases())


def expected() -> dict[str, dict[str, object]]:
    found: dict[str, dict[str, object]] = json.loads(EXPECTED.read_text(encoding="utf-8"))
    return found


def test_every_case_is_expected_and_every_name_stands_once() -> None:
    names = [case.name for case in ALL]
    assert len(set(names)) == len(names)
    assert set(expected()) == set(names)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=[pytest.mark.slow] if case.real else [])
        for case in ALL
    ],
)
def test_a_result_is_what_it_was(case: Case, tmp_path: Path) -> None:
    if case.real and not SHARED.is_dir():
        pytest.skip("../shared/data is absent")
    wanted = expected()[case.name]
    found = json.loads(json.dumps(case.run(tmp_path)))
    numbers, wanted_numbers = found.pop("numbers", {}), wanted.pop("numbers", {})
    assert found == wanted
    assert isinstance(wanted_numbers, dict)
    assert set(numbers) == set(wanted_numbers)
    for name, (value, spread) in wanted_numbers.items():
        own, own_spread = numbers[name]
        if value is None:
            assert own is None, name
            continue
        allowed = max(SHARE * (spread or 0.0), EXACT * abs(value))
        assert own == pytest.approx(value, abs=allowed), name
        if spread is not None and spread > ROUNDING * abs(value):
            assert own_spread == pytest.approx(spread, rel=OF_SPREAD), name
