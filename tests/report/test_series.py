"""Series made short for drawing lose no extreme, whatever the blocks and the logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from algid.base.errors import ResultError
from algid.report import series
from algid.report.series import drawn

RATE = 100.0


def write(path: Path, rows: tuple[int, ...] = (5000, 3000), seed: int = 0) -> pl.DataFrame:
    """Torques of logs of so many rows at 100 Hz; the second one begins at 7 s."""
    rng, frames = np.random.default_rng(seed), []
    for log, count in enumerate(rows):
        t = 7.0 * log + np.arange(count) / RATE
        columns = {"log": np.full(count, log, np.int32), "t": t}
        for name in ("theta", "omega", "tau"):
            columns |= {f"{name}{joint}": rng.standard_normal(count) for joint in (1, 2)}
        columns |= {f"tau{joint}_predicted": rng.standard_normal(count) for joint in (1, 2)}
        frames.append(pl.DataFrame(columns))
    frame = pl.concat(frames)
    frame.write_parquet(path)
    return frame


@pytest.mark.parametrize("block", [317, 1 << 18])
def test_every_bucket_keeps_its_smallest_and_its_largest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    frame = write(tmp_path / "a.parquet")
    monkeypatch.setattr(series.stretches, "__defaults__", (None, block))
    short = drawn(tmp_path / "a.parquet", points=400)
    assert short is not None
    assert short["t"].size < 1.3 * 400
    for log in (0, 1):
        own = frame.filter(pl.col("log") == log)
        kept = short["tau1"][short["log"] == log]
        assert np.nanmin(kept) == own["tau1"].min()
        assert np.nanmax(kept) == own["tau1"].max()
    # a bucket of 40: its first pair is its smallest and its largest value
    if block > 8000:
        first = frame["theta2"].to_numpy()[:40]
        assert short["theta2"][:2].tolist() == [first.min(), first.max()]
        assert short["t"][:2].tolist() == [0.0, 0.39]


def test_a_gap_breaks_the_line(tmp_path: Path) -> None:
    frame = write(tmp_path / "a.parquet", (500,))
    frame.filter(~pl.col("t").is_between(1.0, 1.5)).write_parquet(tmp_path / "a.parquet")
    heard = list[tuple[str, int, int]]()
    short = drawn(tmp_path / "a.parquet", 2000, lambda *step: heard.append(step))
    assert heard == [("report", 449, 449)]
    assert short is not None
    (place,) = np.flatnonzero(np.isnan(short["tau1"]))
    assert short["x"][place] == short["x"][place - 1] == pytest.approx(0.99)
    assert short["x"][place + 1] == pytest.approx(1.51)


def test_samples_are_whole_rows_and_never_in_step_with_the_motion(tmp_path: Path) -> None:
    t = np.arange(200_000) / 1000
    angle = np.sin(2 * np.pi * t)  # a period a thousand rows; every hundredth row is kept
    columns = {"log": np.zeros(t.size), "t": t, "theta1": angle, "theta2": 3 * angle}
    pl.DataFrame(columns).write_parquet(tmp_path / "a.parquet")
    short = drawn(tmp_path / "a.parquet")
    assert short is not None
    samples = short.samples
    assert samples["t"].size == 2000
    np.testing.assert_array_equal(samples["theta2"], 3 * samples["theta1"])
    phase = np.sort(np.mod(samples["t"], 1.0))
    assert np.diff(phase).max() < 0.02
    assert np.unique(samples["t"]).size == 2000


def test_what_is_no_series_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    frame = write(path, (50,))
    frame.clear().write_parquet(path)
    with pytest.raises(ResultError, match="it holds no rows"):
        drawn(path)
