"""The result that is made of what an estimator found: its logs, what was noticed in them, Table 4, causes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

from algid import __version__
from algid.identification.outcome import Identified, distrusted
from algid.identification.source import LogSource
from algid.identification.survey import Survey
from algid.log import Notice
from algid.results import Cause, Result
from algid.settings import Settings
from algid.table4 import paper_errors, table4, true_parameters, true_rows

NAMED = 3  # logs that a warning names beside the first
SUSPICIOUS = (
    *("WRONG_CONVENTION", "ZERO_OFFSET", "FLIPPED_SIGN", "WRONG_ZERO", "GRAVITY_COMPENSATED", "STUCK_SENSOR"),
    *("DEAD_EFFORT", "LOST_SAMPLES"),
)
"""Named checks that say why estimates would be wrong."""
CONTRADICTED = ("WRONG_CONVENTION", "LOST_SAMPLES")
"""Named checks that say that estimates are wrong, unless the user accepts them: of a time base that is too short by the
samples it lacks, accelerations are wrong by twice their share."""


def result_of(outcome: Identified, settings: Settings, survey: Survey) -> Result:
    """The result of `outcome` on a survey's logs, the first log first."""
    truth = survey.logs[0].origin.truth
    payload = next((log.origin.truth.payload if log.origin.truth else None for log in survey.loaded), None)
    first, *others = [survey.summary(log) for log in survey.logs]
    noticed = [(log, notice) for log in survey.logs for notice in survey.seen(log).notices]
    if any(one.code in CONTRADICTED and one.code not in log.origin.reading.accepted for log, one in noticed):
        outcome = replace(
            outcome,
            parameters=distrusted(outcome.parameters),
            loaded=distrusted(outcome.loaded),
            payload=distrusted(outcome.payload),
        )
    suspicious = {notice.code: notice for _, notice in reversed(noticed)}
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
        notes=[*_notices([(log, notice) for log, notice in noticed if notice.note]), *outcome.notes],
        warnings=[
            *_notices([(log, notice) for log, notice in noticed if not notice.note]),
            *(
                f"{log.name}: its metadata name another arm than {survey.logs[0].name}"
                for log in survey.logs
                if truth and log.origin.truth and log.origin.truth.arm != truth.arm
            ),
            *outcome.warnings,
        ],
        causes=[
            *outcome.causes,
            *(
                Cause(cause=suspicious[code].text.removeprefix(f"{code}: "), flags=list(suspicious[code].flags))
                for code in SUSPICIOUS
                if code in suspicious
            ),
        ],
    )


def _notices(noticed: Sequence[tuple[LogSource, Notice]]) -> Iterator[str]:
    """What was noticed in the logs, by their names: each loss, and of the rest the first of each kind."""
    named = [(PurePath(log.name).name, notice) for log, notice in noticed]  # the paths stand among the logs
    yield from (f"{name}: {notice.text}" for name, notice in named if notice.lossy)
    rest = [(name, notice) for name, notice in named if not notice.lossy]
    for code in dict.fromkeys(notice.code for _, notice in rest):
        (name, notice), *alike = [one for one in rest if one[1].code == code]
        others = list(dict.fromkeys(other for other, _ in alike if other != name))
        likewise = f" (and {len(alike)} more of the kind)" if alike else ""
        if others:
            more = ", …" if len(others) > NAMED else ""
            likewise = f"; likewise in {len(others)} other log{'s' * (len(others) > 1)}"
            likewise += f" ({', '.join(others[:NAMED])}{more})"
        yield f"{name}: {notice.text}{likewise}"
