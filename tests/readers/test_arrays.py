"""Files of NumPy, SciPy, Arrow and LeRobot's layout: written by those libraries, read without a
word about them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pytest
from click.testing import CliRunner
from pyarrow import feather, parquet
from scipy.io import savemat

from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from tests.cli.commands import app

ROWS = 500
T = np.arange(ROWS) * 1e-3
THETA = np.stack([np.sin(3 * T), np.cos(4 * T)])
TAU = np.stack([5 * np.cos(2 * T), np.sin(7 * T)])


def right(log: Log, stamp_tolerance: int = 1) -> bool:
    stamps = np.abs(log.stamp_ns - np.rint(T * 1e9).astype(np.int64)).max() <= stamp_tolerance
    return bool(
        stamps and np.allclose(log.theta, THETA, rtol=1e-6) and np.allclose(log.tau, TAU, rtol=1e-6)
    )


def npz(folder: Path) -> Path:
    np.savez(folder / "log.npz", t=T, q=THETA.T, tau=TAU.T, note=np.array("unused"), rate=1000.0)
    return folder / "log.npz"


def npz_packed(folder: Path) -> Path:
    columns = {"time": T, "q1": THETA[0], "q2": THETA[1], "tau1": TAU[0], "tau2": TAU[1]}
    np.savez_compressed(folder / "log.npz", **columns)
    return folder / "log.npz"


def npz_upright(folder: Path) -> Path:
    np.savez(folder / "log.npz", t=T, q=THETA.astype(">f8"), tau=TAU)
    return folder / "log.npz"


def mat(folder: Path) -> Path:
    savemat(folder / "log.mat", {"t": T, "q": THETA.T, "tau": TAU.T, "comment": "arm 7"})
    return folder / "log.mat"


def mat_struct(folder: Path) -> Path:
    savemat(
        folder / "log.mat",
        {"run": {"time": T[:, None], "signals": {"pos": THETA, "torque": TAU}}},
        do_compression=True,
    )
    return folder / "log.mat"


def feather_flat(folder: Path) -> Path:
    columns = {"time": T, "q1": THETA[0], "q2": THETA[1], "tau1": TAU[0], "tau2": TAU[1]}
    feather.write_feather(pa.table(columns), str(folder / "log.feather"), compression="zstd")
    return folder / "log.feather"


def feather_lists(folder: Path) -> Path:
    stamps = pa.array(np.rint(T * 1e9).astype(np.int64), pa.timestamp("ns"))
    columns = {
        "timestamp": stamps,
        "position": pa.array(THETA.T.tolist()),
        "effort": pa.array(TAU.T.tolist()),
    }
    with (
        pa.OSFile(str(folder / "log.arrow"), "wb") as sink,
        pa.ipc.new_file(sink, pa.table(columns).schema) as file,
    ):
        file.write_table(pa.table(columns))
    return folder / "log.arrow"


def lerobot(folder: Path) -> Path:
    """An episode as LeRobot's data sets hold it: fixed-size lists, float32 seconds, indexes."""
    lists = pa.list_(pa.float32(), 2)
    columns = {
        "observation.state": pa.array(THETA.T.astype(np.float32).tolist(), lists),
        "observation.effort": pa.array(TAU.T.astype(np.float32).tolist(), lists),
        "action": pa.array(THETA.T.astype(np.float32).tolist(), lists),
        "timestamp": pa.array(T.astype(np.float32)),
        "frame_index": pa.array(np.arange(ROWS)),
        "episode_index": pa.array(np.zeros(ROWS, np.int64)),
        "index": pa.array(np.arange(ROWS)),
        "task_index": pa.array(np.zeros(ROWS, np.int64)),
    }
    parquet.write_table(pa.table(columns), folder / "episode_000000.parquet")
    return folder / "episode_000000.parquet"


MADE = [npz, npz_packed, npz_upright, mat, mat_struct, feather_flat, feather_lists, lerobot]


@pytest.mark.parametrize("make", MADE)
def test_files_of_other_libraries_are_read(make: Callable[[Path], Path], tmp_path: Path) -> None:
    path = make(tmp_path)
    # float32 seconds below one resolve 60 ns
    assert right(read_log(path), 60 if make is lerobot else 1)
    shown = CliRunner().invoke(app, ["inspect", str(path)])
    assert shown.exit_code == 0, shown.output


@pytest.mark.parametrize("make", [npz, mat, feather_flat])
@pytest.mark.parametrize("share", [0.2, 0.9])
def test_cut_files_are_refused_in_one_line(
    make: Callable[[Path], Path], share: float, tmp_path: Path
) -> None:
    path = make(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(LogError) as refused:
        read_log(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"t": T}, "no column for theta1"),
        ({"t": np.array([object()])}, "cannot be read|can be read"),
        ({"note": np.array("no number")}, "no arrays of two samples"),
    ],
)
def test_archives_without_a_log_are_refused(
    content: dict[str, Any], words: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "log.npz", **content)
    with pytest.raises(LogError, match=words):
        read_log(tmp_path / "log.npz")


def test_more_joints_of_a_matrix_are_chosen_by_number(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "log.npz", t=T, q=np.vstack([THETA, 0 * T]).T, tau=np.vstack([TAU, 0 * T]).T
    )
    with pytest.raises(LogError, match="3 joints"):
        read_log(tmp_path / "log.npz")
    assert right(read_log(tmp_path / "log.npz", Profile(joints=("0", "1"))))


def test_a_frame_of_polars_is_read_too(tmp_path: Path) -> None:
    pl.DataFrame(
        {"t": T, "q1": THETA[0], "q2": THETA[1], "tau1": TAU[0], "tau2": TAU[1]}
    ).write_ipc(tmp_path / "log.ipc")
    assert right(read_log(tmp_path / "log.ipc"))


def test_cells_texts_and_other_variables_are_passed_over(tmp_path: Path) -> None:
    others = {
        "cells": np.array([1, "x", T], object),
        "text": "arm",
        "empty": np.empty(0),
        "flag": True,
        "z": 1j * T,
    }
    savemat(tmp_path / "log.mat", {"t": T, "q": THETA.T, "tau": TAU.T, **others})
    assert right(read_log(tmp_path / "log.mat"))
