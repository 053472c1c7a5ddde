"""A track's findings by stretch: the one source of its table, pages and `track.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from algid.base.criteria import UNDETERMINED
from algid.base.significance import SURE
from algid.notices import Notice
from algid.results import LogSummary
from algid.tracks.payload import Stretch, Track

SCHEMA_VERSION = 2


class StretchStatus(StrEnum):
    """How far the mass of a stretch can be trusted."""

    OK = "OK"
    WEAK_EXCITATION = "WEAK_EXCITATION"
    NEGATIVE_MASS = "NEGATIVE_MASS"


@dataclass(frozen=True, eq=False)
class TrackResult:
    """A track, and what it came from.

    `arm` names the result of the arm and `arm_sha256` its file. `start_ns` is the log's first
    stamp. `schedule` is the truth of a synthetic log: times in s and kg.
    """

    track: Track
    log: LogSummary
    arm: str
    arm_sha256: str
    settings: Mapping[str, Any]
    version: str
    schedule: tuple[tuple[float, float], ...] | None = None
    notices: tuple[Notice, ...] = ()
    data_lost: bool = False

    def __repr__(self) -> str:
        masses = ", ".join(f"{one.m_p:.4g} ± {one.std:.2g}" for one in self.track.stretches)
        return f"TrackResult({self.log.path!r}, by stretch {masses} kg)"

    @property
    def statuses(self) -> list[StretchStatus]:
        """Of each stretch."""
        return [_status(stretch, self.track.tip_equivalent) for stretch in self.track.stretches]

    @property
    def complete(self) -> bool:
        """Whether every stretch has status OK."""
        return set(self.statuses) <= {StretchStatus.OK}

    @property
    def truth(self) -> tuple[float, ...]:
        """True payload in kg at the middle of each stretch; empty where the log lacks it."""
        if self.schedule is None:
            return ()
        masses = []
        for stretch in self.track.stretches:
            middle = (stretch.start + stretch.end) / 2
            reached = [mass for time, mass in self.schedule if time <= middle]
            masses.append(reached[-1] if reached else 0.0)
        return tuple(masses)


def _status(stretch: Stretch, tip_equivalent: float) -> StretchStatus:
    if not stretch.std < UNDETERMINED * max(abs(stretch.m_p), tip_equivalent):
        return StretchStatus.WEAK_EXCITATION
    if stretch.m_p + SURE * stretch.std < 0:
        return StretchStatus.NEGATIVE_MASS
    return StretchStatus.OK


def track_json(result: TrackResult) -> str:
    """The text of `track.json`: times in s since the log's first sample, masses in kg."""
    stretches: list[dict[str, Any]] = []
    every = result.track.stretches
    truth = result.truth or (None,) * len(every)
    for stretch, status, mass in zip(every, result.statuses, truth, strict=True):
        stretches.append(
            {
                "start": stretch.start,
                "end": stretch.end,
                "m_p": stretch.m_p,
                "std": stretch.std,
                "ci95": list(stretch.ci95),
                "unit": "kg",
                "status": status.value,
                "truth": mass,
            }
        )
    changes: list[dict[str, float]] = []
    for time, before, after in result.track.changes.tolist():
        changes.append({"t": time, "from": before, "to": after})
    content = {
        "schema_version": SCHEMA_VERSION,
        "version": result.version,
        "stretches": stretches,
        "changes": changes,
        "explained": result.track.explained,
        "excess": result.track.colour,
        "bare": result.track.tip_equivalent,
        "holes": result.track.holes.tolist(),
        "schedule": result.schedule,
        "arm": {"path": result.arm, "sha256": result.arm_sha256},
        "settings": dict(result.settings),
        "log": result.log.model_dump(mode="json"),
        "data_lost": result.data_lost,
        "notices": list(map(asdict, result.notices)),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
