"""A track read back from its folder, so that its pages can be made again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from algid.errors import ResultError
from algid.report.reduce import Block, blocks
from algid.results import LogSummary
from algid.track.payload import QUANTILE, Stretch, Track
from algid.track.result import TrackResult

FILE = "track.json"
COLUMNS = ("t", "m_p", "high", "stretch", "left")


def is_track(folder: Path) -> bool:
    """Whether a folder is a track's, and not a result's."""
    return (folder / FILE).is_file()


def read_track(folder: Path) -> TrackResult:
    """The track in `folder`.

    Raises
    ------
    ResultError
        If its files are missing, damaged, or of a version that did not keep all that its pages show.
    """
    path = folder / FILE
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        curve = list(blocks(folder / "track.parquet", COLUMNS))
        return _result(found, {name: np.concatenate([part[name] for part in curve]) for name in COLUMNS if curve})
    except OSError as error:
        raise ResultError(f"{path}: cannot read it ({error.strerror})") from error
    except KeyError as error:
        raise ResultError(f"{path}: expected {error}, found none; run algid track again with this version") from error
    except (ValueError, TypeError, ValidationError, AttributeError) as error:
        reason = str(error).partition("\n")[0]
        raise ResultError(f"{path}: expected a track of algid track, found another thing ({reason})") from error


def _result(found: dict[str, Any], curve: Block) -> TrackResult:
    stretches = [Stretch(*(float(one[name]) for name in ("start", "end", "m_p", "std"))) for one in found["stretches"]]
    changes = [(one["t"], one["from"], one["to"]) for one in found["changes"]]
    schedule = found["schedule"]
    return TrackResult(
        track=Track(
            stretches=stretches,
            t=curve["t"],
            m_p=curve["m_p"],
            std=(curve["high"] - curve["m_p"]) / QUANTILE,
            stretch=curve["stretch"],
            left=curve["left"],
            changes=np.array(changes, dtype=np.float64).reshape(-1, 3),
            colour=float(found["excess"]),
            explained=float(found["explained"]),
            holes=np.array(found["holes"], dtype=np.float64).reshape(-1, 2),
            tip_equivalent=float(found["bare"]),
        ),
        log=LogSummary.model_validate(found["log"]),
        arm=found["arm"]["path"],
        arm_sha256=found["arm"]["sha256"],
        arm_sentence=found["arm"]["sentence"],
        settings=found["settings"],
        version=found["version"],
        schedule=None if schedule is None else tuple((float(time), float(mass)) for time, mass in schedule),
        warnings=tuple(found["warnings"]),
        data_lost=bool(found["data_lost"]),
    )
