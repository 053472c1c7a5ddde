"""The pages of a result, of a track or of a batch, made anew."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from algid.api import Answer
from algid.api.options import Export, verb
from algid.base.errors import ResultError, SettingError
from algid.options import Option, flag

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.report.document import Document


@verb
def report(
    results: Annotated[Iterable[str | Path], Option(kind=list[Path])],
    *,
    out: str | Path | None = None,
    export: Export = False,
    shared_library: bool = False,
    progress: Progress | None = None,
) -> list[Answer]:
    """Write report.html and report.md into each RESULT, or fleet.html into a batch, and print it.

    A batch's history tells which robots' parameters drift and which logs stand out, beside its
    fleet.parquet and findings.parquet. Robots and times come from the manifest, or from the logs'
    folders and stamps.

    Parameters
    ----------
    results : paths
        Folders of algid identify, algid track or algid batch.
    out : path
        Folder for a batch's history; the batch's own by default.
    export : bool
        Also write estimates.mcap, for Foxglove and PlotJuggler.
    shared_library : bool
        Put the plotting library once beside the folders.
    progress : callable
        Called as samples are read.

    Returns
    -------
    list of Answer
        Of each what is printed.

    Raises
    ------
    ResultError
        If a folder holds none of them.
    OutputError
        If the pages cannot be written.
    SettingError
        If `out` is given beside what is no batch.

    Examples
    --------
    $ algid report case1-unloaded.algid --export mcap
    """
    from algid.tracks.result import is_track

    made = []
    for folder in map(Path, results):
        if (folder / "jobs.parquet").is_file():
            from algid.fleet.history import history_of
            from algid.fleet.page import write_history

            history = history_of(folder / "jobs.parquet", progress)
            document, written = write_history(history, Path(out or folder))
            shown: Iterable[Document] = [document]
            as_json = history.as_json
        elif out is not None:
            raise SettingError(f"{flag('out')}: {folder} is no batch, and keeps its pages itself")
        elif is_track(folder):
            from algid.tracks import page
            from algid.tracks.result import read_track, track_json

            track = read_track(folder)
            written = page.write_pages(track, folder, bool(export))
            shown, as_json = map(page.track_document, [track]), partial(track_json, track)
        else:
            from algid.report.export import export_mcap
            from algid.report.page import result_document, write_pages
            from algid.results import read_result, result_json

            result = read_result(folder)
            try:
                written = write_pages(folder, shared_library, progress)
                if export:
                    written.append(export_mcap(folder, progress))
            except (LookupError, TypeError, ValueError) as error:  # as a column that is not there
                raise ResultError(
                    f"{folder}: its series do not go with its result ({type(error).__name__}: "
                    f"{error}); identify again with this version"
                ) from error
            shown, as_json = map(result_document, [result]), partial(result_json, result)
        made.append(Answer(shown, as_json, [f"wrote {path}" for path in written]))
    return made
