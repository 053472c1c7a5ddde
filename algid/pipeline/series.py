"""Time series of a result folder, written block by block."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.identify.fit import Fit
from algid.identify.paper.method import Series
from algid.pipeline.predicted import torque_blocks
from algid.pipeline.settings import Settings
from algid.pipeline.sources import LogSource

START_KEY = b"start_ns"
ROWS = 1 << 17


def write_columns(path: Path, blocks: Iterable[Mapping[str, FloatArray]], start_ns: Sequence[int]) -> None:
    """Write blocks of flat columns as one Parquet file, with each log's first stamp in its metadata."""
    import pyarrow
    import pyarrow.parquet

    writer: pyarrow.parquet.ParquetWriter | None = None
    try:
        for block in blocks:
            table = pyarrow.table(dict(block))
            if writer is None:
                schema = table.schema.with_metadata({START_KEY: json.dumps(list(start_ns))})
                # floats of an estimate hardly ever repeat: a dictionary would only cost time
                writer = pyarrow.parquet.ParquetWriter(path, schema, compression="zstd", use_dictionary=False)
            writer.write_table(table.cast(writer.schema))
    finally:
        if writer is not None:
            writer.close()


def series_blocks(series: Iterable[Series], names: Sequence[str]) -> Iterator[dict[str, FloatArray]]:
    """Windows of estimates gathered into blocks of columns, `t` first; a window's values are (s, n)."""
    gathered: list[Series] = []
    for window in series:
        gathered.append(window)
        if sum(part.t.size for part in gathered) >= ROWS:
            yield _columns(gathered, names)
            gathered = []
    if gathered:
        yield _columns(gathered, names)


def _columns(windows: Sequence[Series], names: Sequence[str]) -> dict[str, FloatArray]:
    values = np.concatenate([window.values for window in windows], axis=1)
    return {"t": np.concatenate([window.t for window in windows]), **dict(zip(names, values, strict=True))}


def information_blocks(fit: Fit, durations: Sequence[float]) -> Iterator[dict[str, FloatArray]]:
    """Information on each shared parameter by second of each log, in 1 / unit²."""
    for number, (log, duration) in enumerate(zip(fit.logs, durations, strict=True)):
        jacobian = fit.shared.jacobian(fit.values, log.loaded)
        gains = np.einsum("ap,bac,cp->pb", jacobian, log.S, jacobian, optimize=True)
        t = np.arange(gains.shape[1]) * duration / gains.shape[1]
        second = np.floor(t)
        starts = np.flatnonzero(np.diff(second, prepend=-1.0))
        summed = np.add.reduceat(gains, starts, axis=1)
        yield {
            "log": np.full(starts.size, number, dtype=np.int32),
            "t": second[starts],
            **dict(zip(fit.names, summed, strict=True)),
        }


def write_fit_series(folder: Path, fit: Fit, logs: Sequence[LogSource], settings: Settings) -> None:
    """Write `torque.parquet` and `information.parquet` of a fit."""
    summaries, starts = [log.summary() for log in logs], [log.start_ns for log in logs]
    shifts = [torque_shift(settings, fit, 1 / summary.rate) for summary in summaries]
    coefficients: dict[str, FloatArray] = {role: torque_coefficients(fit, role) for role in {log.role for log in logs}}
    torques = torque_blocks(logs, fit.shared.model, coefficients, shifts)
    write_columns(folder / "torque.parquet", torques, starts)
    durations = [summary.duration for summary in summaries]
    write_columns(folder / "information.parquet", information_blocks(fit, durations), starts)


def torque_coefficients(fit: Fit, role: str) -> FloatArray:
    """Coefficients of the model's columns for a log of that role."""
    return fit.shared.coefficients(fit.values, role == "loaded")[: len(fit.shared.model.names)]


def torque_shift(settings: Settings, fit: Fit, dt: float) -> float:
    """Time in s after which a logged torque acts, with the delay of the fit where it has one."""
    found = float(fit.values[fit.names.index("delay")]) if "delay" in fit.names else None
    return settings.torque_shift(dt, found)
