"""The torque that a model predicts along a log, for plots, as sharp as the angles' noise allows.

Time series of a result folder, written block by block.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.arrow import table_of_columns
from algid.estimators.elastic import flexed
from algid.estimators.fit import Fit, has_running, running
from algid.estimators.innovations import (
    Curves,
    ResidualSums,
    autocorrelation,
    pooled,
    spectra,
    whiteness_of,
)
from algid.estimators.noise import first_guess
from algid.estimators.prediction import CUTOFF, MOTION, scored_torque
from algid.identification.recordings import Recordings, Role
from algid.model import Model, Motion, inertia, torque
from algid.signals.differences import AT_ONCE, TorqueShift
from algid.signals.filters import half_length, smoothed
from algid.signals.segments import Segment, pieces

if TYPE_CHECKING:
    from algid.identification.by_likelihood import Fitted

PREDICTED_ROWS = 1 << 17
NOISE_SHARE = 0.05  # of the torque's RMS: what the angles' noise may add to the prediction
LOWEST, HIGHEST = 4.0, 40.0  # Hz


@dataclass(frozen=True)
class Predictor:
    """A model to be judged on logs: torque, coefficients by role, and the logged torque's shift."""

    model: Model
    coefficients: Callable[[Role], FloatArray]
    shift: TorqueShift = AT_ONCE


def torque_blocks(survey: Recordings, known: Predictor) -> Iterator[dict[str, FloatArray]]:
    """Motion, measured and predicted torque of every log.

    Angles are smoothed without phase; the prediction is NaN where the smoother reaches past a
    stretch's end.
    """
    for number, log in enumerate(survey.logs):
        c = known.coefficients(log.role)
        for piece in pieces(survey.segments(log), PREDICTED_ROWS):
            yield {
                "log": np.full(len(piece), number, dtype=np.int32),
                **_torques(piece, known.model, c, known.shift.at(piece.dt)),
            }


_MOTION = ("theta1", "theta2", "omega1", "omega2")
_TORQUES = ("tau1", "tau2", "tau1_predicted", "tau2_predicted")


def _torques(piece: Segment, model: Model, c: FloatArray, shift: float) -> dict[str, FloatArray]:
    omega = predicted = np.full_like(piece.theta, np.nan)
    if len(piece) >= 16:
        bandwidth = _bandwidth(piece, model, c)
        # the model is not linear in the motion: what noise forbids to show is taken from its
        # torque, not from its motion
        theta = smoothed(piece.theta, piece.dt, max(bandwidth, min(MOTION, 0.1 / piece.dt)))
        omega = np.gradient(theta, piece.dt, axis=1)
        motion = Motion(theta, omega, np.gradient(omega, piece.dt, axis=1))
        motion = flexed(model, c, motion, piece.dt)
        predicted = smoothed(torque(model, c, motion), piece.dt, bandwidth)
        shift -= model.lag(c)  # a torque that lags shows at its stamp what acted before
        predicted = np.stack([np.interp(piece.t + shift, piece.t, row) for row in predicted])
        reach = min(half_length(piece.dt, bandwidth), len(piece) // 2)
        predicted[:, :reach] = predicted[:, len(piece) - reach :] = np.nan
    rows = np.concatenate([piece.theta, omega, piece.tau, predicted])
    return {"t": piece.t} | dict(zip(_MOTION + _TORQUES, rows, strict=True))


def _bandwidth(piece: Segment, model: Model, c: FloatArray) -> float:
    """Hz below which the angles' noise in accelerations adds at most `NOISE_SHARE` of the torque.

    White noise σ_θ sampled at dt has σ_θ √(2 dt B/5) (2π B)² of acceleration below B; inertia
    makes it torque.
    """
    outstretched = np.abs(np.diag(inertia(model, c, np.zeros((2, 1)))[..., 0]))
    allowed = NOISE_SHARE * np.sqrt(np.mean(piece.tau**2, axis=1))
    sigma = first_guess(piece.theta, piece.tau).theta
    noise = outstretched * sigma * np.sqrt(0.4 * piece.dt) * (2 * np.pi) ** 2
    sharpest = (allowed / np.maximum(noise, 1e-300)) ** 0.4
    return float(np.clip(sharpest.min(), LOWEST, min(HIGHEST, 0.1 / piece.dt)))


SCORED_RATE = 10.0
"""Samples a period of the highest frequency that is scored."""


def scored_blocks(survey: Recordings, known: Predictor) -> Iterator[dict[str, FloatArray]]:
    """The torque that is scored and its prediction, of every log."""
    for number, log in enumerate(survey.logs):
        c = known.coefficients(log.role)
        for every, _, rows in scored_torque(known.model, c, survey.segments(log), known.shift):
            dt = float(every[1] - every[0])
            step = max(1, int(1 / (SCORED_RATE * CUTOFF * dt)))
            t, X = every[::step], rows[:, :, ::step]
            rows = np.concatenate([X[:, -1], np.einsum("q,aqn->an", c, X[:, :-1])])
            yield {
                "log": np.full(t.size, number, dtype=np.int32),
                "t": t,
                **dict(zip(_TORQUES, rows, strict=True)),
            }


START_KEY = b"start_ns"


def write_columns(
    path: Path, blocks: Iterable[Mapping[str, object]], start_ns: Sequence[int]
) -> None:
    """Write blocks of flat columns as one Parquet file, each log's first stamp in its metadata."""
    import pyarrow.parquet

    tables = map(table_of_columns, blocks)
    for first in islice(tables, 1):
        schema = first.schema.with_metadata({START_KEY: json.dumps(list(start_ns))})
        # floats of an estimate hardly ever repeat: a dictionary would only cost time
        way = {"compression": "zstd", "use_dictionary": False}
        with pyarrow.parquet.ParquetWriter(path, schema, **way) as writer:
            for table in chain([first], tables):
                if not table.schema.equals(schema):
                    table = table.cast(schema)  # which imports all of pyarrow's functions
                writer.write_table(table)


def information_blocks(fit: Fit, durations: Sequence[float]) -> Iterator[dict[str, FloatArray]]:
    """Information on each shared parameter by second of each log, in 1 / unit²."""
    for number, (log, duration) in enumerate(zip(fit.logs, durations, strict=True)):
        jacobian = fit.shared.jacobian(fit.values, log.loaded)
        gains = np.einsum("ap,bac,cp->pb", jacobian, log.S, jacobian, optimize=True)
        t = np.arange(gains.shape[1]) * duration / gains.shape[1]
        second = np.floor(t)
        starts = np.flatnonzero(np.diff(second, prepend=-1.0))
        summed = np.add.reduceat(gains, starts, axis=1)
        columns = {"log": np.full(starts.size, number, dtype=np.int32), "t": second[starts]}
        yield columns | dict(zip(fit.names, summed, strict=True))


WHITE_SPECTRUM = "whitened spectrum"
SPECTRUM = "spectrum"
TORQUE_SPECTRUM = "torque spectrum"
AUTOCORRELATION = "autocorrelation"


def innovation_rows(sums: ResidualSums, *, whitened: bool) -> Iterator[dict[str, object]]:
    """Spectrum and autocorrelation of a residual: a row a joint and a frequency (Hz) or a lag (s).

    `low` and `high` hold 95 % of the values of white noise. A whitened residual has its spectrum
    in shares of white noise; that of windows is in (N m)²/Hz and stands beside the torque's own
    through the same windows.
    """
    curves: dict[str, Curves] = {}
    if whitened:
        curves[WHITE_SPECTRUM] = whiteness_of(sums)
    else:
        plain = spectra(sums)
        plain = plain._replace(low=np.nan * plain.x, high=np.nan * plain.x)
        curves[SPECTRUM] = plain._replace(values=plain.values[:2])
        curves[TORQUE_SPECTRUM] = plain._replace(values=plain.values[2:])
    curves[AUTOCORRELATION] = autocorrelation(sums)
    for kind, (x, values, low, high) in curves.items():
        yield {
            "quantity": [kind] * values.size,
            "joint": np.repeat(np.arange(1, 3, dtype=np.int32), x.size),
            "x": np.tile(x, 2),
            "value": values.ravel(),
            "low": np.broadcast_to(low, values.shape).ravel(),
            "high": np.broadcast_to(high, values.shape).ravel(),
        }


def residual_of(found: Fitted) -> ResidualSums | None:
    """Residual sums of the estimator behind a fit: of its innovations, or of its windows.

    None where no log is long enough.
    """
    from algid.estimators import weak

    fit = found.fit
    if fit.residual:
        return pooled(fit.residual)
    problem = found.problem
    if fit.delay is not None:
        problem = problem.at(found.chosen.model, fit.delay)
    sums, known = [], predictor_of_fit(found)
    for log, source in zip(found.survey.logs, problem.logs, strict=True):
        of_log = weak.residuals(source, problem.settings, known.coefficients(log.role))
        if of_log is not None:
            sums.append(of_log)
    return pooled(sums)


def write_fit_series(folder: Path, found: Fitted, residual: ResidualSums | None) -> None:
    """Write the time series of a fit, and what its `residual` looks like.

    `torque.parquet`, `scored.parquet` (of logs long enough to be scored), `information.parquet`,
    `running.parquet` (not of a fit that was held within
    bounds or did not converge) and, where there is a residual, `innovations.parquet`.
    """
    fit, survey = found.fit, found.survey
    starts = [survey.whole(log).first_ns for log in survey.logs]
    durations = [log.duration for log in survey.logs]
    known = predictor_of_fit(found)
    write_columns(folder / "torque.parquet", torque_blocks(survey, known), starts)
    write_columns(folder / "scored.parquet", scored_blocks(survey, known), starts)
    # a log too short for a window is in no fit, and which it is nobody knows
    every = len(fit.logs) == len(durations)
    if every:
        write_columns(folder / "information.parquet", information_blocks(fit, durations), starts)
    if every and has_running(fit):
        write_columns(folder / "running.parquet", [running(fit, durations)], starts)
    if residual is not None:
        rows = innovation_rows(residual, whitened=bool(fit.residual))
        write_columns(folder / "innovations.parquet", rows, starts)


def predictor_of_fit(found: Fitted) -> Predictor:
    """The model of a fit, with the delay that it estimates, if any."""
    fit = found.fit
    model = fit.shared.model

    def coefficients(role: Role) -> FloatArray:
        return fit.shared.coefficients(fit.values, role == "loaded")[: len(model.names)]

    return Predictor(model, coefficients, found.settings.torque_shift(fit.delay))
