"""A track read back from its folder, so that its pages can be made again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from algid.base.errors import ResultError
from algid.base.files import first_misfit, read_text
from algid.base.significance import NORMAL
from algid.notices import Notice
from algid.report.series import Block, blocks
from algid.results import LogSummary
from algid.tracks.payload import Stretch, Track
from algid.tracks.result import TrackResult

FILE, CURVE = "track.json", "track.parquet"
COLUMNS = ("t", "m_p", "high", "stretch", "left")


def is_track(folder: Path) -> bool:
    """Whether a folder is a track's, and not a result's."""
    return (folder / FILE).is_file()


def read_track(folder: Path) -> TrackResult:
    """The track in `folder`.

    Raises
    ------
    ResultError
        If its files are missing, damaged, or of a version that did not keep all that its pages
        show.
    """
    path = folder / FILE
    again = "run algid track again with this version"
    try:
        content = json.loads(read_text(path))
        file = _File.model_validate(content)
    except OSError as error:
        raise ResultError(f"{path}: cannot read it ({error.strerror})") from error
    except ValidationError as error:
        raise ResultError(f"{path}: {first_misfit(error)}; {again}") from error
    except (ValueError, RecursionError) as error:
        reason = str(error).partition("\n")[0]
        raise ResultError(
            f"{path}: not JSON ({reason}); expected a track of algid track"
        ) from error
    curve = list(blocks(folder / CURVE, COLUMNS, finite=COLUMNS))
    if not curve:
        raise ResultError(f"{folder / CURVE}: it holds no rows; {again}")
    columns = {}
    for name in COLUMNS:
        columns[name] = np.concatenate([part[name] for part in curve])
    wrong = _misfit_of_curve(columns, len(file.stretches))
    if wrong is not None:
        raise ResultError(f"{folder / CURVE}: {wrong}; {again}")
    return _result(file, columns)


def _misfit_of_curve(curve: Block, stretches: int) -> str | None:
    """What no track's curve of so many stretches has; None where nothing is wrong."""
    if np.any(np.diff(curve["t"]) < 0):
        return "t: expected times that do not fall"
    if np.any(curve["high"] < curve["m_p"]):
        return "high: expected the upper end of m_p's interval, which is not below m_p"
    if not np.all(np.isin(curve["stretch"], np.arange(stretches))):
        return f"stretch: expected the number of a stretch, from 0 to {stretches - 1}"
    return None


class _Stretch(BaseModel):
    start: float
    end: float
    m_p: float
    std: Annotated[float, Field(ge=0)]


class _Change(BaseModel):
    t: float
    before: float = Field(alias="from")
    to: float


class _Arm(BaseModel):
    path: str
    sha256: str


class _File(BaseModel):
    """What is read of ``track.json``; it holds more, which follows from this."""

    version: str
    stretches: Annotated[list[_Stretch], Field(min_length=1)]
    changes: list[_Change]
    explained: float
    excess: Annotated[float, Field(ge=0)]
    bare: float
    holes: list[tuple[float, float]]
    schedule: list[tuple[float, float]] | None
    arm: _Arm
    settings: dict[str, Any]
    log: LogSummary
    data_lost: bool
    notices: list[Notice]


def _result(file: _File, curve: Block) -> TrackResult:
    changes, stretches = [], []
    for change in file.changes:
        changes.append((change.t, change.before, change.to))
    for one in file.stretches:
        stretches.append(Stretch(one.start, one.end, one.m_p, one.std))
    schedule = None
    if file.schedule is not None:
        schedule = tuple(file.schedule)
    return TrackResult(
        track=Track(
            stretches=stretches,
            t=curve["t"],
            m_p=curve["m_p"],
            std=(curve["high"] - curve["m_p"]) / NORMAL,
            stretch=curve["stretch"],
            left=curve["left"],
            changes=np.array(changes, dtype=np.float64).reshape(-1, 3),
            colour=file.excess,
            explained=file.explained,
            holes=np.array(file.holes, dtype=np.float64).reshape(-1, 2),
            tip_equivalent=file.bare,
        ),
        log=file.log,
        arm=file.arm.path,
        arm_sha256=file.arm.sha256,
        settings=file.settings,
        version=file.version,
        schedule=schedule,
        notices=tuple(file.notices),
        data_lost=file.data_lost,
    )
