"""Logs that are still being written are left alone until their size has come to rest."""

from __future__ import annotations

from collections.abc import Sequence

from algid.batch.jobs import Job
from algid.batch.records import stat_of

LOOK_EVERY = 2.0  # s


class Settling:
    """Tells jobs whose logs have not changed since the look before."""

    def __init__(self) -> None:
        self._before: dict[str, tuple[int, int]] = {}

    def settled(self, jobs: Sequence[Job]) -> list[Job]:
        """Those of `jobs` whose logs are as the last call saw them, and hold something."""
        now = {path: _look(path) for job in jobs for path in (*job.logs, *job.loaded)}
        before, self._before = self._before, now
        return [
            job
            for job in jobs
            if all(now[path] == before.get(path) and now[path][0] > 0 for path in (*job.logs, *job.loaded))
        ]


def _look(path: str) -> tuple[int, int]:
    seen = stat_of(path)
    return seen.size, seen.mtime_ns
