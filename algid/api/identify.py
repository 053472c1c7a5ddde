"""From logs to parameters, payload and error bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Unpack

from algid.api import Answer
from algid.api.options import (
    AnyResult,
    Export,
    Folder,
    Logs,
    Options,
    ProfileLike,
    meant,
    settings_of,
    verb,
)
from algid.base.errors import SettingError, exit_of
from algid.options import flag

if TYPE_CHECKING:
    from algid.api.result import Result
    from algid.base.progress import Progress
    from algid.results import Result as PlainResult
    from algid.settings import Settings


@verb
def identify(
    unloaded: Logs | None = None,
    loaded: Logs | None = None,
    settings: Settings | None = None,
    *,
    parameters: AnyResult | None = None,
    profile: ProfileLike | None = None,
    out: Folder | None = None,
    name: str | None = None,
    force: bool = False,
    report: bool = True,
    export: Export = False,
    command: str | None = None,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> Result:
    """Identify an arm's constants k1 … k7 and, with loaded logs, its payload; write LOG.algid.

    Parameters
    ----------
    unloaded : path, `Log`, pandas or polars frame, or dict of arrays; or several
        Logs of the arm without payload; with --parameters, of the loaded one. The columns of
        frames and dicts are found by their names and by `profile`, as those of a file. In Python
        these logs are without payload, and `loaded` with it, also beside `parameters`.
    loaded : as unloaded
        A log of the arm with its payload; may be repeated.
    settings : Settings
    parameters : Result or path of one
        Result of the arm identified before. Then no unloaded log is needed.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what the logs' names and units mean. Where it is silent, what was said of the
        earlier result's logs.
    out : Path
        Folder for the result folder LOG.algid. None writes nothing.
    name : str
        Name of the result folder, NAME.algid.
    force : bool
        Replace what is there.
    report : bool
        Write no pages and time series.
    export : bool
        Also write estimates.mcap, for Foxglove.
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
    $ algid identify run-unloaded.mcap --loaded run-loaded.mcap -o results

    >>> import algid
    >>> logs = algid.synthesise("case1", duration=3.0, torque="wide")
    >>> result = algid.identify(*logs, estimator="weak")
    >>> round(result.payload["m_p"].estimate, 3)
    0.352
    """
    from algid.api.result import Result
    from algid.identification.identify import identify as run

    asked, of_profile = settings_of(settings, options)
    own, unloaded, loaded = meant(profile, of_profile, unloaded, loaded, earlier=parameters)
    if export and not report:
        raise SettingError(
            f"{flag('export')}: the log is made from the time series; leave "
            f"{flag('report', off=True)} out"
        )
    result = run(
        unloaded,
        loaded,
        asked,
        parameters=parameters,
        profile=own,
        out=out,
        name=name,
        force=force,
        report=report,
        export=bool(export),
        command=command,
        progress=progress,
    )
    return Result.of(result)


def typed(given: dict[str, Any]) -> dict[str, Any]:
    """What a command gives: beside the parameters of an arm its logs are of the loaded one."""
    if "parameters" in given:
        loaded = [*given.get("unloaded", ()), *given.get("loaded", ())]
        return given | {"unloaded": None, "loaded": loaded}
    return given


def answer(result: PlainResult, given: Mapping[str, Any]) -> Answer:
    """The estimates; 3 where the result must not be used as it is, 4 where data were lost."""
    from algid.base.files import result_folder
    from algid.report.page import result_document
    from algid.report.terminal import brief
    from algid.results import result_json

    return Answer(
        map(result_document, [result]) if given["verbose"] else brief(result),
        lambda: result_json(result),
        [f"wrote {result_folder(result.log.path, given['out'], given.get('name'))}"],
        exit=exit_of(failed=result.verdict.failed or not result.complete, lost=result.data_lost),
    )
