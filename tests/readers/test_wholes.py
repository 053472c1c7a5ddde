"""Formats that are read as a whole: JSON lines, HDF5, and MATLAB files that fit nothing."""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from algid.base.errors import LogError
from algid.inspection.checks import inspect_log
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log

LOG = noise_log(60, start_ns=EPOCH_NS)
OMEGA = LOG.omega


def lines(folder: Path, row: int = 0, change: Callable[[str], str] = str) -> Path:
    """A line a sample, as a driver of motors writes them, one of them changed."""
    kept = []
    for t, theta, omega, tau in zip(LOG.t, LOG.theta.T, OMEGA.T, LOG.tau.T, strict=True):
        joints = [
            {"q": q, "dq": dq, "tau_est": torque}
            for q, dq, torque in zip(theta, omega, tau, strict=True)
        ]
        kept.append(json.dumps({"t": t, "mode": "run", "motor_state": joints}))
    kept[row] = change(kept[row])
    (folder / "a.jsonl").write_text("\n".join(kept))
    return folder / "a.jsonl"


@pytest.mark.parametrize(
    "wrong", ['{"t": 1, "motor_state": [', "[1, 2]", "nan", '{"t": 1,}', '{"t": NaN}']
)
def test_a_line_that_is_no_object_is_refused_with_its_number(wrong: str, tmp_path: Path) -> None:
    path = lines(tmp_path, 30, lambda _: wrong)
    with pytest.raises(LogError, match=r"a\.jsonl: line 31: expected a JSON object in every line"):
        read_log(path)


@pytest.mark.parametrize(("opened", "closed"), [("[", "]"), ('{"a":', "}")])
def test_lines_that_lie_deep_within_themselves_are_refused(
    opened: str, closed: str, tmp_path: Path
) -> None:
    """polars takes minutes for a thousand lists within one another."""
    for depth in (7, 8, 1000, 100_000):
        nested = f'"x": {opened * depth}1{closed * depth}'
        path = lines(tmp_path, 30, lambda line, more=nested: f"{line[:-1]}, {more}}}")  # type: ignore[misc]
        if depth > 7:
            with pytest.raises(LogError, match=r"a\.jsonl: lists and objects within"):
                read_log(path)
        else:
            assert len(read_log(path)) == 60


def test_an_array_that_stands_twice_in_an_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, t=LOG.t, theta=LOG.theta.T, tau=LOG.tau.T)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("tau.npy", b"")
    with pytest.raises(LogError, match=r"a\.npz: the array 'tau\.npy' stands in the archive twice"):
        read_log(path)


def written_hdf5(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        group = file.create_group("arm/state")
        group["q"], group["tau"] = LOG.theta.T, LOG.tau.T
        file["time"] = LOG.t
        file["note"] = "a text"
        file["picture"] = np.zeros((4, 5, 6))
        file["gains"] = np.eye(3)
        file["same"] = h5py.SoftLink("/time")
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/time")
    return path


def test_the_arrays_of_hdf5_are_listed(tmp_path: Path) -> None:
    found = inspect_log(written_hdf5(tmp_path / "a.dat"))
    assert found.format == "hdf5"
    assert {entry.name for entry in found.entries} == {
        "q[0]",
        "q[1]",
        "tau[0]",
        "tau[1]",
        "time",
        "gains (3 × 3)",
    }


def test_matlab_7_3_is_hdf5_behind_a_head(tmp_path: Path) -> None:
    """MATLAB writes matrices by columns: two joints are two rows there."""
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["q"], file["tau"], file["t"] = LOG.theta, LOG.tau, LOG.t[None, :]
        file.create_group("#refs#")["a"] = np.arange(1000.0)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
    content = path.read_bytes()
    path.write_bytes(head + content[len(head) :])
    log = read_log(path)
    assert np.array_equal(log.theta, LOG.theta)
    assert np.array_equal(log.tau, LOG.tau)


def test_hdf5_without_its_package_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written_hdf5(tmp_path / "a.h5")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(
        LogError, match=r"an HDF5 file, for which h5py is needed: pip install 'algid\[hdf5\]'"
    ):
        read_log(path)


def test_hdf5_that_leads_elsewhere_is_refused(tmp_path: Path) -> None:
    layout = h5py.VirtualLayout(shape=(60,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "b.h5"), "t", shape=(60,))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_virtual_dataset("t", layout)
    with pytest.raises(LogError, match="no arrays of two samples or more; found nothing"):
        read_log(tmp_path / "a.h5")


@pytest.mark.parametrize("chunks", [None, 30])
def test_hdf5_of_which_a_part_is_missing_is_refused(tmp_path: Path, chunks: int | None) -> None:
    """HDF5 fills up with zeros what was never written; an array cut short keeps its bytes."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, values in {"t": LOG.t, "q": LOG.theta.T}.items():
            file[name] = values
        tau = file.create_dataset("tau", (60, 2), "f8", chunks=chunks and (chunks, 2))
        if chunks:
            tau[:30] = LOG.tau.T[:30]
    with pytest.raises(LogError, match=r"'tau' has (0 of 960 bytes|1 of 2 chunks)"):
        read_log(path)


def test_a_matlab_file_whose_matrices_fit_nothing_says_what_it_holds(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"A": np.eye(80), "q": np.ones((50, 2)), "t": np.arange(200.0)})
    shapes = [r"A \(80 × 80\)", r"q \(50 × 2\)"]
    words = f"no column for theta1, .* the log also holds, of another length: {', '.join(shapes)}"
    with pytest.raises(LogError, match=words):
        read_log(path)
    found = [entry.name for entry in inspect_log(path).entries]
    assert found == ["t", *(one.replace("\\", "") for one in shapes)]


def test_a_matrix_of_everything_is_read_by_places(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"data": np.column_stack([LOG.t, *LOG.theta, *LOG.tau])})
    with pytest.raises(LogError, match=r"found 'data\[0\]', 'data\[1\]', .*--set theta1.source="):
        read_log(path)
    names = ("theta1", "theta2", "tau1", "tau2")
    places = {name: {"source": f"data[{n}]"} for n, name in enumerate(names, start=1)}
    named = Profile.model_validate({"time": "data[0]", **places})
    assert np.array_equal(read_log(path, named).tau, LOG.tau)


def test_cells_texts_and_other_variables_are_passed_over(tmp_path: Path) -> None:
    others = {
        "cells": np.array([1, "x", LOG.t], object),
        "text": "arm",
        "empty": np.empty(0),
        "flag": True,
        "z": 1j * LOG.t,
    }
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"t": LOG.t, "q": LOG.theta.T, "tau": LOG.tau.T, **others})
    log = read_log(path)
    assert np.array_equal(log.theta, LOG.theta)
    assert np.array_equal(log.tau, LOG.tau)
