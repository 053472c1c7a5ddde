"""Time series in a result's folder, read back with pyarrow and compared with numbers worked out by
hand.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.signal import butter, filtfilt

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation
from algid.estimators.innovations import residual_sums
from algid.estimators.prediction import score
from algid.identification.by_likelihood import Fitted
from algid.identification.recordings import Recordings, open_source
from algid.identification.series import (
    START_KEY,
    Predictor,
    information_blocks,
    scored_blocks,
    torque_blocks,
    write_fit_series,
)
from algid.identification.validate import prediction
from algid.log import Log, Origin
from algid.model import Model
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from tests.identification.fits import CASE, K, fit_of

DT = 2e-3
LOADED_K = CASE.arm.constants(CASE.payload)


def moved(k: FloatArray, seed: int, start_ns: int = 7_000_000_000) -> tuple[Log, FloatArray]:
    """Four seconds without noise, and the true velocities (2, N)."""
    t = DT * np.arange(2001)
    motion = simulate(k, wide_multi_sine(CASE.arm, seed), t)
    stamps = start_ns + np.rint(t * 1e9).astype(np.int64)
    return Log(stamps, motion.theta, motion.tau, Origin(f"{seed}.csv", "csv", {})), motion.omega


@pytest.fixture(scope="module")
def both() -> tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]]:
    return moved(K, 3), moved(LOADED_K, 4, start_ns=90_000_000_000)


def test_the_predicted_torque_is_that_of_the_equation_of_motion(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]],
) -> None:
    """Of noiseless logs the prediction is the torque itself wherever the smoother does not reach
    over an end.
    """
    survey = Recordings([open_source(both[0][0], "unloaded"), open_source(both[1][0], "loaded")])
    blocks = list(
        torque_blocks(survey, Predictor(Model(), {"unloaded": K, "loaded": LOADED_K}.__getitem__))
    )
    for number, (log, omega) in enumerate(both):
        own = [block for block in blocks if block["log"][0] == number]
        column = {name: np.concatenate([block[name] for block in own]) for name in own[0]}
        assert column["log"].dtype == np.int32
        np.testing.assert_allclose(column["t"], log.t, atol=1e-12)
        theta, tau, seen, predicted = (
            np.stack([column[name.format(joint)] for joint in (1, 2)])
            for name in ("theta{}", "tau{}", "omega{}", "tau{}_predicted")
        )
        np.testing.assert_array_equal(theta, log.theta)
        np.testing.assert_array_equal(tau, log.tau)
        # smoothed at 40 Hz and by differences of second order: (2π f dt)²/6 of motion up to 8 Hz
        missed = np.abs(seen - omega)[:, 50:-50].max(axis=1)
        assert np.all(missed < 5e-3 * omega.std(axis=1))
        left = len(log) - np.count_nonzero(np.isfinite(predicted[0]))
        assert 2 <= left < 0.1 * len(log)
        inner = slice(left // 2, -(left // 2))  # as much at either end
        assert np.all(np.isfinite(predicted[:, inner]))
        off = np.mean((predicted - log.tau)[:, inner] ** 2, axis=1)
        assert np.all(off < 0.02**2 * np.mean(log.tau**2, axis=1))


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
    shared = [pq.read_schema(tmp_path / name) for name in names if name != "innovations.parquet"]
    assert {str(one.field("log").type) for one in shared} == {"int32"}
    torques = pq.read_table(tmp_path / "torque.parquet")
    assert torques.num_rows == 2 * 2001
    running = pq.read_table(tmp_path / "running.parquet").to_pydict()
    assert (running["log"][-1], running["t"][-1]) == (1, pytest.approx(4.0, rel=1e-9))
    assert set(running) == {"log", "t", *fit.names, *(f"{name}_half" for name in fit.names)}


def test_the_torque_in_the_file_is_the_one_that_is_scored(
    both: tuple[tuple[Log, FloatArray], tuple[Log, FloatArray]],
) -> None:
    """Its residual's RMS is the score's, which a regressor made on another way.

    a wrong arm leaves one.
    """
    survey = Recordings([open_source(both[0][0], "unloaded")])
    wrong = K * np.array([1, 1, 1.1, 0.9, 1, 1, 1.05])
    (block,) = scored_blocks(survey, Predictor(Model(), lambda _: wrong))
    found = prediction(score(Model(), wrong, survey.segments(survey.logs[0])))
    for joint in (1, 2):
        residual = block[f"tau{joint}"] - block[f"tau{joint}_predicted"]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(found.rmse[joint - 1], rel=0.02)
    tau, t = both[0][0].tau, DT * np.arange(2001)
    slow = filtfilt(*butter(3, 5.0, fs=1 / DT), tau, axis=1)  # of another library
    np.testing.assert_allclose(
        block["tau1"], np.interp(block["t"], t, slow[0]), atol=0.01 * np.abs(tau).max()
    )
