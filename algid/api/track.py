"""The payload in time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.api.given import folder_or_none, meant
from algid.api.options import meaning
from algid.api.ranges import check

if TYPE_CHECKING:
    from algid.api.options import ProfileLike
    from algid.identification.source import LogLike
    from algid.progress import Progress
    from algid.report.document import Document
    from algid.results import Result
    from algid.tracks.result import TrackResult


def track(
    log: LogLike,
    parameters: Result | str | Path,
    *,
    l1: float | None = None,
    l2: float | None = None,
    profile: ProfileLike | None = None,
    out: str | Path | None = None,
    force: bool = False,
    export: bool = False,
    command: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> TrackResult:
    """Find when the payload changed during a log, and what each stretch weighs.

    Parameters
    ----------
    log : path, `Log`, pandas or polars frame, or dict of arrays
        Of the arm while objects are picked and placed.
    parameters : Result or path of one
        The arm, with error bars.
    l1, l2 : float, m
        Link lengths; what the result knows best by default.
    profile : Profile, path of one, or dict of what would stand in its file
        Where it is silent, what was said of the result's logs.
    out : Path
        Folder to write the folder ``LOG.track`` into; None writes nothing.
    force : bool
        Replace a track that is there.
    export : bool
        Also write ``track.mcap``.
    command : str
        The command line behind the call, for the result.
    progress : callable
        Called as the work goes on.
    **options : settings of `Profile` by their names

    Returns
    -------
    TrackResult
        Its stretches with masses, intervals and statuses, and the payload in time.

    Raises
    ------
    LogError
        If the log cannot be used or is too short.
    ResultError
        If the result cannot be read, or leaves a constant or a link length open.
    OutputError
        If a track is there already and `force` is not set, or cannot be written.
    SettingError
        If a setting is not known or wrong.

    Examples
    --------
    >>> import algid
    >>> noise = {"duration": 6.0, "torque_noise": 1e-2, "excitation": "wide"}
    >>> arm = algid.identify(*algid.synthesise("case1", **noise), model="plain")
    >>> (picking,) = algid.synthesise("case1", payload_schedule=[(3.0, 0.1)], **noise)
    >>> found = algid.track(picking, arm)
    >>> len(found.track.stretches), round(found.track.stretches[1].m_p, 2)
    (2, 0.1)
    """
    from algid.tracks.page import track_folder, write_track
    from algid.tracks.run import track_log

    check("track", l1=l1, l2=l2)
    own = meaning(profile, options)
    log = meant(log, own)
    folder = None
    if out is not None:
        folder = track_folder(_name(log), Path(out))
    if progress is not None:
        progress("weighing the payload", 0, 0)
    settings = {}
    if command is not None:
        settings["command"] = command
    with folder_or_none(folder, force) as temporary:
        result = track_log(log, parameters, l1=l1, l2=l2, profile=own, settings=settings)
        if temporary is not None:
            write_track(result, temporary, mcap=export)
    return result


def folder_of(log: str | Path, out: Path) -> Path:
    """Where the track of a log goes."""
    from algid.tracks.page import track_folder

    return track_folder(str(log), out)


def failed(result: TrackResult) -> bool:
    """Whether a track must not be used as it is."""
    from algid.tracks.tables import verdict

    return verdict(result).failed or not result.complete


def document(result: TrackResult) -> Document:
    """The report of a track."""
    from algid.tracks.page import track_document

    return track_document(result)


def as_json(result: TrackResult) -> str:
    """The text of ``track.json``."""
    from algid.tracks.result import track_json

    return track_json(result)


def _name(log: LogLike) -> str:
    """What a log is called: its path, or what one in memory calls itself."""
    from algid.log import Log

    if isinstance(log, Log):
        return log.origin.path
    if isinstance(log, str | Path):
        return str(log)
    return "log"
