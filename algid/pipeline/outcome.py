"""What an estimator found, and the result made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from algid import __version__
from algid.log import Truth
from algid.pipeline.settings import Settings
from algid.pipeline.sources import LogSource
from algid.pipeline.table4 import paper_errors, table4, true_parameters, true_rows
from algid.results import Estimate, Fit, Result

NAMED = 3  # logs that a warning names beside the first


@dataclass(frozen=True, eq=False)
class Outcome:
    """Estimates by name, Table 4's rows with their standard deviations, and what else the estimator knows."""

    parameters: dict[str, Estimate]
    loaded: dict[str, Estimate]
    payload: dict[str, Estimate]
    rows: Mapping[str, float]
    estimator: str | None = None
    """Whose estimates these are, where not those of the estimator asked for."""
    stds: Mapping[str, float] = field(default_factory=dict)
    paper_payload: dict[str, Estimate] = field(default_factory=dict)
    fit: Fit | None = None
    warnings: list[str] = field(default_factory=list)


def result_of(outcome: Outcome, settings: Settings, logs: Sequence[LogSource]) -> Result:
    """The result of `outcome` on `logs`, the first log first."""
    truth, payload = _truth(logs)
    first, *others = [log.summary() for log in logs]
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
        data_lost=any(notice.lossy for log in logs for notice in log.notices),
        warnings=[*_notices(logs), *_contradictions(logs), *outcome.warnings],
    )


def _truth(logs: Sequence[LogSource]) -> tuple[Truth | None, float | None]:
    """The truth behind the first log, and the payload of the first loaded one in kg."""
    first = logs[0].origin.truth
    loaded = [log.origin.truth for log in logs if log.role == "loaded"]
    return first, loaded[0].payload if loaded and loaded[0] is not None else None


def _notices(logs: Sequence[LogSource]) -> list[str]:
    """What was noticed in the logs: each loss, and of the rest the first of each kind."""
    told = [f"{log.name}: {notice.text}" for log in logs for notice in log.notices if notice.lossy]
    alike: dict[str, list[tuple[str, str]]] = {}
    for log in logs:
        for notice in log.notices:
            if not notice.lossy:
                alike.setdefault(notice.code, []).append((log.name, notice.text))
    return [*told, *(_one_for_all(found) for found in alike.values())]


def _one_for_all(found: Sequence[tuple[str, str]]) -> str:
    (name, text), *others = found
    names = list(dict.fromkeys(PurePath(other).name for other, _ in others if other != name))
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
