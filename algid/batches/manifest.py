"""Manifests: a CSV or TOML file with a row, or a table ``[[job]]``, for each job.

``name`` and ``logs`` are needed where there is no ``loaded``; ``profile``, ``robot`` and ``time``
are optional, and whatever else stands there is a label. Several logs are a TOML list, or separated
by semicolons in CSV. Paths are relative to the manifest.
"""

from __future__ import annotations

import csv
import io
import math
from datetime import date, datetime
from datetime import time as clock
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from algid.base.errors import SettingError
from algid.base.files import first_misfit, parsed_toml, read_start, read_text
from algid.base.limits import LIMITS
from algid.base.text import visible
from algid.base.words import repeated
from algid.batches.jobs import Job, Label, name_fault, utc_of


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
    kind = "job" if path.suffix.lower() == ".toml" else "row"
    try:
        rows = _tables(path) if kind == "job" else _cells(path)
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
        why = f"expected a name and logs, found {', '.join(row) or 'nothing'}"
        if "name" in row and row.keys() & {"logs", "loaded"}:
            try:
                jobs.append(_Row.model_validate(row).job(path.parent))
                continue
            except ValidationError as error:
                why = first_misfit(error)
        raise SettingError(f"{path}: {kind} {number}: {visible(why, 300)}")
    return jobs


def _tables(path: Path) -> list[dict[str, Any]]:
    content = parsed_toml(read_text(path))
    rows = content.get("job")
    tables = isinstance(rows, list) and all(isinstance(row, dict) for row in rows)
    if set(content) != {"job"} or not tables:
        keys = visible(", ".join(content) or "nothing", 200)
        raise SettingError(f"{path}: expected tables [[job]] alone, found {keys}")
    return rows  # type: ignore[return-value]


def _cells(path: Path) -> list[dict[str, Any]]:
    reader = csv.DictReader(io.StringIO(read_text(path, "utf-8-sig")))
    twice = repeated(filter(None, reader.fieldnames or ()))
    if twice:
        raise SettingError(f"{path}: two columns are named {twice[0]!r:.60}; rename one")
    cells = list(reader)
    if any(None in row for row in cells):
        raise SettingError(
            f"{path}: a row has more cells than the header; quote commas within a cell"
        )
    return [{name: cell for name, cell in row.items() if cell} for row in cells]


def label_of(value: object) -> Label:
    """A manifest's value: a number where it reads like a finite one, text otherwise.

    Raises
    ------
    ValueError
        If it is neither text, a date, a truth value nor a finite number, or a whole one beyond 64
        bits.
    """
    if isinstance(value, str):
        try:
            number = float(value)
        except ValueError:
            return value
        return number if math.isfinite(number) else value
    if isinstance(value, date | clock):
        return str(value)
    whole = isinstance(value, int) and -(2**63) <= value < 2**63
    if whole or (isinstance(value, float) and math.isfinite(value)):
        return value  # type: ignore[return-value]
    expected = "text, a date, true, false or a finite number, whole ones of 64 bits"
    raise ValueError(f"expected {expected}")


def _name(name: str) -> str:
    if fault := name_fault(name):
        raise ValueError(f"a job's name becomes a folder's: {fault}")
    return name


def _paths(cell: object) -> list[str]:
    parts = cell.split(";") if isinstance(cell, str) else cell
    if not isinstance(parts, list) or not all(map(_is_path, parts)):
        raise ValueError("expected paths")
    return [part.strip() for part in parts]


def _is_path(part: object) -> bool:
    return isinstance(part, str) and bool(part.strip()) and "\0" not in part


def _time(cell: object) -> str:
    try:
        utc_of(str(cell))
        return datetime.fromisoformat(str(cell)).isoformat()
    except ValueError as error:
        expected = "expected ISO 8601 like 2026-01-31T12:00:00Z, from 1970 to 2261"
        raise ValueError(expected) from error


_Paths = Annotated[list[str], BeforeValidator(_paths)]


class _Row(BaseModel, extra="allow", coerce_numbers_to_str=True):
    """A job as a manifest states it; what stands beside its fields is a label."""

    __pydantic_extra__: dict[str, Annotated[Any, BeforeValidator(label_of)]] = Field(init=False)
    name: Annotated[str, AfterValidator(_name)]
    logs: _Paths = []
    loaded: _Paths = []
    profile: _Paths = []
    robot: str | None = None
    time: Annotated[str, BeforeValidator(_time)] | None = None

    def job(self, folder: Path) -> Job:
        """The job, its paths as seen from `folder`."""

        def placed(paths: list[str]) -> tuple[str, ...]:
            return tuple(path if "://" in path else str(folder / path) for path in paths)

        logs, loaded, profile = map(placed, (self.logs, self.loaded, self.profile))
        own = {"profile": profile[0] if profile else None, "robot": self.robot, "time": self.time}
        return Job(self.name, logs, loaded, labels=self.__pydantic_extra__, **own)
