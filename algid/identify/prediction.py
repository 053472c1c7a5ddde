"""Torque predicted on logs, and how good the prediction is.

Angles and torques pass the same zero-phase Butterworth filter; velocities and accelerations are central
differences of the filtered angles; both ends of every stretch, where a zero-phase filter rings, are dropped.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from algid.arm import FloatArray
from algid.identify.fit import Fit
from algid.identify.information import combine
from algid.identify.model import Model, Motion, regressor
from algid.identify.weak import Source
from algid.sampling import Segment, pieces

_PIECE_SECONDS = 60.0


@dataclass(frozen=True)
class PredictionFilter:
    """Zero-phase Butterworth filter of `order` and `cutoff` Hz; `dropped` s are left out at each end."""

    order: int = 3
    cutoff: float = 5.0
    dropped: float = 0.3

    def __str__(self) -> str:
        return f"zero-phase Butterworth, order {self.order}, {self.cutoff:g} Hz, {self.dropped:g} s dropped at each end"


@dataclass(frozen=True, eq=False)
class PredictionScore:
    """Sums by joint (2,): samples, squared residuals, torque, squared torque."""

    count: float = 0.0
    residual: FloatArray = field(default_factory=lambda: np.zeros(2))
    torque: FloatArray = field(default_factory=lambda: np.zeros(2))
    square: FloatArray = field(default_factory=lambda: np.zeros(2))

    def __add__(self, other: PredictionScore) -> PredictionScore:
        return PredictionScore(
            self.count + other.count,
            self.residual + other.residual,
            self.torque + other.torque,
            self.square + other.square,
        )

    @property
    def rmse(self) -> FloatArray:
        """Root mean square of the residual (2,) in N m."""
        return np.sqrt(self.residual / max(self.count, 1.0))

    @property
    def nrmse(self) -> FloatArray:
        """RMSE over the torque's root mean square (2,)."""
        return np.sqrt(self.residual / np.maximum(self.square, 1e-300))

    @property
    def r2(self) -> FloatArray:
        """Share of the torque's variance that is predicted (2,)."""
        spread = self.square - self.torque**2 / max(self.count, 1.0)
        return 1 - self.residual / np.maximum(spread, 1e-300)


def predicted(
    model: Model, c: FloatArray, segments: Iterable[Segment], shift: float = 0.0, by: PredictionFilter | None = None
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Time (n,) in s, predicted and measured torque (2, n) in N m, both filtered, stretch by stretch.

    Parameters
    ----------
    model, c : Model and its coefficients (q,)
    segments : iterable of Segment
    shift : float, s
        After how long a logged torque acts: hold and delay together.
    by : PredictionFilter
    """
    from scipy.signal import butter, sosfiltfilt

    by = by or PredictionFilter()
    for segment in segments:
        for piece in pieces([segment], max(1, round(_PIECE_SECONDS / segment.dt))):
            edge = round(by.dropped / piece.dt)
            if len(piece) <= max(2 * edge + 2, 6 * (by.order + 1)):
                continue
            sections = butter(by.order, min(by.cutoff, 0.45 / piece.dt), fs=1 / piece.dt, output="sos")
            theta, tau = sosfiltfilt(sections, np.stack([piece.theta, piece.tau]), axis=-1)
            omega = np.gradient(theta, piece.dt, axis=1)
            motion = Motion(theta, omega, np.gradient(omega, piece.dt, axis=1))
            torque = np.einsum("aqn,q->an", regressor(model, motion), c)
            acts = piece.t + shift
            torque = np.stack([np.interp(acts, piece.t, row) for row in torque])
            inner = slice(edge, len(piece) - edge)
            yield piece.t[inner], torque[:, inner], tau[:, inner]


def score(
    model: Model, c: FloatArray, segments: Iterable[Segment], shift: float = 0.0, by: PredictionFilter | None = None
) -> PredictionScore:
    """How well the coefficients `c` (q,) predict a log's torque; see `predicted`."""
    total = PredictionScore()
    for _, torque, tau in predicted(model, c, segments, shift, by):
        total += PredictionScore(
            float(tau.shape[1]),
            np.sum((tau - torque) ** 2, axis=1),
            np.sum(tau, axis=1),
            np.sum(tau**2, axis=1),
        )
    return total


def cross_validate(
    fit: Fit, unloaded: Sequence[Source], loaded: Sequence[Source] = (), shift: float = 0.0
) -> PredictionScore | None:
    """Score of each log predicted from all the others; None where a kind of log has only one.

    The other logs' parameters follow from their quadratic likelihoods, without a further pass; only the
    prediction reads the logs again.
    """
    sources = [*unloaded, *loaded]
    if len(sources) != len(fit.logs) or len(unloaded) == 1 or len(loaded) == 1:
        return None
    total = PredictionScore()
    columns = len(fit.shared.model.names)
    for place, (source, log) in enumerate(zip(sources, fit.logs, strict=True)):
        others = [other for number, other in enumerate(fit.logs) if number != place]
        beta, _, _ = combine(fit.shared, others, fit.values, fit.prior)
        c = fit.shared.coefficients(beta, log.loaded)
        total += score(fit.shared.model, c[:columns], source(), shift + float(c[columns:].sum()))
    return total
