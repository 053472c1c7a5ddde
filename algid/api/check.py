"""Whether a result's errors stay within their limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from algid.api import ranges

if TYPE_CHECKING:
    from algid.check import Judged


def check(
    result: Path,
    against: Literal["paper", "truth"],
    max_error: float | None = None,
    tolerance_file: Path | None = None,
) -> list[Judged]:
    """Rows of Table 4 beside their limits: raises as `algid.check.judge`."""
    from algid.check import judge
    from algid.results import read_result

    ranges.check("check", max_error=max_error)
    return judge(read_result(result), against, max_error, tolerance_file)
