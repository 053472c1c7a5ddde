"""What an identification found: the one source of every table, file and page that shows it.

A `Result` is written as `result.json` (schema version 1) and read back; JSON Schema comes from the models.
Numbers that do not exist (NaN) are null; an unbounded interval is ``[null, null]``. Nothing in a result depends
on when it was made, so that the same log and settings give the same bytes.
"""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from algid.errors import ResultError
from algid.files import first_misfit, whole_file

SCHEMA_VERSION: Literal[1] = 1


class Status(StrEnum):
    """How far an estimate can be trusted.

    IMPLAUSIBLE: the estimates together break a bound of physics by more than three standard deviations, or predict
    the torque worse than a constant does.
    """

    OK = "OK"
    WEAK_EXCITATION = "WEAK_EXCITATION"
    SINGULAR = "SINGULAR"
    NOT_IDENTIFIABLE = "NOT_IDENTIFIABLE"
    NOT_CONVERGED = "NOT_CONVERGED"
    IMPLAUSIBLE = "IMPLAUSIBLE"


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Estimate(_Model):
    """One identified number; `std` and `ci95` are null where the estimator gives none."""

    estimate: float | None
    std: float | None = None
    ci95: tuple[float | None, float | None] | None = None
    unit: str
    status: Status = Status.OK


class Table4Row(_Model):
    """A row of the paper's Table 4, in its names and order; truth and errors where they are known."""

    parameter: str
    unit: str
    estimate: float | None
    std: float | None = None
    truth: float | None = None
    error_percent: float | None = None
    paper_error_percent: float | None = None


class LogSummary(_Model):
    """A log that was used: first stamp in ns, duration in s, rate in Hz, each signal's channel.

    `sha256` is null where only what was needed of a log was fetched from an object store.
    """

    path: str
    sha256: str | None
    role: Literal["unloaded", "loaded"]
    format: str
    rows: int
    start_ns: int = 0
    duration: float
    rate: float
    mapping: dict[str, str]


class Whiteness(_Model):
    """Whether the torque residual of one joint is white: the test's p-value and the lag-one correlation."""

    white: bool
    p_value: float | None
    lag1_correlation: float


class TermCriterion(_Model):
    """Whether an optional term of the model earned its place: change of the criterion, negative is better."""

    term: str
    delta_bic: float
    kept: bool


class Bound(_Model):
    """A physical bound that the estimates break, and by how many standard deviations."""

    bound: str
    value: float
    distance_sigma: float | None


class TorquePrediction(_Model):
    """How well the model predicts the torque of logs: RMSE in N m, RMSE over the torque's RMS, and R², a joint."""

    rmse: tuple[float, float]
    nrmse: tuple[float, float]
    r2: tuple[float, float]
    filter: str


class FitSummary(_Model):
    """What a statistical estimator knows beside the estimates.

    `noise` holds the standard deviations theta1, theta2 (rad), tau1, tau2 (N m); `covariance` belongs to
    `covariance_names`; `intervals` says what the intervals rest on (white noise, blocks of the logs, or the larger of
    those and of the jackknife over logs); `by_log` is what each log tells by itself; `unidentifiable` says in words
    which directions the logs do not determine.
    """

    noise: dict[str, float]
    covariance_names: list[str]
    covariance: list[list[float | None]]
    intervals: Literal["likelihood", "sandwich", "jackknife"]
    iterations: int
    converged: bool
    whiteness: dict[str, Whiteness] = {}
    unidentifiable: list[str] = []
    terms: list[TermCriterion] = []
    broken_bounds: list[Bound] = []
    by_log: list[dict[str, Estimate]] = []
    residual: TorquePrediction | None = None
    cross_validation: TorquePrediction | None = None

    @model_validator(mode="after")
    def _covariance_is_square(self) -> FitSummary:
        size = len(self.covariance_names)
        if [len(row) for row in self.covariance] != [size] * size:
            raise ValueError(f"covariance should have {size} rows of {size} numbers, as covariance_names")
        return self


class Cause(_Model):
    """What probably lies behind a poor result, in a clause, and the flags to identify again with, if any mend it."""

    cause: str
    flags: list[str] = []


class Result(_Model):
    """The outcome of one identification.

    `truth` holds what a synthetic log was made with, by parameter; `causes` what probably lies behind a poor
    result, the most likely one first.
    """

    schema_version: Literal[1] = SCHEMA_VERSION
    version: str
    estimator: str
    parameters: dict[str, Estimate]
    loaded: dict[str, Estimate] = {}
    payload: dict[str, Estimate] = {}
    paper_payload: dict[str, Estimate] = {}
    table4: list[Table4Row] = []
    truth: dict[str, float] = {}
    fit: FitSummary | None = None
    settings: dict[str, Any]
    log: LogSummary
    more_logs: list[LogSummary] = []
    data_lost: bool = False
    warnings: list[str] = []
    causes: list[Cause] = []

    @property
    def logs(self) -> list[LogSummary]:
        """Every log that was used, the first one first."""
        return [self.log, *self.more_logs]

    @property
    def estimates(self) -> dict[str, Estimate]:
        """All estimates by name: constants, loaded constants, payload."""
        return {**self.parameters, **self.loaded, **self.payload}

    @property
    def complete(self) -> bool:
        """Whether every estimate has status OK."""
        return all(estimate.status is Status.OK for estimate in self.estimates.values())


def result_schema() -> dict[str, Any]:
    """JSON Schema of `result.json`."""
    return Result.model_json_schema()


def result_json(result: Result) -> str:
    """The text of `result.json`."""
    return json.dumps(result.model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_result(result: Result, path: Path) -> None:
    """Write `result` to `path`, whole or not at all. Raises `OutputError` where that is not possible."""
    with whole_file(path) as temporary:
        temporary.write_text(result_json(result), encoding="utf-8")


def read_result(path: Path) -> Result:
    """Read the result file `path`, or `path/result.json` where `path` is a folder.

    Raises
    ------
    ResultError
        If it is missing, not a result, or of another schema version.
    """
    file = path / "result.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultError(f"{file}: cannot read it ({error.strerror}); expected a result of algid identify") from error
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ResultError(f"{file}: not JSON ({error}); expected a result of algid identify") from error
    found = content.get("schema_version") if isinstance(content, dict) else None
    if found != SCHEMA_VERSION:
        raise ResultError(
            f"{file}: schema_version: expected {SCHEMA_VERSION}, found {found!r}; identify again with this version"
        )
    try:
        return Result.model_validate(content)
    except ValidationError as error:
        raise ResultError(f"{file}: {first_misfit(error)}; identify again with this version") from error
