"""Manifests: a CSV or TOML file with a row, or a table ``[[job]]``, for each job.

``name`` and ``logs`` are needed where there is no ``loaded``; ``profile``, ``robot`` and ``time``
are optional, and whatever else stands there is a label. Several logs are a TOML list, or separated
by semicolons in CSV. Paths are relative to the manifest.
"""

from __future__ import annotations

import csv
import io
import math
from contextlib import suppress
from datetime import date
from datetime import time as clock
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from algid.base.errors import SettingError
from algid.base.files import first_misfit, read_start, read_text, toml_content
from algid.base.limits import LIMITS
from algid.base.text import repeated, visible
from algid.batches.jobs import Job, Label, Time, fit_name


def is_manifest(path: Path) -> bool:
    """Whether a source is a manifest: TOML, or CSV with columns name and logs or loaded."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        return path.suffix.lower() == ".toml"
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
    kind, more = "row", dict[str, Any]()
    if path.suffix.lower() == ".toml":
        kind, more = "job", toml_content(path)
        rows = more.pop("job", None)
        if more or not isinstance(rows, list):
            keys = visible(", ".join(more), 200)
            raise SettingError(f"{path}: expected tables [[job]] alone, found {keys or 'none'}")
    else:
        try:
            rows = _cells(path)
        except (OSError, csv.Error, ValueError) as error:
            raise SettingError(
                f"{path}: the manifest cannot be read ({error!s:.200}); mend it"
            ) from error
    named = {f"{kind} {n}": row for n, row in enumerate(rows, start=1)}
    try:
        jobs = _ROWS.validate_python(named, context=path.parent)
    except ValidationError as error:
        raise SettingError(f"{path}: {visible(first_misfit(error), 300)}") from error
    return [
        Job(
            *(row.name, tuple(row.logs), tuple(row.loaded), row.profile, row.robot, row.time),
            row.__pydantic_extra__,
        )
        for row in jobs.values()
    ]


def _cells(path: Path) -> list[dict[str, Any]]:
    """The cells of each row by column, but those that are empty."""
    text = io.StringIO(read_text(path, "utf-8-sig"))
    reader = csv.DictReader(text, restkey="cells beyond the header")
    twice = repeated(filter(None, reader.fieldnames or ()))
    if twice:
        raise ValueError(f"two columns are named {twice[0]!r:.60}")
    return [{name: cell for name, cell in row.items() if cell} for row in reader]


def label_of(value: object) -> Label:
    """A manifest's value: a number where it reads like a finite one, text otherwise.

    Raises
    ------
    ValueError
        If it is neither text, a date, a truth value nor a number that a column can hold.
    """
    if isinstance(value, str | date | clock):
        with suppress(ValueError):
            if math.isfinite(number := float(str(value))):
                return number
        return str(value)
    if isinstance(value, int | float) and abs(value) < 2**63:
        return value
    raise ValueError("expected text, a date, true, false or a number below 2^63")


def _placed(path: str, manifest: ValidationInfo) -> str:
    """A path of a manifest as seen from its folder."""
    path = path.strip()
    return path if "://" in path else str((manifest.context or Path()) / path)


_Path = Annotated[
    str,
    Field(strict=True, pattern=r"^[^\x00]*[^\x00\s][^\x00]*$"),
    AfterValidator(_placed),
]
_Paths = Annotated[
    list[_Path], BeforeValidator(lambda cell: cell.split(";") if isinstance(cell, str) else cell)
]


class _Row(BaseModel, extra="allow", coerce_numbers_to_str=True):
    """A job as a manifest states it; what stands beside its fields is a label."""

    __pydantic_extra__: dict[str, Annotated[Any, BeforeValidator(label_of)]] = Field(init=False)
    name: Annotated[str, AfterValidator(fit_name)]
    logs: _Paths = []
    loaded: _Paths = []
    profile: _Path | None = None
    robot: str | None = None
    time: Time | None = None

    @model_validator(mode="after")
    def _has_logs(self) -> _Row:
        if not (self.logs or self.loaded):
            raise ValueError("expected logs, or loaded ones")
        return self


_ROWS = TypeAdapter(dict[str, _Row])
