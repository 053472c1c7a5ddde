"""Advice of a fit, tried before it is given: the logs are identified by it once more.

A remedy stays where the result is physical, explains the torque, and asks for no other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from algid.identification.outcome import Identified, is_implausible
from algid.identification.source import LogSource
from algid.identification.survey import Survey
from algid.log import Log
from algid.notices import Notice, Remedy, has_code, warnings_of
from algid.results.verdict import CAUSES
from algid.settings import Settings
from algid.units import TORQUE

TRIED = {"HEAVY_ARM": ("HEAVY_ARM", "LOGS_APART"), "EXTERNAL_EFFORT": ("EXTERNAL_EFFORT",)}
"""Notices whose remedies are assertions and not the result's own settings; with the notices that
refute each, beside the causes of error.
"""
AIR = 1.2  # kg/m³

Again = Callable[[Survey, Settings], Identified | None]
"""Identifies logs; None where they cannot be."""


def advised(
    notices: Sequence[Notice], survey: Survey, settings: Settings, again: Again
) -> list[Notice]:
    """The notices of a result, those of `TRIED` with the remedies that end in one that stands.

    Parameters
    ----------
    notices : of the result, with remedies yet to be tried
    survey : of its logs
    settings : that they were identified by
    again : identifies logs by other settings
    """
    tried = []
    for one in notices:
        if one.code in TRIED:
            one = replace(one, remedies=tuple(_standing(one, survey, settings, again)))
        tried.append(one)
    return tried


def _standing(notice: Notice, survey: Survey, settings: Settings, again: Again) -> Iterator[Remedy]:
    """The remedies of a notice by which its logs give a result that stands."""
    for remedy in notice.remedies:
        changed: dict[str, Any] = dict(remedy.settings)
        unit = changed.pop("torque_unit", None)
        logs = [replace(log, effort=changed.get("effort", log.effort)) for log in survey.logs]
        if unit is not None:
            ratio = _ratio(survey.logs, unit)
            if ratio is None or _is_air(notice, ratio):
                continue
            logs = [_in_unit(log, ratio) for log in logs]
        outcome = again(Survey(logs), replace(settings, **changed))
        if outcome is not None and _stands(outcome, TRIED[notice.code]):
            yield remedy


def _stands(outcome: Identified, contradictions: tuple[str, ...]) -> bool:
    """Whether a result is physical, explains the torque, and names no cause of error."""
    summary = outcome.fit
    if summary is None or not summary.converged or is_implausible(summary):
        return False
    wrong = CAUSES + contradictions
    return not has_code(warnings_of(outcome.notices), *wrong)


def _ratio(logs: Sequence[LogSource], unit: str) -> float | None:
    """What torques that are read in `unit` are of those that were read; None where it differs.

    A current, a PD law and an offset in N m do not follow the unit of a torque.
    """
    units = set()
    for log in logs:
        reading = log.origin.reading
        for joint in (1, 2):
            channel = reading.channels.get(f"tau{joint}")
            if joint == reading.passive:
                continue
            if channel is None:
                units.add("N m")
            elif channel.offset:
                return None
            else:
                units.add(channel.unit)
    if len(units) != 1:
        return None
    own = TORQUE.get(units.pop())
    if own is None:
        return None
    return TORQUE[unit] / own


def _is_air(notice: Notice, ratio: float) -> bool:
    """Whether the arm would be lighter than the air of a cube of its link."""
    mass, length = notice.numbers["mass"], notice.numbers["length"]
    return bool(ratio * mass < AIR * length**3)


def _in_unit(log: LogSource, ratio: float) -> LogSource:
    """The log with its torques times `ratio`."""

    def blocks() -> Iterator[Log]:
        for block in log.blocks():
            yield replace(block, tau=ratio * block.tau)

    return replace(log, blocks=blocks, digest=None)
