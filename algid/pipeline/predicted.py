"""The torque that a model predicts along a log, for the eye: two derivatives of angles as sharp as noise allows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from algid.arm import FloatArray
from algid.identify.filters import half_length, smoothed
from algid.identify.model import Model, Motion, regressor
from algid.identify.noise import first_guess
from algid.pipeline.sources import LogSource
from algid.sampling import Segment, pieces

ROWS = 1 << 17
NOISE_SHARE = 0.05  # of the torque's RMS: what the angles' noise may add to the prediction
LOWEST, HIGHEST = 4.0, 40.0  # Hz


def torque_blocks(
    logs: Sequence[LogSource], model: Model, coefficients: Mapping[str, FloatArray], shifts: Sequence[float]
) -> Iterator[dict[str, FloatArray]]:
    """Motion, measured and predicted torque of every log; by role its coefficients, by log the torque's delay in s.

    Angles are smoothed without phase; the prediction is NaN where the smoother reaches past a stretch's end.
    """
    for number, (log, shift) in enumerate(zip(logs, shifts, strict=True)):
        for piece in pieces(log.segments(), ROWS):
            yield {
                "log": np.full(len(piece), number, dtype=np.int32),
                **_torques(piece, model, coefficients[log.role], shift),
            }


def _torques(piece: Segment, model: Model, c: FloatArray, shift: float) -> dict[str, FloatArray]:
    if len(piece) < 16:
        return _columns(piece, np.full_like(piece.theta, np.nan), np.full_like(piece.theta, np.nan))
    bandwidth = _bandwidth(piece, model, c)
    theta = smoothed(piece.theta, piece.dt, bandwidth)
    omega = np.gradient(theta, piece.dt, axis=1)
    motion = Motion(theta, omega, np.gradient(omega, piece.dt, axis=1))
    predicted = np.einsum("aqn,q->an", regressor(model, motion), c)
    predicted = np.stack([np.interp(piece.t + shift, piece.t, row) for row in predicted])
    reach = min(half_length(piece.dt, bandwidth), len(piece) // 2)
    predicted[:, :reach] = predicted[:, len(piece) - reach :] = np.nan
    return _columns(piece, omega, predicted)


def _columns(piece: Segment, omega: FloatArray, predicted: FloatArray) -> dict[str, FloatArray]:
    columns = {"theta": piece.theta, "omega": omega, "tau": piece.tau}
    flat = {f"{name}{joint + 1}": value[joint] for name, value in columns.items() for joint in range(2)}
    return {"t": piece.t, **flat, "tau1_predicted": predicted[0], "tau2_predicted": predicted[1]}


def _bandwidth(piece: Segment, model: Model, c: FloatArray) -> float:
    """Hz below which the angles' noise, twice differentiated, adds at most `NOISE_SHARE` of the torque.

    White noise σ_θ sampled at dt has σ_θ √(2 dt B/5) (2π B)² of acceleration below B; inertia makes it torque.
    """
    full = dict(zip(model.names, c, strict=True))
    inertia = np.abs([full["k5"] + full["k3"] + 2 * full["k1"], full["k3"]])
    allowed = NOISE_SHARE * np.sqrt(np.mean(piece.tau**2, axis=1))
    noise = inertia * first_guess(piece.theta, piece.tau).theta * np.sqrt(0.4 * piece.dt) * (2 * np.pi) ** 2
    sharpest = (allowed / np.maximum(noise, 1e-300)) ** 0.4
    return float(np.clip(sharpest.min(), LOWEST, min(HIGHEST, 0.1 / piece.dt)))
