"""The result made from an estimator's outcome: its logs, the notices about them, Table 4."""

from __future__ import annotations

from pathlib import PurePath

from algid import __version__
from algid.identification.outcome import Identified
from algid.identification.survey import Survey
from algid.log import Truth
from algid.notices import Notice, has_code, merged
from algid.results import Result
from algid.settings import Settings
from algid.table4 import paper_errors, table4, true_parameters, true_rows

CONTRADICTED = ("WRONG_CONVENTION", "LOST_SAMPLES")
"""Checks by which estimates are wrong, unless the user accepts them.

A time base that is too short by the samples it lacks falsifies accelerations by twice their share.
"""


def _replaced_by_fit(outcome: Identified, settings: Settings) -> tuple[str, ...]:
    """Codes of checks of single logs that the fit of all of them makes more precisely."""
    codes = []
    if has_code(outcome.notices, "PHASES", "PHASE"):
        codes.append("ZERO_OFFSET")
    if settings.effort is not None:
        codes.append("GRAVITY_COMPENSATED")
    return tuple(codes)


def result_of(outcome: Identified, settings: Settings, survey: Survey) -> Result:
    """The result of `outcome` on a survey's logs, the first log first."""
    truth = survey.logs[0].origin.truth
    payload = None
    if survey.loaded and survey.loaded[0].origin.truth:
        payload = survey.loaded[0].origin.truth.payload
    replaced = _replaced_by_fit(outcome, settings)
    of_logs: list[Notice] = []
    lost = contradicted = False
    for log in survey.logs:
        for notice in survey.notices(log):
            if notice.code in replaced:
                continue
            of_logs.append(notice.of(PurePath(log.name).name))  # the paths stand among the logs
            lost |= notice.lossy
            if notice.code in CONTRADICTED and notice.code not in log.origin.reading.accepted:
                contradicted = True
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
        table4=table4(outcome.rows, outcome.stds, true_rows(truth, payload), paper_errors(truth)),
        truth=true_parameters(truth, payload),
        fit=outcome.fit,
        settings=settings.as_json(),
        log=summaries[0],
        more_logs=summaries[1:],
        data_lost=lost,
        notices=list(merged(of_logs)) + _other_arms(survey, truth) + outcome.notices,
    )


def _other_arms(survey: Survey, truth: Truth | None) -> list[Notice]:
    """A notice of each synthetic log that another arm than the first log's made."""
    notices = []
    for log in survey.logs:
        own = log.origin.truth
        if truth and own and own.arm != truth.arm:
            numbers = {"first": survey.logs[0].name}
            notices.append(Notice("OTHER_ARM", numbers=numbers, logs=(log.name,)))
    return notices
