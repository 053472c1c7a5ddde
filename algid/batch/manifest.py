"""Manifests: a CSV or TOML file with a row, or a table ``[[job]]``, for each job.

``name`` and ``logs`` are needed where there is no ``loaded``; ``profile``, ``robot`` and ``time`` are optional,
and whatever else stands there is a label. Several logs are a TOML list, or separated by semicolons in CSV. Paths
are relative to the manifest.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path

from algid.batch.jobs import Job, checked_name, label_of
from algid.errors import SettingError

_OWN = ("name", "logs", "loaded", "profile", "robot", "time")


def is_manifest(path: Path) -> bool:
    """Whether a source is a manifest: TOML, or CSV with columns name and logs or loaded."""
    if path.suffix.lower() == ".toml":
        return True
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.readline(1 << 16).decode("utf-8-sig", "replace")
    columns = next(csv.reader([head.strip()]), [])
    return "name" in columns and ("logs" in columns or "loaded" in columns)


def read_manifest(path: Path) -> list[Job]:
    """The jobs of a manifest, in its order.

    Raises
    ------
    SettingError
        If it cannot be read or a row is wrong.
    """
    try:
        rows = _toml_rows(path) if path.suffix.lower() == ".toml" else _csv_rows(path)
    except (OSError, UnicodeDecodeError, csv.Error, tomllib.TOMLDecodeError) as error:
        raise SettingError(f"{path}: the manifest cannot be read ({error}); mend it") from error
    return [_job(row, f"{path}: {place}", path.parent) for place, row in rows]


def _toml_rows(path: Path) -> list[tuple[str, Mapping[str, object]]]:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    tables = content.get("job")
    if not isinstance(tables, list) or set(content) != {"job"}:
        raise SettingError(f"{path}: expected tables [[job]] alone, found {', '.join(content) or 'nothing'}")
    return [(f"job {number}", table) for number, table in enumerate(tables, 1)]


def _csv_rows(path: Path) -> Iterable[tuple[str, Mapping[str, object]]]:
    with path.open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.DictReader(stream))
    if any(None in row for row in rows):
        raise SettingError(f"{path}: a row has more cells than the header; quote commas within a cell")
    return [(f"row {number}", {k: v for k, v in row.items() if v}) for number, row in enumerate(rows, 1)]


def _job(row: Mapping[str, object], place: str, folder: Path) -> Job:
    logs, loaded = _paths(row, "logs", place, folder), _paths(row, "loaded", place, folder)
    if "name" not in row or not (logs or loaded):
        raise SettingError(f"{place}: expected a name and logs, found {', '.join(row) or 'nothing'}")
    profile = _paths(row, "profile", place, folder)
    return Job(
        name=checked_name(str(row["name"]), place),
        logs=logs,
        loaded=loaded,
        profile=profile[0] if profile else None,
        robot=None if row.get("robot") is None else str(row["robot"]),
        time=_time(row.get("time"), place),
        labels={name: label_of(value) for name, value in row.items() if name not in _OWN},
    )


def _paths(row: Mapping[str, object], name: str, place: str, folder: Path) -> tuple[str, ...]:
    found = row.get(name)
    if found is None:
        return ()
    parts = found.split(";") if isinstance(found, str) else found
    if not isinstance(parts, list) or not all(isinstance(part, str) and part.strip() for part in parts):
        raise SettingError(f"{place}: {name}: expected paths, found {found!r:.60}")
    return tuple(part.strip() if "://" in part else str(folder / part.strip()) for part in parts)


def _time(value: object, place: str) -> str | None:
    if value is None:
        return None
    try:
        return datetime.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise SettingError(f"{place}: time: expected ISO 8601 like 2026-01-31T12:00:00Z, found {value!r}") from error
