"""Whether a result's errors stay within their limits: the paper's, one for all, or a file's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from algid.base.errors import ResultError, SettingError
from algid.base.files import read_toml
from algid.options import flag
from algid.results import Result

LARGEST = 1e9
"""Percent."""


@dataclass(frozen=True)
class Judged:
    """One parameter's error in percent beside its limit; None where there was no estimate."""

    parameter: str
    error: float | None
    limit: float

    @property
    def passed(self) -> bool:
        """Whether there is an estimate and its error is within the limit."""
        return self.error is not None and self.error <= self.limit

    @property
    def text(self) -> str:
        """One line for the terminal."""
        word = "ok  " if self.passed else "OVER"
        size = "no estimate" if self.error is None else f"{self.error:.4g} %"
        return f"{word}  {self.parameter:12}  {size:>12}  limit {self.limit:.4g} %"


class _Tolerances(BaseModel):
    model_config = ConfigDict(extra="forbid")

    max_error_percent: dict[str, Annotated[float, Field(ge=0)]] = Field(min_length=1)


def judge(result: Result, largest: float | str | Path) -> list[Judged]:
    """Rows of Table 4 beside their limits.

    Parameters
    ----------
    result : Result
    largest : float, 'paper' or path
        One limit for all in percent; the paper's; or a TOML file with a table
        ``[max_error_percent]``.

    Raises
    ------
    SettingError
        If the limit is none, or names a parameter that is no row of Table 4.
    ResultError
        If the result holds no truth to compare with, or no case of the paper.
    """
    log, names = result.log.path, [row.parameter for row in result.table4 if row.truth is not None]
    if not names:
        raise ResultError(
            f"{log}: the log holds no true parameters; only synthetic logs can be checked"
        )
    limits: Mapping[str, float | None]
    if largest == "paper":
        limits = {row.parameter: row.paper_error_percent for row in result.table4}
        if not any(limits[name] is not None for name in names):
            raise ResultError(
                f"{log}: not a case of the paper; give {flag('max_error')} in percent"
            )
    elif str(largest).endswith(".toml"):
        limits = read_toml(Path(str(largest)), _Tolerances).max_error_percent
        for name in limits:
            if name not in names:
                raise SettingError(
                    f"{largest}: max_error_percent.{name}: expected one of {', '.join(names)}"
                )
    else:
        try:
            percent = float(largest)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            percent = -1.0
        if not 0 <= percent <= LARGEST:
            raise SettingError(
                f"{flag('max_error')}: expected a number from 0 to {LARGEST:g}, paper, or a TOML "
                f"file, found {largest!r:.60}"
            )
        limits = dict.fromkeys(names, percent)
    judged = []
    for row in result.table4:
        limit = limits.get(row.parameter)
        if row.truth is not None and limit is not None:
            judged.append(Judged(row.parameter, row.error_percent, limit))
    return judged
