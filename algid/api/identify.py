"""From logs to parameters, payload and error bars: a result, with what goes beyond its file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from algid import results
from algid.api import Answer
from algid.api.options import (
    AnyResult,
    Export,
    Folder,
    LogOptions,
    Logs,
    Options,
    ProfileLike,
    meant,
    settings_of,
    verb,
)
from algid.base.errors import SettingError
from algid.base.exits import exit_of
from algid.options import flag

if TYPE_CHECKING:
    import polars as pl
    from plotly.graph_objects import Figure

    from algid.base.progress import Progress
    from algid.identification.open_logs import LogLike
    from algid.settings import Settings


class Result(results.Result):  # noqa: D101
    __doc__ = results.Result.__doc__

    @classmethod
    def of(cls, plain: results.Result) -> Result:
        """The result with these methods."""
        return plain if isinstance(plain, cls) else cls.model_construct(**dict(plain))

    def predict(
        self,
        log: LogLike,
        *,
        loaded: bool = False,
        profile: ProfileLike | None = None,
        **options: Unpack[LogOptions],
    ) -> pl.DataFrame:
        """The torque that the result predicts along a log, beside the measured one.

        Parameters
        ----------
        log : path, `Log`, pandas or polars frame, or dict of arrays
        loaded : bool
            Whether the arm carried the payload.
        profile : Profile, path of one, or dict of what would stand in its file
            Where it is silent, what was said of the result's logs.
        **options : settings of `Profile` by their names

        Returns
        -------
        polars.DataFrame
            A row a sample: t in s, theta1, theta2 in rad, omega1, omega2 in rad/s, tau1, tau2,
            tau1_predicted, tau2_predicted in N m. The prediction is smoothed as far as the angles'
            noise asks, and NaN at both ends of a stretch, where the smoother has no samples.

        Raises
        ------
        LogError
            If the log cannot be used.
        ResultError
            If the result lacks a parameter that the prediction needs.
        SettingError
            If a setting is not known or wrong.

        Examples
        --------
        >>> import algid
        >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
        >>> found = algid.identify(log, estimator="weak").predict(log)
        >>> left = (found["tau1"] - found["tau1_predicted"]).fill_nan(None).drop_nulls()
        >>> bool(left.std() < 0.01 * found["tau1"].std())
        True
        """
        from algid.identification.validate import predicted

        own, log = meant(profile, options, log)
        return predicted(self, log, "loaded" if loaded else "unloaded", own)

    def plot(self) -> Figure:
        """The page's figure of every estimate with its 95 % interval, in percent of the estimate.

        Returns
        -------
        plotly.graph_objects.Figure
            A notebook shows it; ``write_image`` and ``write_html`` write it.

        Examples
        --------
        >>> import algid
        >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
        >>> algid.identify(log, estimator="weak").plot().data[0].y[:3]
        ('k1', 'k2', 'k3')
        """
        from plotly.graph_objects import Figure

        from algid.report.figures import intervals

        panels = intervals(self)
        return Figure({"data": panels.data, "layout": panels.layout})

    def __str__(self) -> str:
        from algid.report.terminal import brief

        return "\n".join([self.subject, *brief(self)])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """For notebooks."""
        from algid.report.render import notebook

        return notebook(self, self.subject)


@verb
def identify(
    unloaded: Logs | None,
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
    from algid.identification.identify import identify as run

    asked, of_profile = settings_of(settings, profile, options)
    own, unloaded, loaded = meant(profile, of_profile, unloaded, loaded)
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
        loaded = [*given["unloaded"], *given.get("loaded", ())]
        return given | {"unloaded": None, "loaded": loaded}
    return given


def answer(result: results.Result, given: Mapping[str, Any]) -> Answer:
    """The estimates; 3 where the result must not be used as it is, 4 where data were lost."""
    from algid.base.files import result_folder
    from algid.report.page import result_document
    from algid.report.terminal import brief

    return Answer(
        map(result_document, [result]) if given["verbose"] else brief(result),
        lambda: results.result_json(result),
        [f"wrote {result_folder(result.log.path, given['out'], given.get('name'))}"],
        exit=exit_of(failed=result.verdict.failed or not result.complete, lost=result.data_lost),
    )


def read_result(path: str | Path) -> Result:
    """Read a result.

    Parameters
    ----------
    path : str or Path
        The result file, or the folder that holds its `result.json`.

    Returns
    -------
    Result
        One of an earlier schema version comes back as of this one.

    Raises
    ------
    ResultError
        If it is missing, not a result, or of another schema version.

    Examples
    --------
    >>> import tempfile
    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=3.0, torque="wide")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = algid.identify(log, estimator="weak", out=folder, name="arm", report=False)
    ...     algid.read_result(f"{folder}/arm.algid") == made
    True
    """
    return Result.of(results.read_result(path))
