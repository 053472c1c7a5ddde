"""Files of NumPy, SciPy, Arrow and LeRobot's layout: written by those libraries, read without a
word about them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log

ROWS = 500
T = np.arange(ROWS) * 1e-3
THETA = np.stack([np.sin(3 * T), np.cos(4 * T)])
TAU = np.stack([5 * np.cos(2 * T), np.sin(7 * T)])


def right(log: Log, stamp_tolerance: int = 1) -> bool:
    stamps = np.abs(log.stamp_ns - np.rint(T * 1e9).astype(np.int64)).max() <= stamp_tolerance
    return bool(
        stamps and np.allclose(log.theta, THETA, rtol=1e-6) and np.allclose(log.tau, TAU, rtol=1e-6)
    )


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
