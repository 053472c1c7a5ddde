"""From what is believed and allowed to a planned motion: what `algid design` does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import UNDETERMINED
from algid.base.errors import SettingError
from algid.base.progress import Progress
from algid.designs.belief import Belief, Objective
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.limits import Limits, Row, Usage, resting, usage
from algid.designs.optimise import optimise
from algid.designs.position import JUDGED_RATE, PositionProblem
from algid.model import Motion
from algid.options import flag

MARGIN = 0.05
"""Of each limit, kept for what a controller overshoots while its model is a fifth wrong."""
ARMS = 20  # of the belief, of which the worst is reported
SECOND = 1.0  # s: for how long each stretch of the motion is, whose information is shown


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign to plan.

    Parameters
    ----------
    experiment : Experiment
    belief : Belief
    limits : Limits
    asked : Objective
    duration : float, s, of one run
    margin : float
        Share of each limit that the plan leaves.
    seed : int
    """

    experiment: Experiment
    belief: Belief
    limits: Limits
    asked: Objective
    duration: float
    margin: float = MARGIN
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Design:
    """A planned motion and the error bars that it will give.

    Parameters
    ----------
    campaign : Campaign
    t : (N,), s
    motion : Motion
        What a position controller follows, whatever the arm.
    torque : dict of (2, N), N m
        What the believed arm needs for them.
    std : (Q,)
        Predicted standard deviations for the believed arm, of all runs together.
    worst : (Q,)
        The largest among arms drawn from the belief.
    usage : Usage
        Of the limits as they were given, by all arms of the belief.
    interrupted : bool
        Whether the search was broken off.
    """

    campaign: Campaign
    t: FloatArray
    motion: Motion
    torque: dict[bool, FloatArray]
    std: FloatArray
    worst: FloatArray
    shares: FloatArray
    usage: Usage
    interrupted: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.campaign.experiment.shared.names

    @property
    def relative(self) -> FloatArray:
        """Predicted standard deviations (Q,) over the parameters' sizes."""
        return self.std / self.campaign.asked.size

    @cached_property
    def largest(self) -> float:
        """The largest relative bound among the parameters asked for."""
        return float(self.relative[self.campaign.asked.wanted].max())

    @property
    def open_parameters(self) -> list[str]:
        """Names of those asked for whose error bar is as large as they are."""
        lost = self.campaign.asked.wanted & (self.relative > UNDETERMINED)
        return [self.names[place] for place in np.flatnonzero(lost)]

    @property
    def binding(self) -> list[tuple[Row, float]]:
        """Each limit with the share of it that is used, the tightest first."""
        pairs = zip(self.usage.rows, self.usage.most.tolist(), strict=True)
        return sorted(pairs, key=lambda pair: -pair[1])


def plan(campaign: Campaign, progress: Progress | None = None) -> Design:
    """Plan the motion of a campaign.

    Parameters
    ----------
    campaign : Campaign
    progress : callable
        Called as the search goes on.

    Raises
    ------
    SettingError
        If no motion keeps the limits, or the angles' noise at that rate hides every torque.
    KeyboardInterrupt
        If it is interrupted before there is a motion; later, the best so far is the plan.
    """
    rate = campaign.experiment.rate
    t = np.arange(round(campaign.duration * rate) + 1) / rate
    kept = campaign.limits.within(campaign.margin)
    experiment, belief = campaign.experiment, campaign.belief
    loads = list(map(belief.load, experiment.kinds))
    try:
        rest = resting(kept, experiment.shared.model, loads)
        problem = PositionProblem(experiment, belief, kept, campaign.asked, campaign.duration, rest)
        x, interrupted = optimise(problem, rate, campaign.seed, progress)
        motion = problem.family.motion(x, problem.family.basis(t))
        slopes = Sensitivities(experiment.shared.model, motion, rate)
        # the error bars of its log
        whole = Information(experiment, belief.mean, slopes)
        C = campaign.asked.covariance(whole.S)
        every = max(1, round(rate / JUDGED_RATE))
        signals = motion.theta, motion.omega, motion.alpha
        thinned = Motion(*(signal[:, ::every] for signal in signals))
        coarse = Sensitivities(experiment.shared.model, thinned, rate / every)
        worst = np.diag(C)
        for arm in belief.draws(ARMS, campaign.seed):
            drawn = campaign.asked.covariance(Information(experiment, arm, coarse).S)
            worst = np.maximum(worst, np.diag(drawn))
    except np.linalg.LinAlgError as error:
        # Torque noise below the rounding of the noise of twice differentiated angles.
        raise SettingError(
            f"{flag('rate')}: at {rate:g} Hz the noise of the angles, "
            f"differentiated twice, leaves nothing of the torque ({error}); ask for a lower rate "
            f"or less {flag('position_noise')}"
        ) from error
    kinds = (False, True) if experiment.shared.payload else (False,)
    parts = whole.parts(round(SECOND * rate))
    return Design(
        campaign=campaign,
        t=t,
        motion=motion,
        torque={kind: np.einsum("aqn,q->an", slopes.Y, belief.load(kind).c) for kind in kinds},
        std=np.sqrt(np.diag(C)),
        worst=np.sqrt(worst),
        shares=np.einsum("pi,bij,jp->pb", C, parts, C) / np.diag(C)[:, None],
        usage=usage(campaign.limits, slopes, loads, derivatives=False),
        interrupted=interrupted,
    )
