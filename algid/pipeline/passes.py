"""How far passes over logs have come: an estimator goes over each log as often as it needs to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from algid.progress import Told

if TYPE_CHECKING:
    from algid.pipeline.sources import LogSource


class Passes:
    """Tells of the passes over `logs`; without `told` it lets the logs be."""

    def __init__(self, told: Told | None, logs: Sequence[LogSource]) -> None:
        self.told = told
        self._stage, self._logs = "fitting", logs
        self._words = ""
        self._done: dict[int, int] = {}
        if told is not None:
            for log in logs:
                log.passes = self

    def begin(self, stage: str, logs: Sequence[LogSource]) -> None:
        """The passes from here on are over `logs`, and of that stage."""
        self._stage, self._logs, self._words = stage, logs, ""

    def advance(self, log: LogSource, rows: int) -> None:
        """A pass over `log` has come as far as `rows` samples; 0 starts one. The first over a log reads it."""
        words = self._stage if log.was_read else "reading"
        if words != self._words or (rows == 0 and id(log) in self._done):
            self._words, self._done = words, {}
        self._done[id(log)] = rows
        expected = [log.expected for log in self._logs]
        if self.told is not None:
            self.told(words, sum(self._done.values()), sum(expected) if all(expected) else 0)
