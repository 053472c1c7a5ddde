"""The pages of a result's or a track's folder, made anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from algid.progress import Progress
    from algid.report.document import Document


@dataclass(frozen=True)
class Reported:
    """The files that were written, and what prints the result or track."""

    written: list[Path]
    document: Callable[[], Document]
    as_json: Callable[[], str]


def report(
    folder: Path,
    *,
    export: bool = False,
    shared_library: bool = False,
    progress: Progress | None = None,
) -> Reported:
    """Write ``report.html`` and ``report.md`` into the folder of a result or a track.

    Raises
    ------
    ResultError
        If the folder holds neither.
    OutputError
        If the pages cannot be written.
    """
    from algid.tracks.read import is_track

    if is_track(folder):
        return _of_track(folder, export)
    return _of_result(folder, export, shared_library, progress)


def _of_result(
    folder: Path, export: bool, shared_library: bool, progress: Progress | None
) -> Reported:
    from algid.api import identify
    from algid.report.export import export_mcap
    from algid.report.page import write_pages
    from algid.results import read_result

    result = read_result(folder)
    written = write_pages(folder, shared_library, progress)
    if export:
        written.append(export_mcap(folder, progress))
    return Reported(
        written,
        lambda: identify.document(result),
        lambda: identify.as_json(result),
    )


def _of_track(folder: Path, export: bool) -> Reported:
    from algid.api import track
    from algid.tracks.page import write_pages
    from algid.tracks.read import read_track

    result = read_track(folder)
    written = write_pages(result, folder, export)
    return Reported(
        written,
        lambda: track.document(result),
        lambda: track.as_json(result),
    )
