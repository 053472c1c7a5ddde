"""Time series in a result's folder, read back with pyarrow and compared with numbers worked out by
hand.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.signal import butter, filtfilt

from algid.arm import FloatArray, with_payload
from algid.estimators.combine import LogInformation
from algid.estimators.innovations import residual_sums
from algid.estimators.paper import PaperSeries
from algid.estimators.prediction import score
from algid.identification import series
from algid.identification.by_likelihood import Fitted
from algid.identification.open_logs import open_source
from algid.identification.recordings import Recordings
from algid.identification.series import (
    START_KEY,
    information_blocks,
    innovation_rows,
    scored_blocks,
    series_blocks,
    torque_blocks,
    torque_coefficients,
    torque_shift,
    write_columns,
    write_fit_series,
)
from algid.log import Log, Origin
from algid.model import Model
from algid.settings import Settings
from algid.signals.shift import AT_ONCE, TorqueShift
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from tests.identification.fits import CASE, K, fit_of

DT = 2e-3
LOADED_K = with_payload(K, CASE.arm.payload_constants(CASE.payload))


def moved(
    k: FloatArray, seed: int, lead: int = 0, start_ns: int = 7_000_000_000
) -> tuple[Log, FloatArray]:
    """Four seconds without noise, its torque logged `lead` samples early, and the true velocities
    (2, N).
    """
    t = DT * np.arange(2001)
    motion = simulate(k, wide_multi_sine(CASE.arm, seed), t)
    rows = t.size - lead
    tau = motion.tau[:, lead:]
    stamps = start_ns + np.rint(t[:rows] * 1e9).astype(np.int64)
    return Log(stamps, motion.theta[:, :rows], tau, Origin(f"{seed}.csv", "csv", {})), motion.omega[
        :, :rows
    ]


@pytest.fixture(scope="module")
def both() -> tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]]:
    return moved(K, 3), moved(LOADED_K, 4, start_ns=90_000_000_000)


def test_blocks_become_one_file_with_the_first_stamps_beside_them(tmp_path: Path) -> None:
    def blocks() -> Iterator[dict[str, object]]:
        yield {
            "log": np.array([0, 0], dtype=np.int32),
            "t": np.array([0.0, 0.5]),
            "kind": ["a", "b"],
        }
        yield {"log": np.array([1], dtype=np.int32), "t": np.array([np.nan]), "kind": ["c"]}

    write_columns(tmp_path / "some.parquet", blocks(), [5, 1_700_000_000_123_456_789])
    table = pq.read_table(tmp_path / "some.parquet")
    assert table["log"].to_pylist() == [0, 0, 1]
    assert table["t"].to_pylist()[:2] == [0.0, 0.5]
    assert np.isnan(table["t"].to_pylist()[2])
    assert table["kind"].to_pylist() == ["a", "b", "c"]
    assert json.loads(table.schema.metadata[START_KEY]) == [5, 1_700_000_000_123_456_789]
    assert (
        pq.ParquetFile(tmp_path / "some.parquet").metadata.row_group(0).column(1).compression
        == "ZSTD"
    )


def test_a_block_that_fails_leaves_a_file_that_is_closed(tmp_path: Path) -> None:
    def blocks() -> Iterator[dict[str, object]]:
        yield {"t": np.array([1.0])}
        raise RuntimeError("the log broke off")

    with pytest.raises(RuntimeError, match="broke off"):
        write_columns(tmp_path / "some.parquet", blocks(), [0])
    assert pq.read_table(tmp_path / "some.parquet")["t"].to_pylist() == [1.0]


@pytest.mark.parametrize(("rows", "sizes"), [(1, [2, 3, 4]), (5, [5, 4]), (100, [9])])
def test_windows_are_gathered_into_blocks_of_so_many_rows(
    rows: int, sizes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(series, "ROWS", rows)
    windows, first = [], 0
    for n in (2, 3, 4):
        t = np.arange(first, first + n, dtype=np.float64)
        windows.append(PaperSeries(t, np.stack([t + 0.1, -t]), n))
        first += n
    found = list(series_blocks(windows, ["k1", "k2"]))
    assert [block["t"].size for block in found] == sizes
    assert list(found[0]) == ["t", "k1", "k2"]
    np.testing.assert_array_equal(np.concatenate([block["k2"] for block in found]), -np.arange(9.0))
    np.testing.assert_array_equal(
        np.concatenate([block["k1"] for block in found]), np.arange(9.0) + 0.1
    )
    assert list(series_blocks([], ["k1"])) == []


def test_the_predicted_torque_is_that_of_the_equation_of_motion(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]],
) -> None:
    """Of noiseless logs the prediction is the torque itself wherever the smoother does not reach
    over an end.
    """
    survey = Recordings([open_source(both[0][0], "unloaded"), open_source(both[1][0], "loaded")])
    blocks = list(torque_blocks(survey, Model(), {"unloaded": K, "loaded": LOADED_K}, AT_ONCE))
    for number, (log, omega) in enumerate(both):
        own = [block for block in blocks if block["log"][0] == number]
        column = {name: np.concatenate([block[name] for block in own]) for name in own[0]}
        assert column["log"].dtype == np.int32
        np.testing.assert_allclose(column["t"], log.t, atol=1e-12)
        for joint in range(2):
            np.testing.assert_array_equal(column[f"theta{joint + 1}"], log.theta[joint])
            np.testing.assert_array_equal(column[f"tau{joint + 1}"], log.tau[joint])
            speed = np.sqrt(np.mean(omega[joint] ** 2))
            # smoothed at 40 Hz and by differences of second order: (2π f dt)²/6 of motion up to 8
            # Hz
            np.testing.assert_allclose(
                column[f"omega{joint + 1}"][50:-50], omega[joint, 50:-50], atol=5e-3 * speed
            )
            known = column[f"tau{joint + 1}_predicted"]
            inner = ~np.isnan(known)
            assert 0.9 * known.size < inner.sum() < known.size
            assert not inner[0]
            assert not inner[-1]
            assert (
                np.flatnonzero(~inner[: known.size // 2]).size
                == np.flatnonzero(~inner[known.size // 2 :]).size
            )
            off = known[inner] - log.tau[joint, inner]
            assert np.sqrt(np.mean(off**2)) < 0.02 * np.sqrt(np.mean(log.tau[joint] ** 2))


def test_a_torque_that_is_logged_early_is_shown_where_it_was_logged(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]],
) -> None:
    early, _ = moved(K, 3, lead=5)
    survey = Recordings([open_source(early, "unloaded")])
    known, wrong = (
        np.concatenate(
            [
                b["tau1_predicted"]
                for b in torque_blocks(survey, Model(), {"unloaded": K}, TorqueShift(delay=s))
            ]
        )
        for s in (5 * DT, 0.0)
    )
    rms = [np.sqrt(np.nanmean((one - early.tau[0]) ** 2)) for one in (known, wrong)]
    assert rms[0] < 0.2 * rms[1]
    assert len(both[0][0]) == len(early) + 5


def test_a_stretch_of_a_few_samples_has_no_prediction(
    both: tuple[tuple[Log, FloatArray], object],
) -> None:
    (block,) = torque_blocks(
        Recordings([open_source(both[0][0].part(0, 15), "unloaded")]),
        Model(),
        {"unloaded": K},
        AT_ONCE,
    )
    assert np.isnan(block["tau1_predicted"]).all()
    assert np.isnan(block["omega2"]).all()
    assert block["theta1"].tolist() == both[0][0].theta[0, :15].tolist()


def test_noise_narrows_what_is_shown_of_the_torque(
    both: tuple[tuple[Log, FloatArray], object],
) -> None:
    """White noise of σ has σ √(2 dt B/5) (2π B)² of acceleration below B.

    Its inertia torque stays below 5 %.
    """
    log = both[0][0]
    sigma = 3e-3
    noise = np.random.default_rng(0).normal(0, sigma, log.theta.shape)
    survey = Recordings([open_source(replace(log, theta=log.theta + noise), "unloaded")])
    (block,) = torque_blocks(survey, Model(), {"unloaded": K}, AT_ONCE)
    band = []
    for inertia, tau in zip((K[4] + K[2] + 2 * K[0], K[2]), log.tau, strict=True):
        allowed = 0.05 * np.sqrt(np.mean(tau**2))
        band.append((allowed / (inertia * sigma * np.sqrt(0.4 * DT) * (2 * np.pi) ** 2)) ** 0.4)
    assert 4 < min(band) < 25  # neither end of the range
    reach = np.flatnonzero(~np.isnan(block["tau1_predicted"]))[0]
    # half a kernel is 2.5 periods; σ is estimated
    assert reach == pytest.approx(2.5 / (min(band) * DT), rel=0.1)


def test_information_is_added_up_by_second_and_carried_to_the_shared_parameters() -> None:
    """Eight stretches in four seconds, two a second, of a loaded log: JᵀSJ with dz/dm_p by hand."""
    fit = fit_of()
    size = 7
    scale = np.arange(1.0, 9.0)
    unloaded = LogInformation(False, K, scale[:, None, None] * np.eye(size), np.zeros((8, size)))
    loaded = replace(unloaded, loaded=True, S=2 * unloaded.S)
    first, second = information_blocks(replace(fit, logs=(unloaded, loaded)), [4.0, 8.0])
    assert list(first)[:3] == ["log", "t", "k1"]
    assert first["t"].tolist() == [0, 1, 2, 3]
    assert first["k5"].tolist() == [3, 7, 11, 15]
    assert first["m_p"].tolist() == [0, 0, 0, 0]
    assert second["log"].tolist() == [1] * 8
    assert second["k5"].tolist() == (2 * scale).tolist()
    l1, l2, g = CASE.arm.l1, CASE.arm.l2, 9.81
    slope = np.array([l1**2, l2**2, l1 * l2, g * l1, g * l2])
    np.testing.assert_allclose(second["m_p"], 2 * scale * (slope @ slope), rtol=1e-12)


def test_coefficients_of_a_loaded_log_hold_the_payload_and_no_delay() -> None:
    fit = fit_of()
    np.testing.assert_array_equal(torque_coefficients(fit, "unloaded"), K)
    np.testing.assert_allclose(torque_coefficients(fit, "loaded"), LOADED_K, rtol=1e-12)
    delayed = fit_of()
    shared = replace(delayed.shared, delay=True)
    values = np.insert(delayed.values, 7, 0.003)
    with_delay = replace(
        delayed,
        shared=shared,
        values=values,
        covariance=np.eye(values.size),
        status=tuple("OK" for _ in values),
    )
    assert torque_coefficients(with_delay, "loaded").size == 7
    assert torque_shift(Settings(torque_hold="zoh"), with_delay).at(0.01) == pytest.approx(0.008)
    assert torque_shift(Settings(delay=0.002), fit).at(0.01) == 0.002


def test_a_fits_series_stand_in_its_folder(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]], tmp_path: Path
) -> None:
    survey = Recordings([open_source(both[0][0], "unloaded"), open_source(both[1][0], "loaded")])
    fit = fit_of()
    # torques beside it
    residual = residual_sums(np.random.default_rng(0).standard_normal((4, 4000)), DT)
    write_fit_series(tmp_path, Fitted(fit, survey), residual)
    names = [
        "information.parquet",
        "innovations.parquet",
        "running.parquet",
        "scored.parquet",
        "torque.parquet",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    for name in names:
        assert json.loads(pq.read_schema(tmp_path / name).metadata[START_KEY]) == [
            7_000_000_000,
            90_000_000_000,
        ]
    scored = pq.read_table(tmp_path / "scored.parquet").to_pydict()
    assert set(scored["log"]) == {0, 1}
    assert min(scored["t"]) == pytest.approx(0.3, abs=0.05)  # what is dropped at the ends
    assert max(scored["t"]) == pytest.approx(3.7, abs=0.05)
    assert len(scored["t"]) < 2 * 3.4 * 70  # 50 Hz tell all that lies below 5 Hz
    torques = pq.read_table(tmp_path / "torque.parquet")
    assert torques.num_rows == 2 * 2001
    running = pq.read_table(tmp_path / "running.parquet").to_pydict()
    last = {name: values[-1] for name, values in running.items()}
    assert last["log"] == 1
    assert last["t"] == pytest.approx(4.0, rel=1e-9)
    for name, value in zip(fit.names, fit.values, strict=True):
        assert last[name] == pytest.approx(value, rel=1e-6)  # all logs are in by then
    assert set(running) == {"log", "t", *fit.names, *(f"{name}_half" for name in fit.names)}


def test_the_torque_in_the_file_is_the_one_that_is_scored(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]],
) -> None:
    """Its residual's RMS is the score's, which a regressor made on another way.

    a wrong arm leaves one.
    """
    survey = Recordings([open_source(both[0][0], "unloaded")])
    wrong = K * np.array([1, 1, 1.1, 0.9, 1, 1, 1.05])
    (block,) = scored_blocks(survey, Model(), {"unloaded": wrong}, AT_ONCE)
    found = score(Model(), wrong, survey.segments(survey.logs[0]))
    for joint in (1, 2):
        residual = block[f"tau{joint}"] - block[f"tau{joint}_predicted"]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(found.rmse[joint - 1], rel=0.02)
        spectrum = np.abs(np.fft.rfft(block[f"tau{joint}"] * np.hanning(block["t"].size))) ** 2
        frequency = np.fft.rfftfreq(block["t"].size, float(np.diff(block["t"]).mean()))
        assert spectrum[frequency > 10].sum() < 1e-3 * spectrum.sum()
    tau, t = both[0][0].tau, DT * np.arange(2001)
    slow = filtfilt(*butter(3, 5.0, fs=1 / DT), tau, axis=1)  # of another library
    np.testing.assert_allclose(
        block["tau1"], np.interp(block["t"], t, slow[0]), atol=0.01 * np.abs(tau).max()
    )


def test_a_fit_held_within_bounds_or_of_fewer_logs_lacks_what_it_cannot_tell(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]], tmp_path: Path
) -> None:
    survey = Recordings([open_source(both[0][0], "unloaded"), open_source(both[1][0], "loaded")])
    fit = fit_of()
    write_fit_series(tmp_path, Fitted(replace(fit, logs=fit.logs[:1]), survey), None)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scored.parquet", "torque.parquet"]


def test_innovations_of_white_noise_lie_in_their_band() -> None:
    """A whitened residual: every frequency and lag a row, shares of white noise about one."""
    residual = residual_sums(np.random.default_rng(1).standard_normal((2, 20_000)), DT)
    rows = list(innovation_rows(residual, whitened=True))
    assert [(block["quantity"][0], block["joint"][0]) for block in rows] == [  # type: ignore[index]
        ("whitened spectrum", 1),
        ("whitened spectrum", 2),
        ("autocorrelation", 1),
        ("autocorrelation", 2),
    ]
    for block in rows:
        value, low, high = (np.asarray(block[name]) for name in ("value", "low", "high"))
        kept = np.isfinite(value)
        inside = np.mean((low <= value)[kept] & (value <= high)[kept])
        assert inside > 0.85  # of 40 to 100 bins, 95 % each
    lags = np.asarray(rows[2]["x"])
    assert np.diff(lags) == pytest.approx(DT)
    np.testing.assert_array_equal(np.asarray(rows[2]["low"]), -np.asarray(rows[2]["high"]))
