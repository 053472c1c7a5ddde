"""The likelihood of a log whose arm turns far from sample to sample, by `shooting`.

Nine samples follow a turn while a step of it is small: the eighth power of the angle in rad
between two samples, over 3150, is what a stencil errs by of the fastest part of an acceleration.
The joints' coupling has parts three times as fast as the joints turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators import shooting
from algid.estimators.combine import LogInformation
from algid.estimators.log_likelihood import SURE, LogEvidence
from algid.estimators.noise import VarianceScore, differences_noise
from algid.estimators.parametrisation import Shared
from algid.estimators.weak import Source
from algid.estimators.whitening import Linearised, NoiseLevels
from algid.quantiles import medians
from algid.signals.differences import Stencil
from algid.signals.segments import Segment

FAR = 0.35
"""rad from one sample to the next, beyond which an arm turns too far for differences."""
_OFTEN = 1e-3
"""Share of the samples that a joint turns that far."""
_FIRST_ANGLES = 3e-3  # of the angle between two samples
_FIRST_TORQUES = 0.1  # of the torque
_ORDERS = (8, 10)
_ALIKE = 0.1
"""Of two orders of differences of a torque: they hold nothing but noise where their levels agree
to this share."""
_FALLING = 0.9  # a torque's error that a step makes smaller than this share of it is not settled


def turns_far(pieces: Iterable[Segment]) -> bool:
    """Whether a joint often turns `FAR` from sample to sample."""
    far = total = 0
    for piece in pieces:
        steps = np.abs(np.diff(piece.theta, axis=1)).max(axis=0)
        far, total = far + int(np.count_nonzero(steps > FAR)), total + steps.size
    return far > _OFTEN * total


class CoarseEvidence(LogEvidence):
    """One log of which the arm turns far between samples: see `LogEvidence`."""

    def __init__(
        self,
        source: Source,
        loaded: bool,
        shared: Shared,
        stencil: Callable[[float, FloatArray], Stencil],
        known: NoiseLevels | None,
    ) -> None:
        super().__init__(source, loaded, shared, stencil, known)
        self._falling = np.ones(2, dtype=bool)
        self._beginnings: dict[Segment, FloatArray] = {}

    def _first_trajectory(self, piece: Segment) -> FloatArray:
        return np.array(piece.theta)

    def _first_noise(self, _: NoiseLevels) -> NoiseLevels:
        angles = [np.mean(np.diff(piece.theta, axis=1) ** 2, axis=1) for piece in self.kept]
        torques = [np.mean(piece.tau**2, axis=1) for piece in self.kept]
        theta = _FIRST_ANGLES * np.sqrt(np.max(angles, axis=0))
        tau = _FIRST_TORQUES * np.sqrt(np.max(torques, axis=0))
        # a joint that stands, or has no motor, has the other's size
        return NoiseLevels(np.maximum(theta, 0.1 * theta.max()), np.maximum(tau, 0.1 * tau.max()))

    def _least_noise(self, floor: NoiseLevels, _: NoiseLevels) -> NoiseLevels:
        levels = []
        for order in _ORDERS:
            found = [differences_noise(piece.tau, order) for piece in self.kept]
            levels.append(medians(np.transpose(found)))
        # else what the samples of a fast torque differ by is the torque
        settled = np.abs(levels[0] - levels[1]) < _ALIKE * levels[1]
        return replace(
            floor, tau=np.where(settled, np.maximum(floor.tau, SURE * levels[1]), floor.tau)
        )

    @property
    def refuted(self) -> bool:
        """Whether the torque's error stays far above what neighbouring samples differ by."""
        return super().refuted and not bool(np.any(self._falling))

    def _improve_noise(self, score: VarianceScore, information: LogInformation) -> FloatArray:
        before = self.noise.tau
        step = super()._improve_noise(score, information)
        self._falling = self.noise.tau < _FALLING * before
        return step

    def _linearise(
        self,
        c: FloatArray,
        theta: FloatArray,
        piece: Segment,
        shared: Shared | None = None,
        *,
        residual_only: bool = False,
    ) -> Linearised:
        shared = self._shared if shared is None else shared
        found = shooting.linearise(
            shared.model,
            c[: len(shared.model.names)],
            theta,
            piece,
            self._stencil(piece.dt, c),
            self.noise,
            shared.delay,
            residual_only=residual_only,
            beginning=self._beginnings.get(piece),
        )
        if piece in self.kept:
            self._beginnings[piece] = found.beginning
        return found
