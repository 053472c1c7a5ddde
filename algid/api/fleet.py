"""The history of all robots of a batch."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from algid.fleet.history import History
    from algid.progress import Progress
    from algid.report.document import Document


def fleet(
    batch: Path, out: Path | None = None, *, progress: Progress | None = None
) -> tuple[History, list[Path]]:
    """Which robots' parameters drift and which logs stand out in a batch; and the files written.

    Raises
    ------
    ResultError
        If there is no ``jobs.parquet``, or nothing in it can be followed.
    OutputError
        If `out` cannot be written.
    """
    from algid.fleet.history import history_of, write_history

    history = history_of(batch / "jobs.parquet", progress)
    return history, write_history(history, batch if out is None else out, batch)


def document(history: History) -> Document:
    """The report of a fleet."""
    from algid.fleet.page import fleet_document

    return fleet_document(history)


def as_json(history: History) -> str:
    """What was found, as the text of a JSON file."""
    return json.dumps(history.as_dict(), indent=2, allow_nan=False) + "\n"
