"""What an identification found: the one source of every table, file and page that shows it.

A `Result` is written as `result.json` (schema version 4; 3 is still read) and read back; JSON
Schema comes from the models. Its verdict is made of the rest whenever it is asked for, and written
for whoever reads the file. Numbers that do not exist (NaN) are null; an unbounded interval is
``[null, null]``. Nothing in a result depends on when it was made, so that the same log and settings
give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, computed_field, model_validator

from algid.base.errors import ResultError
from algid.base.files import first_misfit, read_whole, whole_file
from algid.base.significance import NORMAL
from algid.log import Reading
from algid.model import DELAYS
from algid.notices import Notice, Verdict, code_of_now, notes_of, warnings_of
from algid.physics.signals import Widths

SCHEMA_VERSION: Literal[4] = 4
Pair = tuple[float | None, float | None]


class Status(StrEnum):
    """How far an estimate can be trusted.

    NOT_SIGNIFICANT: the 95 % interval contains zero.
    IMPLAUSIBLE: the estimates together break a bound of physics by more than three standard
    deviations, or predict the torque worse than a constant does.
    FROM_PRIOR: the logs leave it open, or tell less of it than the prior that was given.
    """

    OK = "OK"
    WEAK_EXCITATION = "WEAK_EXCITATION"
    NOT_IDENTIFIABLE = "NOT_IDENTIFIABLE"
    NOT_CONVERGED = "NOT_CONVERGED"
    IMPLAUSIBLE = "IMPLAUSIBLE"
    NOT_SIGNIFICANT = "NOT_SIGNIFICANT"
    FROM_PRIOR = "FROM_PRIOR"


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Estimate(_Model):
    """One identified number; `std` and `ci95` are null where the estimator gives none."""

    estimate: float | None
    std: float | None = None
    ci95: Pair | None = None
    unit: str
    status: Status = Status.OK

    @property
    def measured(self) -> bool:
        """Whether logs determine number and interval: also where zero lies within it."""
        return self.status in (Status.OK, Status.NOT_SIGNIFICANT) and self.estimate is not None

    @property
    def usable(self) -> bool:
        """Whether number and interval can be used, be they measured or what a prior says."""
        return self.measured or (self.status is Status.FROM_PRIOR and self.estimate is not None)

    @property
    def half(self) -> float | None:
        """Half the 95 % interval; None where there is none, or it is unbounded."""
        low, high = self.ci95 or (None, None)
        if low is None or high is None:
            return None
        return (high - low) / 2


class Table4Row(_Model):
    """A row of the paper's Table 4, in its names and order.

    Truth and errors where they are known.
    """

    parameter: str
    unit: str
    estimate: float | None
    std: float | None = None
    truth: float | None = None
    error_percent: float | None = None
    paper_error_percent: float | None = None


class LogSummary(_Model):
    """A log used: first stamp in ns, duration in s, rate in Hz, channels, and how it was read.

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
    reading: Reading | None = None


class WhitenessTest(_Model):
    """Whether one joint's torque residual is white: p-value and correlation at lag one."""

    white: bool
    p_value: float | None
    lag1_correlation: float


class TermCriterion(_Model):
    """Worth of an optional term of the model.

    `delta_bic` is the change of the Bayesian criterion, negative is better. Where the terms were
    chosen automatically, `evidence` is half of what the term explains of the squares less half of
    what chance does, positive is better, and `why` says what decided.
    """

    term: str
    delta_bic: float | None = None
    kept: bool
    evidence: float | None = None
    why: str = ""


class Endogeneity(_Model):
    """Whether regressors correlate with the error: the Durbin-Wu-Hausman statistic and p-value.

    By "largest" stands the coefficient at which instruments and least squares are furthest apart,
    in deviations.
    """

    statistic: float
    p_value: float | None
    endogenous: bool


class TorqueModel(_Model, Widths):  # type: ignore[misc]  # its configuration freezes it
    """The torque's terms beside eq. (1), friction's speeds in rad/s, and who chose the terms.

    `shrunk` names the coefficients of terms that were not chosen: each is what the logs and what
    physics expects of it agree on.
    """

    terms: list[str]
    chosen_by: Literal["logs", "settings", "parameters"]
    shrunk: list[str] = []


class TorqueHold(_Model):
    """The hold of the torque between samples: "zoh" holds it, "foh" is linear; asked and used.

    If the logs were to choose ("auto"), `half` is half a sample in s, `late` the estimated delay in
    s of a torque that is not held, `late_std` its standard deviation, `odds` the log of the odds
    for a held torque, and `share` the largest error of any estimate under the wrong hold, in its
    standard deviations. `told` says whether these decided; if not, the delay is a parameter whose
    prior covers both, or what a controller that is `faster` than the log makes of it.
    """

    asked: Literal["auto", "foh", "zoh"]
    used: Literal["foh", "zoh"]
    told: bool | None = None
    faster: bool | None = None
    half: float | None = None
    late: float | None = None
    late_std: float | None = None
    odds: float | None = None
    share: float | None = None


class Bound(_Model):
    """A physical bound that the estimates break, and by how many standard deviations."""

    bound: str
    value: float
    distance_sigma: float | None


TRIFLE = 0.1
"""Of what acts on a joint: a residual this small passes, however little there was to explain."""


class TorquePrediction(_Model):
    """Prediction of the logs' torque by joint: RMSE in N m, RMSE over the torque's RMS, R².

    Scored is what lies below `bandwidth`, in Hz; `filter` says how it is cut out. `of_load` is the
    RMSE over what acts on a joint: its torque, or the model's parts where they are larger.
    `rmse_moving` and `rmse_rest` are those of a joint faster and slower than friction's step, and
    `rmse_held` the latter beyond the ± f that dry friction may be there; null where a joint never
    moves or stands, or that was not looked at.
    """

    rmse: tuple[float, float]
    nrmse: tuple[float, float]
    r2: tuple[float, float]
    filter: str
    bandwidth: float | None = None
    of_load: tuple[float, float] | None = None
    rmse_moving: Pair | None = None
    rmse_rest: Pair | None = None
    rmse_held: Pair | None = None

    @property
    def band(self) -> str:
        """The bandwidth in which it is scored, behind a noun; empty where an old result has none.

        Such as " below 60 Hz".
        """
        return "" if self.bandwidth is None else f" below {self.bandwidth:g} Hz"

    def unexplained(self, least: float) -> tuple[int, ...]:
        """Joints, 1 or 2, with R² below `least` and a residual above `TRIFLE` of their torque.

        So is the R² of a joint's residual while it moves: at rest friction is any torque up to ± f,
        which contradicts no model.
        """
        of_load, moving = self.of_load or self.nrmse, self.rmse_moving or (None, None)
        joints = []
        for joint, r2, rmse, now, of in zip(
            (1, 2), self.r2, self.rmse, moving, of_load, strict=True
        ):
            if now is not None and rmse > 0:
                r2 = max(r2, 1 - (1 - r2) * (now / rmse) ** 2)
            if r2 < least and of > TRIFLE:
                joints.append(joint)
        return tuple(joints)


class Repeatability(_Model):
    """Payload mass of each loaded log by itself, and their standard deviation, in kg."""

    masses: list[float]
    std: float
    ci95: tuple[float, float]


class FitSummary(_Model):
    """What a statistical estimator knows beside the estimates.

    `noise` holds the standard deviations theta1, theta2 (rad), tau1, tau2 (N m); `covariance`
    belongs to `covariance_names`; `intervals` says what the intervals rest on (white noise, blocks
    of the logs, or the larger of those and of the jackknife over logs); `by_log` is what each log
    tells by itself; `unidentifiable` says in words which directions the logs do not determine;
    `endogeneity` goes by joint; `stiffness` is that of elastic joints, k_e1 and k_e2.
    """

    noise: dict[str, float]
    covariance_names: list[str]
    covariance: list[list[float | None]]
    intervals: Literal["likelihood", "sandwich", "jackknife"]
    iterations: int
    converged: bool
    whiteness: dict[str, WhitenessTest] = {}
    unidentifiable: list[str] = []
    model: TorqueModel | None = None
    terms: list[TermCriterion] = []
    torque_hold: TorqueHold | None = None
    broken_bounds: list[Bound] = []
    by_log: list[dict[str, Estimate]] = []
    residual: TorquePrediction | None = None
    cross_validation: TorquePrediction | None = None
    endogeneity: dict[str, Endogeneity] = {}
    repeatability: Repeatability | None = None
    torque_gain: Estimate | None = None
    stiffness: dict[str, Estimate] = {}

    @property
    def prediction(self) -> TorquePrediction | None:
        """How well torque is predicted: of other logs where that was tried, else of those used."""
        return self.cross_validation or self.residual

    def covariance_of(self, names: Sequence[str]) -> Any:
        """Covariance (n, n) of the parameters `names`, numpy.

        NaN where it is not known, or the fit has no such parameter.
        """
        import numpy as np

        rows = zip(self.covariance_names, self.covariance, strict=False)
        known = {name: dict(zip(self.covariance_names, row, strict=False)) for name, row in rows}
        found = [[known.get(one, {}).get(other) for other in names] for one in names]
        return np.array(found, dtype=np.float64).reshape(len(names), len(names))


class Result(_Model):
    """The outcome of one identification.

    Attributes
    ----------
    schema_version, version : int, str
        Of the file's form, and of the algid that wrote it.
    estimator : str
        Whose numbers these are: the settings name the one that was asked for.
    parameters, loaded, payload : dict of Estimate
        By name k1 … k7 of the arm, those of the loaded arm, and what the payload is made of.
    paper_payload : dict of Estimate
        The payload by the paper's own formulas.
    table4, truth : list of Table4Row, dict of float
        Rows in the paper's order; by parameter what a synthetic log was made with.
    fit : FitSummary
        What a statistical estimator knows beside the estimates.
    settings, profile : dict
        How it was identified, and what the user said about the logs in a profile's words. How each
        log was read in the end stands in its `reading`.
    log, more_logs : LogSummary, list of LogSummary
        The first log that was used, and the others.
    data_lost : bool
        Whether a log lacks samples.
    notices : list of Notice
        What was noticed in the logs and in the fit.
    verdict : Verdict
        How far to trust it.
    """

    schema_version: Literal[4] = SCHEMA_VERSION
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
    profile: dict[str, Any] = {}
    log: LogSummary
    more_logs: list[LogSummary] = []
    data_lost: bool = False
    notices: list[Notice] = []

    @model_validator(mode="before")
    @classmethod
    def _of_now(cls, content: Any) -> Any:
        """What a file holds: its verdict is made anew, and version 3 has defaults for the rest."""
        if isinstance(content, dict):
            content = {name: value for name, value in content.items() if name != "verdict"}
            content |= {"schema_version": 4} if content.get("schema_version") == 3 else {}
        return content

    @computed_field  # type: ignore[prop-decorator]
    @property
    def verdict(self) -> Verdict:
        """How far to trust the result: made of all that it holds."""
        from algid.results.verdict import judge

        return judge(self)

    @property
    def warnings(self) -> list[str]:
        """What makes the result doubtful, of logs and fit: codes and words."""
        return list(map(str, warnings_of(self.notices)))

    @property
    def notes(self) -> list[str]:
        """How things were read and done: codes and words."""
        return list(map(str, notes_of(self.notices)))

    @property
    def logs(self) -> list[LogSummary]:
        """Every log that was used, the first one first."""
        return [self.log, *self.more_logs]

    @property
    def delay(self) -> Estimate | None:
        """The estimate of the torque's delay, where there is one."""
        return next((self.parameters[name] for name in DELAYS if name in self.parameters), None)

    @property
    def torque_model(self) -> TorqueModel | None:
        """The terms of the torque that were fitted; None of an estimator that has no choice."""
        return None if self.fit is None else self.fit.model

    @property
    def estimates(self) -> dict[str, Estimate]:
        """All estimates by name: constants, loaded constants, payload."""
        return self.parameters | self.loaded | self.payload

    @property
    def quantile(self) -> float:
        """Half width of every 95 % interval in standard deviations, Student's or normal.

        It is one number for all estimates: that of the fit's effective degrees of freedom.
        """
        every = self.estimates.values()
        return next((one.half / one.std for one in every if one.half and one.std), NORMAL)

    @property
    def complete(self) -> bool:
        """Whether logs determine every estimate: see `Estimate.measured`."""
        return all(estimate.measured for estimate in self.estimates.values())

    @property
    def covariance(self) -> Any:
        """Covariance of the parameters `fit.covariance_names` (Q, Q), numpy.

        None without error bars.
        """
        return None if self.fit is None else self.fit.covariance_of(self.fit.covariance_names)

    def to_frame(self) -> Any:
        """The estimates as a polars frame: parameter, estimate, std, low, high, unit, status."""
        import polars as pl

        texts, numbers = ("unit", "status"), ("estimate", "std", "low", "high")
        kinds = dict.fromkeys(numbers, pl.Float64) | dict.fromkeys(texts, pl.String)
        rows = [
            (name, one.estimate, one.std, *(one.ci95 or (None, None)), one.unit, one.status.value)
            for name, one in self.estimates.items()
        ]
        return pl.DataFrame(rows, {"parameter": pl.String, **kinds}, orient="row")

    def __eq__(self, other: object) -> bool:
        """Whether both hold the same, whatever else either can do."""
        return isinstance(other, Result) and dict(self) == dict(other)


def result_json(result: Result) -> str:
    """The text of `result.json`."""
    return result.model_dump_json(indent=2) + "\n"


def write_result(result: Result, path: Path) -> None:
    """Write `result` to `path`, whole or not at all.

    Raises `OutputError` where that is not possible.
    """
    with whole_file(path) as temporary:
        temporary.write_text(result_json(result), encoding="utf-8")


def read_result(path: str | Path) -> Result:
    """The result in `path`, a file or the folder that holds its `result.json`.

    Raises
    ------
    ResultError
        As `algid.read_result`.
    """
    path = Path(path)
    file = path / "result.json" if path.is_dir() else path
    try:
        result = Result.model_validate_json(read_whole(file))
    except OSError as error:
        # `identify -o FOLDER` writes FOLDER/LOG.algid
        named = "".join(f"; name {one}" for one in sorted(path.glob("*.algid"))[:1])
        raise ResultError(
            f"{file}: cannot read it ({error.strerror}); expected a result of algid identify{named}"
        ) from error
    except ValidationError as error:
        raise ResultError(
            f"{file}: {first_misfit(error)}; identify again with this version"
        ) from error
    # notices of schema 3 have codes of then, and texts of their own
    notices = [replace(one, code=code_of_now(one.code)) for one in result.notices]
    return result.model_copy(update={"notices": notices})
