"""The result that is made of what an estimator found: its logs, what was noticed in them, Table 4, causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

from algid import __version__, results
from algid.identification.outcome import ONE_RUN, Identified, distrusted
from algid.identification.source import LogSource, Survey
from algid.log import Notice, Truth
from algid.results import Cause, Estimate, Result
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
    truth, payload = _truth(survey.logs)
    first, *others = [survey.summary(log) for log in survey.logs]
    notices = [(log.name, notice) for log in survey.logs for notice in survey.seen(log).notices]
    if any(_is_contradicted(log, survey) for log in survey.logs):
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
        data_lost=any(notice.lossy for _, notice in notices),
        notes=[*_notices([(name, notice) for name, notice in notices if notice.note]), *_on_intervals(outcome)],
        warnings=[
            *_notices([(name, notice) for name, notice in notices if not notice.note]),
            *_contradictions(survey.logs),
            *outcome.warnings,
        ],
        causes=[*outcome.causes, *_suspicions(notices)],
    )


def _on_intervals(outcome: Identified) -> list[str]:
    """What blocks of logs leave out where no warning says so, how well the payload repeats, the torques' gain."""
    if outcome.fit is None:
        return []
    told = any(ONE_RUN in warning for warning in outcome.warnings)
    said = [ONE_RUN] if outcome.fit.intervals == "sandwich" and not told else []
    repeated = outcome.fit.repeatability
    said += [] if repeated is None else [_on_repeatability(repeated)]
    return said + ([] if outcome.fit.torque_gain is None else [_on_gain(outcome.fit.torque_gain)])


def _on_repeatability(found: results.Repeatability) -> str:
    masses = ", ".join(f"{mass:.4g}" for mass in found.masses)
    low, high = found.ci95
    return (
        f"the loaded runs by themselves weigh {masses} kg: repeatability {found.std:.2g} kg "
        f"(95 %: {low:.2g} to {high:.2g})"
    )


def _on_gain(found: Estimate) -> str:
    if found.estimate is None or found.std is None:
        return "the payload that is known does not tell the gain of the torques: its mass is not told from zero"
    low, high = found.ci95 or (None, None)
    return (
        f"by the payload that is known the torques have to be multiplied by {found.estimate:.5g} "
        f"(95 %: {low:.5g} to {high:.5g}), and with them k1 … k7, friction and masses: "
        "set torque_constant or gear_ratio of [tau1] and [tau2]"
    )


def _suspicions(notices: Sequence[tuple[str, Notice]]) -> list[Cause]:
    """What the named checks saw that spoils estimates, each code once."""
    seen = {notice.code: notice for _, notice in reversed(notices) if notice.code in SUSPICIOUS}
    return [
        Cause(cause=seen[code].text.removeprefix(f"{code}: "), flags=list(seen[code].flags))
        for code in SUSPICIOUS
        if code in seen
    ]


def _is_contradicted(log: LogSource, survey: Survey) -> bool:
    accepted = log.origin.reading.accepted
    return any(one.code in CONTRADICTED and one.code not in accepted for one in survey.seen(log).notices)


def _truth(logs: Sequence[LogSource]) -> tuple[Truth | None, float | None]:
    """The truth behind the first log, and the payload of the first loaded one in kg."""
    first = logs[0].origin.truth
    loaded = [log.origin.truth for log in logs if log.role == "loaded"]
    return first, loaded[0].payload if loaded and loaded[0] is not None else None


def _notices(notices: Sequence[tuple[str, Notice]]) -> list[str]:
    """What was noticed in the logs, by their names: each loss, and of the rest the first of each kind."""
    notices = [(PurePath(path).name, notice) for path, notice in notices]  # the paths stand among the logs
    losses = [f"{name}: {notice.text}" for name, notice in notices if notice.lossy]
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, notice in notices:
        if not notice.lossy:
            alike.setdefault(notice.code, []).append((name, notice.text))
    return [*losses, *(_one_for_all(found) for found in alike.values())]


def _one_for_all(found: Sequence[tuple[str, str]]) -> str:
    (name, text), *others = found
    names = list(dict.fromkeys(other for other, _ in others if other != name))
    if not names:
        return f"{name}: {text}" + (f" (and {len(others)} more of the kind)" if others else "")
    more = ", …" if len(names) > NAMED else ""
    return (
        f"{name}: {text}; likewise in {len(names)} other log{'s' * (len(names) > 1)} ({', '.join(names[:NAMED])}{more})"
    )


def _contradictions(logs: Sequence[LogSource]) -> list[str]:
    """Synthetic logs that say they come from different arms."""
    first = logs[0].origin.truth
    strangers = [log.name for log in logs if first and log.origin.truth and log.origin.truth.arm != first.arm]
    return [f"{name}: its metadata name another arm than {logs[0].name}" for name in strangers]
