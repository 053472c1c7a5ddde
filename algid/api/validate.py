"""Predict the torque of logs that a result was not made from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any, Unpack

from pydantic import BeforeValidator, Field

from algid.api import Answer
from algid.api.options import AnyResult, LogOptions, Logs, ProfileLike, called, meant, opened, verb
from algid.base.errors import Exit, SettingError, exit_of
from algid.base.limits import within
from algid.notices import Notice, lossy
from algid.options import Option, flag
from algid.results.verdict import judged_errors

if TYPE_CHECKING:
    from algid.base.progress import Progress
    from algid.identification.validate import Validated
    from algid.report.document import Table

Limit = (
    Annotated[float, within((0, 1e9))]
    | Annotated[str, Field(pattern=r"^paper$|\.toml$"), BeforeValidator(str)]
)
DOUBTFUL = 0.1
"""Of a torque's RMS: a prediction that misses more asks how its logs were read."""


@verb
def validate(
    result: AnyResult,
    logs: Logs | None = None,
    loaded: Logs | None = None,
    *,
    max_nrmse: Annotated[float, within((0, 1e9))] | None = None,
    max_error: Annotated[float | str | Path, Option(kind=str, check=Limit)] | None = None,
    simulate: bool = False,
    profile: ProfileLike | None = None,
    progress: Progress | None = None,
    **options: Unpack[LogOptions],
) -> Validated:
    """Print how well a result predicts the torque of logs; exit code 1 past a limit.

    RMSE, normalised RMSE and R². Without logs the errors of a synthetic log's result are compared
    with their limits.

    Parameters
    ----------
    result : Result, path of one, or of a URDF file
        A result folder, its result.json, or a URDF file.
    logs : logs as `algid.identify` takes them
        Logs of the arm without payload.
    loaded : logs as `algid.identify` takes them
        A log of the loaded arm; may be repeated.
    max_nrmse : float
        Largest RMSE over the torque's RMS allowed, for either joint. See `Validated.over`.
    max_error : float, in percent, 'paper' or path
        Largest error of a synthetic log's result, percent; paper; or a TOML file. The paper's are
        those of its Table 4; a file holds a table ``[max_error_percent]``: parameter = percent.
    simulate : bool
        Also simulate the arm over 0.1, 0.5 and 2 s.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what names and units mean. Where it is silent, what was said of the result's
        logs.
    progress : callable
        Called as samples are read.
    **options : settings of `Profile` by their names

    Returns
    -------
    Validated
        RMSE, normalised RMSE and R² of each log and of all, errors beside their limits, and
        warnings.

    Raises
    ------
    ResultError
        If the result cannot be read, lacks a parameter that the prediction needs, or has no truth
        to compare errors with.
    LogError
        If a log cannot be used.
    SettingError
        If a setting is not known or wrong, or there is neither a log nor `max_error`.

    Examples
    --------
    $ algid validate run1-unloaded.algid run2-unloaded.mcap --max-nrmse 0.3

    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=4.0, torque="wide")
    >>> result = algid.identify(log.part(0, 2000), estimator="weak")
    >>> algid.validate(result, log.part(2000, 4001)).total.r2[0] > 0.999
    True
    """
    from algid.identification.known import as_logged, read_otherwise, reused
    from algid.identification.prior import read_urdf
    from algid.identification.recordings import Recordings, open_sources
    from algid.identification.validate import Validated, predictor_of
    from algid.identification.validate import validate as predicted

    file = called(result)
    earlier = None if Path(file).suffix == ".urdf" else result
    own, logs, loaded = meant(profile, options, logs, loaded, earlier=earlier)
    judged = () if max_error is None else tuple(judged_errors(opened(result), max_error))  # type: ignore[arg-type]  # no path by now
    if logs is None and loaded is None:
        if max_error is None:
            raise SettingError(
                f"validate: expected a log, found none; give one, or {flag('max_error')}"
            )
        return Validated({}, None, {}, judged=judged)
    known = None if earlier is None else opened(earlier)
    if known is None:
        model = read_urdf(Path(file), own)
    else:
        own = reused(own, known, file)
        model = predictor_of(as_logged(known, own), file)
    gravity = model.model.gravity
    effort = None if own is None else own.effort
    survey = Recordings(open_sources(logs, loaded, own), progress, gravity, effort)
    survey.begin("prediction")
    found = predicted(model, survey, simulate=simulate)
    notices = list[Notice]()
    if known is not None:
        notices += read_otherwise(list(map(survey.summary, survey.logs)), known, file)
    doubtful = found.total is None or max(found.total.nrmse) > DOUBTFUL
    for log, noticed in zip(survey.logs, survey.noticed(doubtful=doubtful), strict=True):
        name = PurePath(log.name).name
        notices += [one.of(name) for one in noticed]
    warnings, lost = tuple(one.sentence for one in notices if not one.note), lossy(notices)
    return replace(found, warnings=warnings, max_nrmse=max_nrmse, judged=judged, data_lost=lost)


def answer(found: Validated, given: Mapping[str, Any]) -> Answer:
    """The tables, and what is past its limit; 1 where something is, 4 where data were lost."""

    def shown() -> Iterable[Table | str]:
        yield from (row.text for row in found.judged)
        if found.logs:
            yield from found.tables()
        if found.past:
            yield f"OVER: normalised RMSE past {given['max_nrmse']:g}"

    ended = Exit.LIMIT if found.over else exit_of(failed=False, lost=found.data_lost)
    return Answer(shown(), found.as_json, complaints=found.warnings, exit=ended)
