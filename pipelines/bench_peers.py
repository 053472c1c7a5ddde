"""What algid is timed against, one process a peer: `python -m pipelines.bench_peers NAME LOG`.

A peer prints the seven constants that it estimates; it reads the log with polars and filters it as
users of these tools do. `polars_processor` prints the processor seconds of reading alone.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from algid.arm import FloatArray, regressor

COLUMNS = ["stamp_ns", "theta1", "theta2", "tau1", "tau2"]
_CUTOFF = 20.0  # Hz
_WINDOW = 0.4  # s
_END = 1.0  # s, and a tenth of a log at most, at both ends: where the filter rings


def _filtered(path: Path) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Angles, velocities, accelerations and torques (2, N) after a zero-phase filter, without its
    ends, and the period in s.
    """
    import polars as pl
    from scipy.signal import butter, sosfiltfilt

    frame = pl.read_parquet(path, columns=COLUMNS)
    stamps = frame["stamp_ns"].to_numpy()
    dt = float(stamps[-1] - stamps[0]) * 1e-9 / (stamps.size - 1)
    signals = np.stack([frame[name].to_numpy() for name in COLUMNS[1:]])
    signals = sosfiltfilt(butter(4, _CUTOFF, fs=1 / dt, output="sos"), signals, axis=1)
    theta, tau = signals[:2], signals[2:]
    omega = np.gradient(theta, dt, axis=1)
    alpha = np.gradient(omega, dt, axis=1)
    end = min(round(_END / dt), theta.shape[1] // 10)
    inner = slice(end, theta.shape[1] - end)
    return theta[:, inner], omega[:, inner], alpha[:, inner], tau[:, inner], dt


def least_squares(path: Path) -> FloatArray:
    """Filtered least squares by numpy and scipy, out of its normal equations."""
    theta, omega, alpha, tau, _ = _filtered(path)
    Y = regressor(theta, omega, alpha)
    gram = Y[0] @ Y[0].T + Y[1] @ Y[1].T
    return np.asarray(np.linalg.solve(gram, Y[0] @ tau[0] + Y[1] @ tau[1]))


def pinocchio(path: Path) -> FloatArray:
    """FIGAROH's way: pinocchio's torque regressor sample by sample, viscous columns beside it,
    least squares.
    """
    import pinocchio as pin

    theta, omega, alpha, tau, _ = _filtered(path)
    model, l1 = _two_links(pin)
    data, n = model.createData(), theta.shape[1]
    W = np.zeros((2 * n, 22))
    for i in range(n):
        block = pin.computeJointTorqueRegressor(model, data, theta[:, i], omega[:, i], alpha[:, i])
        W[i, :20], W[n + i, :20] = block[0], block[1]
    W[:n, 20], W[n:, 21] = omega
    moment = W.T @ np.concatenate([tau[0], tau[1]])
    found = np.linalg.pinv(W.T @ W, rcond=1e-12, hermitian=True) @ moment
    x1, inertia1, m2, x2, inertia2 = found[[1, 9, 10, 11, 19]]
    g = 9.81
    return np.array(
        [l1 * x2, g * x2, inertia2, g * (x1 + m2 * l1), inertia1 + m2 * l1**2, found[20], found[21]]
    )


def _two_links(pin: Any) -> tuple[Any, float]:
    """The arm of case 1 in a vertical plane, and the length of its first link in m."""
    from algid.synth.cases import load_case

    l1 = load_case("case1").arm.l1
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint1")
    place = pin.SE3(np.eye(3), np.array([l1, 0.0, 0.0]))
    model.addJoint(first, pin.JointModelRZ(), place, "joint2")
    return model, l1


def pysindy(path: Path) -> FloatArray:
    """PySINDy's weak form: integrals of the columns and of the torque over windows, then least
    squares.
    """
    from pysindy import WeakPDELibrary
    from pysindy.feature_library import PolynomialLibrary

    theta, omega, alpha, tau, dt = _filtered(path)
    n = theta.shape[1]
    Y = regressor(theta, omega, alpha)
    np.random.seed(0)  # noqa: NPY002 (the library draws its windows from there)
    library = WeakPDELibrary(
        PolynomialLibrary(degree=1, include_bias=False),
        spatiotemporal_grid=dt * np.arange(n),
        K=max(20, round(n * dt / _WINDOW)),
        H_xt=_WINDOW / 2,
    )
    moments = []
    for joint in range(2):
        signals = np.concatenate([Y[joint], tau[joint][None]]).T
        library.fit([signals])
        moments.append(np.asarray(library.transform([signals])[0]))
    rows = np.concatenate(moments)
    return np.asarray(np.linalg.lstsq(rows[:, :7], rows[:, 7], rcond=None)[0])


def polars_processor(path: Path) -> float:
    """Processor seconds in which polars reads the five columns, of all its threads, once warm."""
    import polars as pl

    found = []
    for _ in range(9):
        start = time.process_time()
        pl.read_parquet(path, columns=COLUMNS)
        found.append(time.process_time() - start)
    return median(found)


PEERS: dict[str, Callable[[Path], Any]] = {
    peer.__name__: peer
    for peer in (
        least_squares,
        pinocchio,
        pysindy,
        polars_processor,
    )
}

if __name__ == "__main__":
    found = PEERS[sys.argv[1]](Path(sys.argv[2]))
    print(json.dumps(found.tolist() if isinstance(found, np.ndarray) else found))
