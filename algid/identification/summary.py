"""The result made from an estimator's outcome: its logs, the notices about them, Table 4."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePath

from algid import __version__
from algid.identification.outcome import Identified, distrusted
from algid.identification.survey import Survey
from algid.notices import Notice, merged
from algid.results import Result
from algid.settings import Settings
from algid.table4 import paper_errors, table4, true_parameters, true_rows

CONTRADICTED = ("WRONG_CONVENTION", "LOST_SAMPLES")
"""Checks by which estimates are wrong, unless the user accepts them.

A time base that is too short by the samples it lacks falsifies accelerations by twice their share.
"""


def _said_of_fit(outcome: Identified, settings: Settings) -> tuple[str, ...]:
    """Codes of checks of single logs that the fit of all of them says better."""
    phases = any(one.code in ("PHASES", "PHASE") for one in outcome.notices)
    weightless = settings.effort is not None
    return (*(("ZERO_OFFSET",) * phases), *(("GRAVITY_COMPENSATED",) * weightless))


def result_of(outcome: Identified, settings: Settings, survey: Survey) -> Result:
    """The result of `outcome` on a survey's logs, the first log first."""
    truth = survey.logs[0].origin.truth
    payload = next(
        (log.origin.truth.payload if log.origin.truth else None for log in survey.loaded), None
    )
    first, *others = [survey.summary(log) for log in survey.logs]
    noticed = [
        (log, notice)
        for log in survey.logs
        for notice in survey.notices(log)
        if notice.code not in _said_of_fit(outcome, settings)
    ]
    # the paths stand among the logs
    of_logs = [notice.of(PurePath(log.name).name) for log, notice in noticed]
    others_arms = [
        Notice("OTHER_ARM", numbers={"first": survey.logs[0].name}, logs=(log.name,))
        for log in survey.logs
        if truth and log.origin.truth and log.origin.truth.arm != truth.arm
    ]
    if any(
        one.code in CONTRADICTED and one.code not in log.origin.reading.accepted
        for log, one in noticed
    ):
        outcome = replace(
            outcome,
            parameters=distrusted(outcome.parameters),
            loaded=distrusted(outcome.loaded),
            payload=distrusted(outcome.payload),
        )
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
        log=first,
        more_logs=others,
        data_lost=any(notice.lossy for _, notice in noticed),
        notices=[*merged(of_logs), *others_arms, *outcome.notices],
    )
