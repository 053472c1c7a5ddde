"""The result made from an estimator's outcome: its logs, the notices about them, Table 4."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePath

from algid import __version__
from algid.identification.checks import FAR_APART
from algid.identification.outcome import Identified
from algid.identification.recordings import Recordings
from algid.log import Truth
from algid.model import K4
from algid.notices import Notice, has_code, merged
from algid.results import Result
from algid.results.verdict import LEAST_R2
from algid.settings import Settings
from algid.table4 import table4, true_parameters

CONTRADICTED = ("WRONG_CONVENTION", "LOST_SAMPLES", "OTHER_JOINTS")
"""Checks by which estimates are wrong, unless the user accepts them.

A time base that is too short by the samples it lacks falsifies accelerations by twice their share.
"""


def _contradicts(notice: Notice) -> bool:
    """Whether no estimate can be right of a log of which this is noticed."""
    if notice.code == "OTHER_JOINTS":
        return bool(notice.numbers.get("swing", False))
    return notice.code in CONTRADICTED


def _is_doubtful(outcome: Identified) -> bool:
    """True unless a likelihood stands, within the bounds of physics and upright."""
    if outcome.fit is None or outcome.estimator != "refined":
        return True
    return bool(outcome.fit.broken_bounds) or has_code(outcome.notices, "WRONG_ZERO")


def _replaced_by_fit(outcome: Identified, settings: Settings) -> tuple[str, ...]:
    """Checks, as code and case, of single logs that the fit of all of them makes more precisely."""
    codes = []
    if has_code(outcome.notices, "WRONG_ZERO"):
        codes.append("WRONG_ZERO:")
    if settings.effort is not None:
        codes.append("GRAVITY_COMPENSATED:arm")
    if not _is_doubtful(outcome):  # in another unit no angle's sine would fit
        codes.append("DEGREES:reach")
    return tuple(codes)


_OF_GRAVITY = ("FLIPPED_SIGN", "WRONG_ZERO")
"""Checks of single logs, on which the estimator's own has the last word."""


def _pulled_down(outcome: Identified, count: int) -> list[bool]:
    """True for each of `count` logs if gravity pulls down in its part of the fit, beyond doubt.

    The fit has to explain the torques and to break no bound. A zero that is off turns k4 into its
    sine part k4s: the model must have had that to choose from.
    """
    fit = outcome.fit
    if fit is None or fit.model is None or fit.residual is None or len(fit.by_log) != count:
        return [False] * count
    if fit.model.chosen_by != "logs" or fit.broken_bounds or fit.residual.unexplained(LEAST_R2):
        return [False] * count
    down = []
    for own in fit.by_log:
        along, across = own.get(K4), own.get(f"{K4}s")
        turned = across.estimate or 0.0 if across is not None else 0.0
        pull, std = (along.estimate, along.std) if along is not None else (None, None)
        down.append(bool(pull and std and pull > max(FAR_APART * std, abs(turned))))
    return down


def result_of(outcome: Identified, settings: Settings, survey: Recordings) -> Result:
    """The result of `outcome` on a survey's logs, the first log first."""
    truth = survey.logs[0].origin.truth
    payload = None
    if survey.loaded and survey.loaded[0].origin.truth:
        payload = survey.loaded[0].origin.truth.payload
    replaced = _replaced_by_fit(outcome, settings)
    down = _pulled_down(outcome, len(survey.logs))
    of_logs: list[Notice] = []
    lost = contradicted = False
    accepted = {code for log in survey.logs for code in log.origin.reading.accepted}
    doubtful = _is_doubtful(outcome)
    for log, is_down in zip(survey.logs, down, strict=True):
        for notice in survey.notices(log, doubtful=doubtful):
            if notice.key in replaced or (is_down and notice.code in _OF_GRAVITY):
                continue
            of_logs.append(notice.of(PurePath(log.name).name))  # the paths stand among the logs
            lost |= notice.lossy
            contradicted |= _contradicts(notice) and notice.code not in accepted
    if has_code(of_logs, "WRONG_CONVENTION"):  # of which gravity that is turned is a part
        kept = [one for one in outcome.notices if one.code != "WRONG_ZERO"]
        outcome = replace(outcome, notices=kept)
    contradicted |= has_code(outcome.notices, "WRONG_ZERO") and "WRONG_ZERO" not in accepted
    if contradicted:
        outcome = outcome.distrusted()
    summaries = [survey.summary(log) for log in survey.logs]
    return Result(
        version=__version__,
        estimator=outcome.estimator or settings.estimator,
        parameters=outcome.parameters,
        loaded=outcome.loaded,
        payload=outcome.payload,
        paper_payload=outcome.paper_payload,
        table4=table4(outcome.rows, outcome.stds, truth, payload),
        truth=true_parameters(truth, payload),
        fit=outcome.fit,
        settings=settings.as_json(),
        log=summaries[0],
        more_logs=summaries[1:],
        data_lost=lost,
        notices=list(merged(of_logs)) + _other_arms(survey, truth) + outcome.notices,
    )


def _other_arms(survey: Recordings, truth: Truth | None) -> list[Notice]:
    """A notice of each synthetic log that another arm than the first log's made."""
    notices = []
    for log in survey.logs:
        own = log.origin.truth
        if truth and own and own.arm != truth.arm:
            numbers = {"first": survey.logs[0].name}
            notices.append(
                Notice("OTHER_ARM", numbers={"case": "metadata"} | numbers, logs=(log.name,))
            )
    return notices
