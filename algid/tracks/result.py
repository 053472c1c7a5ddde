"""A track: findings by stretch, and its files but for the pages."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from algid.arm import FloatArray
from algid.base.criteria import UNDETERMINED
from algid.base.errors import ResultError
from algid.base.files import first_misfit, read_whole, whole_file
from algid.base.significance import NORMAL, SURE
from algid.notices import Notice
from algid.report.export import START_KEY
from algid.report.series import table
from algid.results import LogSummary

FILE, CURVE = "track.json", "track.parquet"
COLUMNS = ("t", "m_p", "high", "stretch", "left")
"""Of the curve, those from which its pages are made again."""

SCHEMA_VERSION = 2


class StretchStatus(StrEnum):
    """How far the mass of a stretch can be trusted."""

    OK = "OK"
    WEAK_EXCITATION = "WEAK_EXCITATION"
    NEGATIVE_MASS = "NEGATIVE_MASS"


@dataclass(frozen=True)
class Stretch:
    """A time in s during which the payload was m_p kg, with its standard deviation."""

    start: float
    end: float
    m_p: float
    std: float

    @property
    def ci95(self) -> tuple[float, float]:
        """The 95 % interval, kg."""
        return self.m_p - NORMAL * self.std, self.m_p + NORMAL * self.std


@dataclass(frozen=True, eq=False)
class Track:
    """Stretches; m_p(t), its standard deviation and its stretch at each instant, each (C,).

    Times at which the payload may be changing have no m_p(t).
    `left` (C,) is the RMS of what arm and payload leave of the torque, over the sensors' noise.
    `changes` (n, 3) are each change's time in s, and the times between which it surely lies.
    `colour` is the rows' variance over that of sensor noise, slow errors included: above one, the
    arm's model lacks something. `explained` is the share of the torque's power, noise aside, that
    arm and payload explain. `holes` (h, 2) are the times from and to which the log has no samples.
    `tip_equivalent` is the mass in kg that at the tip would weigh on joint 2 as link 2 does.
    """

    stretches: list[Stretch]
    t: FloatArray
    m_p: FloatArray
    std: FloatArray
    stretch: FloatArray
    left: FloatArray
    changes: FloatArray
    colour: float
    explained: float
    holes: FloatArray
    tip_equivalent: float


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
        found = []
        for one in self.track.stretches:
            if not one.std < UNDETERMINED * max(abs(one.m_p), self.track.tip_equivalent):
                found.append(StretchStatus.WEAK_EXCITATION)
            elif one.m_p + SURE * one.std < 0:
                found.append(StretchStatus.NEGATIVE_MASS)
            else:
                found.append(StretchStatus.OK)
        return found

    @property
    def rows(self) -> list[tuple[Stretch, StretchStatus, float | None]]:
        """Each stretch with its status and, where it is known, the true payload in kg."""
        truth = self.truth or (None,) * len(self.track.stretches)
        return list(zip(self.track.stretches, self.statuses, truth, strict=True))

    @property
    def complete(self) -> bool:
        """True if every stretch has status OK."""
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


def track_json(result: TrackResult) -> str:
    """The text of `track.json`: times in s since the log's first sample, masses in kg."""
    track, stretches = result.track, []
    for one, status, mass in result.rows:
        more = {"ci95": list(one.ci95), "unit": "kg", "status": status.value, "truth": mass}
        stretches.append(asdict(one) | more)
    changes = [dict(zip(("t", "from", "to"), row, strict=True)) for row in track.changes.tolist()]
    content = {
        "schema_version": SCHEMA_VERSION,
        "version": result.version,
        "stretches": stretches,
        "changes": changes,
        "explained": track.explained,
        "excess": track.colour,
        "bare": track.tip_equivalent,
        "holes": track.holes.tolist(),
        "schedule": result.schedule,
        "arm": {"path": result.arm, "sha256": result.arm_sha256},
        "settings": dict(result.settings),
        "log": result.log.model_dump(mode="json"),
        "data_lost": result.data_lost,
        "notices": list(map(asdict, result.notices)),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


class _Arm(BaseModel):
    path: str
    sha256: str


class _File(BaseModel):
    """What is read of ``track.json``; it holds more, which follows from this."""

    version: str
    stretches: list[Stretch] = Field(min_length=1)
    changes: list[dict[str, float]]
    explained: float
    excess: float
    bare: float
    holes: list[tuple[float, float]]
    schedule: tuple[tuple[float, float], ...] | None
    arm: _Arm
    settings: dict[str, Any]
    log: LogSummary
    data_lost: bool
    notices: tuple[Notice, ...]


def is_track(folder: Path) -> bool:
    """True if a folder is a track's, and not a result's."""
    return (folder / FILE).is_file()


def read_track(folder: Path) -> TrackResult:
    """The track in `folder`, so that its pages can be made again.

    Raises
    ------
    ResultError
        If its files are missing, damaged, or of another version.
    """
    path = folder / FILE
    again = "run algid track again with this version"
    try:
        file = _File.model_validate_json(read_whole(path))
    except OSError as error:
        raise ResultError(f"{path}: cannot read it ({error.strerror})") from error
    except ValidationError as error:
        raise ResultError(f"{path}: {first_misfit(error)}; {again}") from error
    try:
        curve = table(folder / CURVE)
        t, m_p, high, stretch, left = (curve[name].astype(np.float64) for name in COLUMNS)
    except (KeyError, ValueError, TypeError) as error:
        lacking = f"expected numbers in the columns {', '.join(COLUMNS)} ({error})"
        raise ResultError(f"{folder / CURVE}: {lacking}; {again}") from error
    if not t.size or not np.all(high >= m_p):
        raise ResultError(f"{folder / CURVE}: it holds no rows, or rows without interval; {again}")
    return TrackResult(
        track=Track(
            stretches=file.stretches,
            t=t,
            m_p=m_p,
            std=(high - m_p) / NORMAL,
            stretch=stretch,
            left=left,
            changes=np.array([list(one.values()) for one in file.changes]).reshape(-1, 3),
            colour=file.excess,
            explained=file.explained,
            holes=np.array(file.holes).reshape(-1, 2),
            tip_equivalent=file.bare,
        ),
        log=file.log,
        arm=file.arm.path,
        arm_sha256=file.arm.sha256,
        settings=file.settings,
        version=file.version,
        schedule=file.schedule,
        notices=file.notices,
        data_lost=file.data_lost,
    )


def write_tables(result: TrackResult, folder: Path) -> None:
    """Write the curve, a row each 20 ms, and the stretches. Raises `OutputError`."""
    import polars as pl
    import pyarrow.parquet as pq

    track = result.track
    stretches = pl.DataFrame(
        [
            (one.start, one.end, one.m_p, one.std, *one.ci95, status.value)
            for one, status, _ in result.rows
        ],
        schema=["start", "end", "m_p", "m_p_std", "low", "high", "status"],
        orient="row",
    )
    number = track.stretch.astype(np.int64)
    own = stretches[number]
    curve = pl.DataFrame(
        {
            "t": track.t,
            "m_p": track.m_p,
            "low": track.m_p - NORMAL * track.std,
            "high": track.m_p + NORMAL * track.std,
            "left": track.left,
            "stretch": number,
            "stretch_m_p": own["m_p"],
            "stretch_low": own["low"],
            "stretch_high": own["high"],
        }
    )
    stamped = curve.to_arrow().replace_schema_metadata({START_KEY: f"[{result.log.start_ns}]"})
    with whole_file(folder / CURVE) as temporary:
        pq.write_table(stamped, temporary)
    with whole_file(folder / "stretches.parquet") as temporary:
        stretches.write_parquet(temporary)
