"""Predict the torque of logs that a result was not made from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.api.given import called, meant, opened
from algid.api.options import meaning
from algid.api.ranges import check
from algid.results import Result

if TYPE_CHECKING:
    from algid.api.options import ProfileLike
    from algid.identification.source import LogLike
    from algid.identification.validated import Validated
    from algid.progress import Progress


def validate(
    result: Result | str | Path,
    logs: LogLike | Iterable[LogLike] | None,
    loaded: LogLike | Iterable[LogLike] | None = None,
    *,
    max_nrmse: float | None = None,
    simulate: bool = False,
    profile: ProfileLike | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Validated:
    """How well a result, or a URDF file, predicts the torque of logs.

    Parameters
    ----------
    result : Result, path of one, or of a URDF file
    logs, loaded : logs as `algid.identify` takes them
        Of the arm without and with the payload.
    max_nrmse : float
        The largest RMSE over the torque's RMS allowed, for either joint: see `Validated.over`.
    simulate : bool
        Also simulate the arm over 0.1, 0.5 and 2 s.
    profile : Profile, path of one, or dict of what would stand in its file
        Where it is silent, what was said of the result's logs.
    progress : callable
        Called as samples are read.
    **options : settings of `Profile` by their names

    Returns
    -------
    Validated
        RMSE, normalised RMSE and R² of each log and of all, and warnings.

    Raises
    ------
    ResultError
        If the result cannot be read, or lacks a parameter that the prediction needs.
    LogError
        If a log cannot be used.
    SettingError
        If a setting is not known or wrong.

    Examples
    --------
    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=4.0, excitation="wide")
    >>> result = algid.identify(log.part(0, 2000), estimator="weak")
    >>> algid.validate(result, log.part(2000, 4001)).total.r2[0] > 0.999
    True
    """
    from algid.identification.identify import reused
    from algid.identification.source import open_sources, read_otherwise
    from algid.identification.survey import Survey
    from algid.identification.validate import predictor_of
    from algid.identification.validate import simulate as roll
    from algid.identification.validate import validate as judge
    from algid.identification.validated import Validated

    known, own = None, meaning(profile, options)
    logs, loaded = meant(logs, own), meant(loaded, own)
    check("validate", max_nrmse=max_nrmse)
    file = called(result)
    if not isinstance(result, Result) and Path(result).suffix == ".urdf":
        from algid.exports.read_urdf import read_urdf

        model = read_urdf(Path(result))
    else:
        known = opened(result)
        model, own = predictor_of(known, file), reused(own, known)
    gravity = model.model.gravity
    sources = open_sources(logs, "unloaded", own, gravity)
    sources += open_sources(loaded, "loaded", own, gravity)
    survey = Survey(sources, progress)
    survey.begin("prediction")
    validation = judge(model, survey)
    rolled, warnings = None, []
    if simulate:
        rolled = roll(model, survey)
    if known is not None:
        summaries = [survey.summary(log) for log in survey.logs]
        warnings = [one.sentence for one in read_otherwise(summaries, known, file)]
    return Validated(validation.logs, validation.total, rolled, tuple(warnings), max_nrmse)
