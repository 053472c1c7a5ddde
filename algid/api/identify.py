"""From logs to parameters, payload and error bars."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.api.given import meant
from algid.api.options import with_options
from algid.api.result import Result
from algid.options import flag
from algid.settings import Settings

if TYPE_CHECKING:
    from algid.api.options import ProfileLike
    from algid.identification.source import LogLike
    from algid.progress import Progress
    from algid.report.document import Document
    from algid.results import Result as PlainResult


def identify(
    unloaded: LogLike | Iterable[LogLike] | None,
    loaded: LogLike | Iterable[LogLike] | None = None,
    settings: Settings | None = None,
    *,
    parameters: PlainResult | str | Path | None = None,
    profile: ProfileLike | None = None,
    out: str | Path | None = None,
    name: str | None = None,
    force: bool = False,
    report: bool = True,
    export: bool = False,
    command: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Result:
    """Identify the constants k1 … k7 of an arm and, from loaded logs, its tip payload.

    Parameters
    ----------
    unloaded, loaded : path, `Log`, pandas or polars frame, or dict of arrays; or several
        Logs of the arm without and with the payload. The columns of frames and dicts are found by
        their names and by `profile`, as those of a file.
    settings : Settings
    parameters : Result or path of one
        An arm identified before; then no unloaded log is needed.
    profile : Profile, path of one, or dict of what would stand in its file
        What the logs' names, units and signs mean; where it is silent, what was said of the
        earlier result's logs.
    out : Path
        Folder to write into; None writes nothing.
    name : str
        Of the result folder, ``NAME.algid``; the stem of the first log by default.
    force : bool
        Replace a result that is there.
    report : bool
        Write time series and pages beside ``result.json``.
    export : bool
        Write ``estimates.mcap`` beside them.
    command : str
        The command line behind the call, for the result.
    progress : callable
        Called with the stage and how many samples of how many it has gone over, as the work goes
        on.
    **options : of `Settings` and of `Profile`, by their names
        ``estimator="weak"``, ``zero="hanging"``: over `settings` and `profile`, as flags are over
        a file. `velocity` is that of `Settings`.

    Returns
    -------
    Result
        Each estimate with standard deviation, 95 % interval, unit and status; what is not
        identifiable says so.

    Raises
    ------
    AlgidError
        If a log cannot be used, or nothing can be written.
    SettingError
        If a setting is not known or wrong, there is neither an unloaded log nor `parameters`, or
        logs are to be cross-validated of which there is one alone.

    Examples
    --------
    >>> import algid
    >>> logs = algid.synthesise("case1", duration=3.0, excitation="wide")
    >>> result = algid.identify(*logs, estimator="weak")
    >>> round(result.payload["m_p"].estimate, 3)
    0.352
    """
    from algid.identification.identify import identify as run

    asked, meaning = with_options(settings, profile, options)
    unloaded, loaded = meant(unloaded, meaning), meant(loaded, meaning)
    if export and not report:
        from algid.errors import SettingError

        raise SettingError(
            f"{flag('export')}: the log is made from the time series; leave "
            f"{flag('report', off=True)} out"
        )
    result = run(
        unloaded,
        loaded,
        asked,
        parameters=parameters,
        profile=meaning,
        out=out,
        name=name,
        force=force,
        report=report,
        export=export,
        command=command,
        progress=progress,
    )
    return Result.of(result)


def folder_of(result: PlainResult, out: Path, name: str | None) -> Path:
    """Where a result goes."""
    from algid.files import result_folder

    return result_folder(result.log.path, out, name)


def document(result: PlainResult) -> Document:
    """The report of a result."""
    from algid.report.page import result_document

    return result_document(result)


def as_json(result: PlainResult) -> str:
    """The text of ``result.json``."""
    from algid.results import result_json

    return result_json(result)
