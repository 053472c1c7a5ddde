"""Motions of an arm under position control: the motion is planned, the torque follows from the arm.

Only the torque depends on which arm it is, so that its largest value over all arms of the belief has a closed form,
and one motion stands for all of them.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from algid.arm import FloatArray
from algid.design.belief import Belief
from algid.design.criterion import Asked
from algid.design.fourier import Fourier
from algid.design.information import Experiment, Information, Slopes
from algid.design.limits import Limits, usage
from algid.design.optimise import Evaluation, Stage, soft_maximum
from algid.model import Motion

JUDGED_RATE = 100.0  # Hz, at which finalists are compared
JUDGED_ARMS = 6  # of the belief


class PositionProblem:
    """Fourier motions within limits, for all arms of a belief.

    Parameters
    ----------
    experiment : Experiment
    belief : Belief
    limits : Limits
    asked : Asked
    duration : float, s
    rest : (2,), rad
        A posture within the limits, for all arms of the belief.
    """

    def __init__(
        self,
        experiment: Experiment,
        belief: Belief,
        limits: Limits,
        asked: Asked,
        duration: float,
        rest: FloatArray,
    ) -> None:
        self._experiment, self._belief, self._limits, self._asked = experiment, belief, limits, asked
        self._loads = [belief.load(loaded) for loaded in experiment.kinds]
        self.family = Fourier(duration)
        self.rest = np.concatenate([rest, np.zeros(self.family.size - 2)])
        self._basis = cache(self._basis_at)

    def _basis_at(self, rate: float) -> FloatArray:
        return self.family.basis(middles(self.family.duration, rate))

    def slopes(self, x: FloatArray, rate: float) -> Slopes:
        """The motion of `x` at `rate` Hz."""
        return Slopes(self._experiment.shared.model, self.family.motion(x, self._basis(rate)), rate)

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion about the resting posture."""
        return self.family.random(rng, self.rest[:2])

    def criterion(self, slopes: Slopes, stage: Stage) -> tuple[float, FloatArray]:
        """Figure to make small, and its derivatives (6, N) by the motion."""
        information = Information(self._experiment, self._belief.mean, slopes)
        figure, A = self._asked.figure(information.S, stage.sharpness)
        return figure, information.gradient(A)

    def evaluate(self, x: FloatArray, stage: Stage) -> Evaluation:
        """Figure and limits of a motion."""
        slopes, basis = self.slopes(x, stage.rate), self._basis(stage.rate)
        figure, by_motion = self.criterion(slopes, stage)
        used = usage(self._limits, slopes, self._loads)
        most, share = soft_maximum(used.u, stage.hardness)
        assert used.by_motion is not None
        return Evaluation(
            figure,
            self.family.gradient(by_motion, basis),
            1 - most,
            -self.family.gradient(used.by_motion * share[:, None], basis),
        )

    def excess(self, x: FloatArray, rate: float) -> float:
        """The largest usage of any limit by any arm of the belief."""
        return float(usage(self._limits, self.slopes(x, rate), self._loads, derivatives=False).u.max())

    def score(self, x: FloatArray) -> float:
        """The largest relative bound of the worst arm of the belief."""
        slopes = self.slopes(x, JUDGED_RATE)
        arms = [self._belief.mean, *self._belief.draws(JUDGED_ARMS, seed=0)]
        return max(self._asked.largest(Information(self._experiment, arm, slopes).S) for arm in arms)

    def motion(self, x: FloatArray, t: FloatArray) -> Motion:
        """The motion of `x` at the times `t` (N,) in s."""
        return self.family.motion(x, self.family.basis(t))


def middles(duration: float, rate: float) -> FloatArray:
    """Middles (N,) in s of the samples of a motion at about `rate` Hz."""
    count = max(1, round(duration * rate))
    return (np.arange(count) + 0.5) * (duration / count)
