"""From a log and an arm's result to a judged track."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid import __version__
from algid.base.errors import LogError
from algid.base.files import read_whole
from algid.base.runtime import one_blas_thread
from algid.estimators.problem import TooShortError
from algid.identification.known import as_logged, contradictions, reused
from algid.identification.open_logs import LogLike, open_source, read_otherwise
from algid.identification.recordings import Recordings
from algid.notices import Notice, lossy, merged
from algid.results import Result, read_result, result_json
from algid.tracks.arm import arm_of
from algid.tracks.payload import track
from algid.tracks.result import TrackResult

if TYPE_CHECKING:
    from algid.profile import Profile


def track_log(
    log: LogLike,
    parameters: Result | str | Path,
    *,
    l1: float | None = None,
    l2: float | None = None,
    profile: Profile | None = None,
    settings: Mapping[str, Any] | None = None,
) -> TrackResult:
    """Find when the payload changed during a log and what each stretch weighs.

    Parameters
    ----------
    log : path or `Log`
    parameters : Result or path of one
        The arm.
    l1, l2 : float, m
        Link lengths; the result's by default.
    profile : Profile
        What the log's names, units and signs mean; where it is silent, what was said of the
        result's logs.
    settings : mapping
        What else the result should hold of the call.

    Raises
    ------
    LogError
        If the log cannot be used or is too short.
    ResultError
        If the result cannot be read, or leaves a constant or a link length open.
    """
    if isinstance(parameters, Result):
        result, content, called = parameters, result_json(parameters).encode(), parameters.log.path
    else:
        file, called = Path(parameters), str(parameters)
        result = read_result(file)
        content = read_whole(file / "result.json" if file.is_dir() else file)
    profile = reused(profile, result, called)
    source = open_source(log, "loaded", profile, profile.gravity, changing=True)
    survey = Recordings([source])
    first = next(survey.segments(source), None)
    if first is None:
        raise LogError(f"{source.name}: it holds no samples; record longer")
    arm, covariance = arm_of(as_logged(result, profile), first, l1, l2)
    try:
        with one_blas_thread():
            weighed = track(partial(survey.segments, source), arm, covariance)
    except TooShortError as error:
        raise LogError(f"{source.name}: {error}; record longer") from error
    truth, of_log = source.origin.truth, survey.whole(source).notices
    judged = result.verdict
    notices = []
    if judged.grade != "good":
        numbers = {"grade": judged.word.lower(), "headline": judged.headline}
        notices.append(Notice("ARM_DOUBTFUL", numbers=numbers))
    lengths = {name: one for name, one in (("l1", l1), ("l2", l2)) if one is not None}
    notices += contradictions(result, lengths)
    notices += read_otherwise([survey.summary(source)], result, called)
    notices += merged(of_log)
    schedule = None
    if truth is not None:
        schedule = truth.schedule or ((0.0, truth.payload),)
    own_settings = {name: arm.value(name) for name in ("l1", "l2")}
    own_settings["gravity"] = arm.model.gravity
    return TrackResult(
        track=weighed,
        log=survey.summary(source),
        arm=called,
        arm_sha256=hashlib.sha256(content).hexdigest(),
        settings=own_settings | dict(settings or {}),
        version=__version__,
        schedule=schedule,
        notices=tuple(notices),
        data_lost=lossy(of_log),
    )
