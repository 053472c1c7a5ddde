"""The payload in time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from algid.api import Answer
from algid.api.options import (
    AnyLog,
    AnyResult,
    Export,
    Folder,
    Length,
    LogOptions,
    ProfileLike,
    folder_or_none,
    meant,
    verb,
)
from algid.base.errors import exit_of

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.tracks.result import TrackResult


@verb
def track(
    log: AnyLog,
    parameters: AnyResult,
    *,
    l1: Length | None = None,
    l2: Length | None = None,
    profile: ProfileLike | None = None,
    out: Folder | None = None,
    force: bool = False,
    export: Export = False,
    command: str | None = None,
    progress: Progress | None = None,
    **options: Unpack[LogOptions],
) -> TrackResult:
    """Find when the payload changed and what each stretch weighs; write LOG.track.

    Parameters
    ----------
    log : path, `Log`, pandas or polars frame, or dict of arrays
        A log of the arm while objects are picked and placed.
    parameters : Result or path of one
        Result of the arm, with error bars.
    l1 : float, m
        Length of link 1, m; by default the result's.
    l2 : float, m
        Length of link 2, m; by default the result's.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what names and units mean. Where it is silent, what was said of the result's
        logs.
    out : Path
        Folder for the folder LOG.track. None writes nothing.
    force : bool
        Replace what is there.
    export : bool
        Also write track.mcap, for Foxglove and PlotJuggler.
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
    $ algid track picking.mcap --parameters case1-unloaded.algid -o tracks

    >>> import algid
    >>> noise = {"duration": 6.0, "torque_noise": 1e-2, "torque": "wide"}
    >>> arm = algid.identify(*algid.synthesise("case1", **noise), model="plain")
    >>> picking = algid.synthesise("case1", payload_schedule=[(3.0, 0.1)], **noise)[0]
    >>> found = algid.track(picking, arm)
    >>> len(found.track.stretches), round(found.track.stretches[1].m_p, 2)
    (2, 0.1)
    """
    from algid.log import Log
    from algid.tracks.page import track_folder, write_track
    from algid.tracks.payload import track_log

    own, log = meant(profile, options, log, earlier=parameters)
    name = str(log) if isinstance(log, str | Path) else "log"
    if isinstance(log, Log):
        name = log.origin.path
    folder = None if out is None else track_folder(name, Path(out))
    if progress is not None:
        progress("weighing the payload", 0, 0)
    settings = {} if command is None else {"command": command}
    with folder_or_none(folder, force) as temporary:
        result = track_log(log, parameters, l1=l1, l2=l2, profile=own, settings=settings)
        if temporary is not None:
            write_track(result, temporary, mcap=bool(export))
    return result


def answer(result: TrackResult, given: Mapping[str, Any]) -> Answer:
    """The report; 3 where the track must not be used as it is, 4 where data were lost."""
    from algid.tracks.page import track_document, track_folder, verdict
    from algid.tracks.result import track_json

    return Answer(
        map(track_document, [result]),
        lambda: track_json(result),
        [f"wrote {track_folder(str(given['log']), given['out'])}"],
        exit=exit_of(failed=verdict(result).failed or not result.complete, lost=result.data_lost),
    )
