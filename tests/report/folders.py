"""Result folders to report on: a simulated arm, identified by plain least squares on its exact
motion.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow.parquet as pq
from scipy.signal import butter, filtfilt

from algid.arm import (
    CONSTANT_NAMES,
    FloatArray,
    forward_dynamics,
    regressor,
    with_payload,
)
from algid.base.significance import NORMAL
from algid.estimators.innovations import residual_sums
from algid.estimators.paper import STAGE2_NAMES, stage1, stage2
from algid.identification.series import innovation_rows, write_columns
from algid.model import UNITS
from algid.notices import Notice
from algid.results import (
    Estimate,
    FitSummary,
    LogSummary,
    Result,
    Status,
    Table4Row,
    TorquePrediction,
    WhitenessTest,
    write_result,
)
from algid.synth.cases import Case, load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate

NOISE = 1e-2  # N m
RATE = 1000.0
START_NS = 1_700_000_000_123_456_789
LOADED_START_NS = START_NS + 60_000_000_000


@dataclass(frozen=True, eq=False)
class Recording:
    """A motion, its acceleration (2, N) and its torque as measured, with noise (2, N)."""

    motion: SimulatedMotion
    alpha: FloatArray
    measured: FloatArray


def record(case: Case, duration: float, payload: float = 0.0, seed: int = 1) -> Recording:
    """Drive the case's arm for `duration` s at 1 kHz."""
    k = with_payload(case.arm.constants(), case.arm.payload_constants(payload))
    t = np.arange(int(duration * RATE)) / RATE
    motion = simulate(k, wide_multi_sine(case.arm, seed), t)
    alpha = forward_dynamics(k, motion.theta, motion.omega, motion.tau)
    noise = np.random.default_rng(seed).normal(0, NOISE, motion.tau.shape)
    return Recording(motion, alpha, motion.tau + noise)


def build(folder: Path, duration: float = 10.0, case_name: str = "case1", **changes: Any) -> Result:
    """Write a complete result folder; `changes` replace fields of the result."""
    case = load_case(case_name)
    unloaded, loaded = record(case, duration), record(case, duration, case.payload, seed=2)
    folder.mkdir(parents=True, exist_ok=True)
    y = regressor(unloaded.motion.theta, unloaded.motion.omega, unloaded.alpha)
    k, covariance = _least_squares(y, unloaded.measured)
    result = _result(case, k, covariance, unloaded).model_copy(update=changes)
    write_result(result, folder / "result.json")
    _write_torque(folder / "torque.parquet", [unloaded, loaded], k)
    _write_information(folder / "information.parquet", y)
    _write_running(folder / "running.parquet", y, unloaded)
    _write_innovations(folder / "innovations.parquet", unloaded)
    _write_series(folder, unloaded, loaded, k)
    return result


def _least_squares(y: FloatArray, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
    """k (7,) and its covariance (7, 7)."""
    rows = np.moveaxis(y, 1, -1).reshape(-1, 7)
    inverse = np.linalg.inv(rows.T @ rows)
    return inverse @ rows.T @ tau.reshape(-1), NOISE**2 * inverse


def _result(case: Case, k: FloatArray, covariance: FloatArray, unloaded: Recording) -> Result:
    std = np.sqrt(np.diag(covariance))
    truth = dict(zip(CONSTANT_NAMES, case.arm.constants().tolist(), strict=True))
    parameters = {
        name: estimate(value, spread, UNITS[name])
        for name, value, spread in zip(CONSTANT_NAMES, k.tolist(), std.tolist(), strict=True)
    }
    rms = np.sqrt(np.mean(unloaded.measured**2, axis=1))
    prediction = TorquePrediction(
        rmse=(NOISE, NOISE),
        nrmse=(NOISE / rms[0], NOISE / rms[1]),
        r2=tuple(1 - (NOISE / rms) ** 2),
        filter="none",
    )
    return Result(
        version="0.2.0",
        estimator="refined",
        parameters=parameters,
        payload={
            "m_p": estimate(case.payload * 1.0001, 2e-4 * case.payload, "kg"),
            "l1": estimate(case.arm.l1, 1e-4, "m"),
        },
        paper_payload={"m_p": Estimate(estimate=case.payload * 1.004, unit="kg")},
        table4=_table4(case, parameters, truth),
        fit=FitSummary(
            noise={"theta1": 1e-4, "theta2": 1e-4, "tau1": NOISE, "tau2": NOISE},
            covariance_names=list(CONSTANT_NAMES),
            covariance=covariance.tolist(),
            intervals="likelihood",
            iterations=4,
            converged=True,
            whiteness={
                "tau1": WhitenessTest(white=True, p_value=0.41, lag1_correlation=0.004),
                "tau2": WhitenessTest(white=True, p_value=0.77, lag1_correlation=-0.011),
            },
            residual=prediction,
        ),
        settings={"estimator": "refined", "velocity": "observer", "window": None, "gravity": 9.81},
        log=_log(f"{case.name}-unloaded.mcap", "unloaded", unloaded),
        more_logs=[_log(f"{case.name}-loaded.mcap", "loaded", unloaded)],
    )


def estimate(value: float, std: float, unit: str, status: Status = Status.OK) -> Estimate:
    """An estimate with its normal interval."""
    return Estimate(
        estimate=value,
        std=std,
        ci95=(value - NORMAL * std, value + NORMAL * std),
        unit=unit,
        status=status,
    )


def _table4(
    case: Case, parameters: dict[str, Estimate], truth: dict[str, float]
) -> list[Table4Row]:
    return [
        Table4Row(
            parameter=name,
            unit=UNITS[name],
            estimate=parameters[name].estimate,
            std=parameters[name].std,
            truth=truth[name],
            error_percent=100 * abs((parameters[name].estimate or 0) - truth[name]) / truth[name],
            paper_error_percent=case.paper_error_percent.get(name),
        )
        for name in ("k1", "k3", "k6", "k4", "k2")
    ]


def _log(path: str, role: Any, recording: Recording) -> LogSummary:
    rows = recording.motion.t.size
    signals = ("t", "theta1", "theta2", "tau1", "tau2")
    return LogSummary(
        path=f"logs/{path}",
        sha256="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        role=role,
        format="mcap",
        rows=rows,
        duration=float(recording.motion.t[-1]),
        rate=RATE,
        mapping={signal: f"/joint_states {signal}" for signal in signals},
    )


def _write_torque(path: Path, recordings: list[Recording], k: FloatArray) -> None:
    frames = []
    for log, found in enumerate(recordings):
        predicted = np.einsum(
            "jkn,k->jn", regressor(found.motion.theta, found.motion.omega, found.alpha), k
        )
        if log:  # the loaded arm's own constants would predict its torque
            predicted = found.motion.tau
        columns = {"log": np.full(found.motion.t.size, log, np.int32), "t": found.motion.t}
        for name, pair in (
            ("theta", found.motion.theta),
            ("omega", found.motion.omega),
            ("tau", found.measured),
        ):
            columns |= {f"{name}{joint + 1}": pair[joint] for joint in range(2)}
        columns |= {f"tau{joint + 1}_predicted": predicted[joint] for joint in range(2)}
        frames.append(pl.DataFrame(columns))
    table = pl.concat(frames).to_arrow()
    starts = json.dumps([START_NS, LOADED_START_NS])
    pq.write_table(table.replace_schema_metadata({"start_ns": starts}), path)


def _write_information(path: Path, y: FloatArray) -> None:
    squares = (y**2).sum(axis=0) / NOISE**2
    seconds = int(squares.shape[1] / RATE)
    gained = squares[:, : int(seconds * RATE)].reshape(7, seconds, -1).sum(axis=2)
    columns = {"log": np.zeros(seconds, np.int32), "t": np.arange(seconds, dtype=np.float64)}
    pl.DataFrame(columns | dict(zip(CONSTANT_NAMES, gained, strict=True))).write_parquet(path)


def _write_running(path: Path, y: FloatArray, found: Recording) -> None:
    """Least squares on the first samples, at twenty moments."""
    columns: dict[str, list[float]] = {
        name: [] for name in ("t", *CONSTANT_NAMES, *(f"{n}_half" for n in CONSTANT_NAMES))
    }
    for end in np.linspace(0, y.shape[2], 21).astype(int)[1:]:
        k, covariance = _least_squares(y[:, :, :end], found.measured[:, :end])
        columns["t"].append(end / RATE)
        for name, value, spread in zip(
            CONSTANT_NAMES, k, np.sqrt(np.diag(covariance)), strict=True
        ):
            columns[name].append(float(value))
            columns[f"{name}_half"].append(1.96 * float(spread))
    log = pl.Series("log", [0] * len(columns["t"]), pl.Int32)
    pl.DataFrame({"log": log, **columns}).write_parquet(path)


def _write_innovations(path: Path, found: Recording) -> None:
    """The noise itself, which is what is left where the model is the arm."""
    sums = residual_sums((found.measured - found.motion.tau) / NOISE, 1 / RATE)
    write_columns(path, innovation_rows(sums, whitened=True), [START_NS])


def _write_series(folder: Path, unloaded: Recording, loaded: Recording, k: FloatArray) -> None:
    """The paper's series on windows of 2 s of the exact motion."""
    rows = int(2 * RATE)

    def windows(signal: FloatArray) -> FloatArray:
        return signal[:, : signal.shape[1] // rows * rows].reshape(2, -1, rows)

    one = stage1(
        windows(unloaded.motion.theta),
        windows(unloaded.motion.omega),
        windows(unloaded.motion.tau),
        1 / RATE,
    )
    two = stage2(
        windows(loaded.motion.theta),
        windows(loaded.motion.omega),
        windows(loaded.motion.tau),
        1 / RATE,
        k,
        9.81,
    )
    series = dict(zip(CONSTANT_NAMES, one.k, strict=True)) | {
        "condition": one.condition,
        "k7_condition": one.k7_condition,
    }
    other = dict(zip(STAGE2_NAMES, two.x, strict=True)) | {
        "l1": two.l1,
        "m_p": two.m_p,
        "condition": two.condition,
    }
    for name, found in (("estimates", series), ("loaded", other)):
        flat = {key: values.reshape(-1) for key, values in found.items()}
        t = np.arange(flat["condition"].size) / RATE
        table = pl.DataFrame({"t": t, **flat}).to_arrow()
        start = START_NS if name == "estimates" else LOADED_START_NS
        pq.write_table(
            table.replace_schema_metadata({"start_ns": json.dumps([start])}),
            folder / f"{name}.parquet",
        )


def build_recorded(folder: Path, csv: Path) -> Result:
    """A folder on a recorded run of a real arm: filtered least squares, whose residual is far from
    white.
    """
    run = pl.read_csv(csv)
    t = run["time"].to_numpy() - run["time"][0]
    dt = float(np.median(np.diff(t)))
    grid = np.arange(int(t[-1] / dt)) * dt

    def smooth(name: str) -> FloatArray:
        values = np.stack(
            [np.interp(grid, t, run[f"{name}{joint}"].to_numpy()) for joint in (1, 2)]
        )
        low: FloatArray = filtfilt(*butter(3, 5.0 * 2 * dt), values)
        return low

    theta = smooth("pos_meas") - np.array([[np.pi / 2], [0.0]])
    omega = np.gradient(theta, dt, axis=1)
    alpha = np.gradient(omega, dt, axis=1)
    raw = np.stack([np.interp(grid, t, run[f"tau_meas{joint}"].to_numpy()) for joint in (1, 2)])
    recording = Recording(SimulatedMotion(grid, theta, omega, raw), alpha, raw)
    y = regressor(theta, omega, alpha)
    k, covariance = _least_squares(y, smooth("tau_meas"))
    result = _result(load_case("case1"), k, 400 * covariance, recording).model_copy(
        update={
            "log": _log(csv.name, "unloaded", recording),
            "more_logs": [],
            "payload": {},
            "paper_payload": {},
            "table4": [],
            "notices": [
                Notice("UNEVEN_STAMPS", "stamps jitter by up to 0.9 ms; resampled at 2 ms")
            ],
        }
    )
    write_result(result, folder / "result.json")
    _write_torque(folder / "torque.parquet", [recording], k)
    return result


HOSTILE = '<script>document.title="owned"</script>"><img src=x onerror=document.title="owned">.csv'


def hostile(result: Result) -> Result:
    """`result` with markup, quotes and control characters wherever a log or a user may put text."""
    log = replace_log(result.log, f"logs/{HOSTILE}")
    return result.model_copy(
        update={
            "log": log,
            "more_logs": [
                replace_log(log, "x/</script><svg onload=alert(1)>\x1b[31m\u202egnp.csv")
            ],
            "settings": {HOSTILE: HOSTILE, "a|b": "`c` | [red]d[/red] [x](javascript:alert(1))"},
            "notices": [
                Notice("H", text) for text in (HOSTILE, "]]><!-- \x1b]0;owned\x07", "@everyone ```")
            ],
            "estimator": "<b>bold</b>",
        }
    )


def replace_log(log: LogSummary, path: str) -> LogSummary:
    """`log` under another name, its channels named as badly."""
    return log.model_copy(
        update={"path": path, "mapping": {"theta1": f"/joint {HOSTILE}", HOSTILE: "x"}}
    )
