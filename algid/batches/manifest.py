"""Manifests: a CSV or TOML file with a row, or a table ``[[job]]``, for each job.

``name`` and ``logs`` are needed where there is no ``loaded``; ``profile``, ``robot`` and ``time``
are optional, and whatever else stands there is a label. Several logs are a TOML list, or separated
by semicolons in CSV. Paths are relative to the manifest.
"""

from __future__ import annotations

import csv
import io
import math
import reprlib
from collections.abc import Mapping
from datetime import date, datetime
from datetime import time as clock
from pathlib import Path

from algid.base.errors import SettingError
from algid.base.files import parsed_toml, read_start, read_text
from algid.base.limits import LIMITS
from algid.base.text import visible
from algid.base.words import repeated
from algid.batches.jobs import Job, Label, checked_name, utc_of


def is_manifest(path: Path) -> bool:
    """Whether a source is a manifest: TOML, or CSV with columns name and logs or loaded."""
    if path.suffix.lower() == ".toml":
        return True
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    # logs too come by here
    head = read_start(path, LIMITS.line_bytes).decode("utf-8-sig", errors="replace")
    columns = next(csv.reader(head.splitlines()[:1]), [])
    return "name" in columns and ("logs" in columns or "loaded" in columns)


def read_manifest(path: Path) -> list[Job]:
    """The jobs of a manifest, in its order.

    Raises
    ------
    SettingError
        If it cannot be read or a row is wrong.
    """
    try:
        if path.suffix.lower() == ".toml":
            kind, rows = "job", _tables(path)
        else:
            kind, rows = "row", _rows(path)
    except (OSError, csv.Error, ValueError, RecursionError) as error:
        raise SettingError(
            f"{path}: the manifest cannot be read ({error!s:.200}); mend it"
        ) from error
    labels = {name for row in rows for name in row}
    if len(labels) > LIMITS.columns:
        raise SettingError(
            f"{path}: expected labels of at most {LIMITS.columns} names, found {len(labels)}"
        )
    jobs = []
    for number, row in enumerate(rows, start=1):
        jobs.append(_job(row, f"{path}: {kind} {number}", path.parent))
    return jobs


def _tables(path: Path) -> list[dict[str, object]]:
    content = parsed_toml(read_text(path))
    rows = content.get("job")
    if (
        set(content) != {"job"}
        or not isinstance(rows, list)
        or not all(isinstance(row, dict) for row in rows)
    ):
        keys = ", ".join(content) or "nothing"
        raise SettingError(f"{path}: expected tables [[job]] alone, found {visible(keys, 200)}")
    return rows


def _rows(path: Path) -> list[dict[str, object]]:
    reader = csv.DictReader(io.StringIO(read_text(path, "utf-8-sig")))
    header = reader.fieldnames or ()
    twice = repeated(filter(None, header))
    if twice:
        raise SettingError(f"{path}: two columns are named {twice[0]!r:.60}; rename one")
    cells = list(reader)
    if any(None in row for row in cells):
        raise SettingError(
            f"{path}: a row has more cells than the header; quote commas within a cell"
        )
    return [{name: cell for name, cell in row.items() if cell} for row in cells]


def _job(row: Mapping[str, object], place: str, folder: Path) -> Job:
    logs, loaded = _paths(row, "logs", place, folder), _paths(row, "loaded", place, folder)
    if "name" not in row or not (logs or loaded):
        columns = ", ".join(row) or "nothing"
        raise SettingError(f"{place}: expected a name and logs, found {visible(columns, 200)}")
    profile = _paths(row, "profile", place, folder)
    labels = {}
    for name in row:
        if name not in ("logs", "loaded", "profile"):
            label = _label(row, name, place)
            if name not in ("name", "robot", "time"):
                labels[name] = label
    own_name = checked_name(_text(row, "name", place), place)
    time = None
    if row.get("time") is not None:
        time = _time(str(row["time"]), place)
    robot = None
    if row.get("robot") is not None:
        robot = _text(row, "robot", place)
    return Job(
        name=own_name,
        logs=logs,
        loaded=loaded,
        profile=profile[0] if profile else None,
        robot=robot,
        time=time,
        labels=labels,
    )


def _text(row: Mapping[str, object], name: str, place: str) -> str:
    """A cell's text as it stands, or that of what it means."""
    cell = row[name]
    if isinstance(cell, str):
        return cell
    return str(_label(row, name, place))


def _time(text: str, place: str) -> str:
    try:
        utc_of(text)
        return datetime.fromisoformat(text).isoformat()
    except ValueError as error:
        expected = "expected ISO 8601 like 2026-01-31T12:00:00Z, from 1970 to 2261"
        raise SettingError(f"{place}: time: {expected}, found {text!r:.60}") from error


def _label(row: Mapping[str, object], name: str, place: str) -> Label:
    try:
        return label_of(row[name])
    except ValueError as error:
        expected = "expected text, a date, true, false or a finite number, whole ones of 64 bits"
        kind = type(row[name]).__name__
        raise SettingError(
            f"{place}: {repr(name)[1:-1]:.60}: {expected}, found another {kind}"
        ) from error


def label_of(value: object) -> Label:
    """A manifest's value: a number where it reads like a finite one, text otherwise.

    Raises
    ------
    ValueError
        If it is neither text, a date, a truth value nor a finite number, or a whole one beyond 64
        bits.
    """
    if isinstance(value, str):
        return _number_in(value)
    if isinstance(value, bool):
        return value
    if isinstance(value, date | clock):
        return str(value)
    if isinstance(value, int) and -(2**63) <= value < 2**63:
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    raise ValueError(type(value).__name__)


def _number_in(text: str) -> str | float:
    try:
        number = float(text)
    except ValueError:
        return text
    if not math.isfinite(number):
        return text
    return number


def _paths(row: Mapping[str, object], name: str, place: str, folder: Path) -> tuple[str, ...]:
    cell = row.get(name)
    if cell is None:
        return ()
    parts = cell.split(";") if isinstance(cell, str) else cell
    if not isinstance(parts, list) or not all(map(_is_path, parts)):
        raise SettingError(f"{place}: {name}: expected paths, found {reprlib.repr(cell):.60}")
    paths = []
    for part in parts:
        path = part.strip()
        if "://" not in path:
            path = str(folder / path)
        paths.append(path)
    return tuple(paths)


def _is_path(part: object) -> bool:
    return isinstance(part, str) and bool(part.strip()) and "\0" not in part
