"""From what is believed and allowed to a planned motion: what `algid design` does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.design.belief import Belief
from algid.design.criterion import Asked
from algid.design.information import Experiment, Information, Slopes
from algid.design.limits import Limits, Row, Usage, usage
from algid.design.optimise import optimise
from algid.design.position import JUDGED_RATE, PositionProblem
from algid.design.posture import resting
from algid.model import Motion
from algid.progress import Told

Drive = Literal["position", "torque"]
MARGIN = 0.03  # of each limit, kept for what a controller overshoots
ARMS = 20  # of the belief, of which the worst is reported
OPEN = 0.5  # relative bound from which on an estimate would be called not identifiable
SECOND = 1.0  # s: for how long each stretch of the motion is, of which is told what it teaches


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign to plan.

    Parameters
    ----------
    experiment : Experiment
    belief : Belief
    limits : Limits
    asked : Asked
    duration : float, s, of one run
    drive : 'position' or 'torque'
    margin : float
        Share of each limit that the plan leaves.
    seed : int
    """

    experiment: Experiment
    belief: Belief
    limits: Limits
    asked: Asked
    duration: float
    drive: Drive = "position"
    margin: float = MARGIN
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Design:
    """A planned motion and what it will tell.

    Parameters
    ----------
    campaign : Campaign
    t : (N,), s
    motion : Motion
    torque : dict of (2, N), N m
        What the believed arm needs for the motion, without and with the payload.
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
        lost = self.campaign.asked.wanted & (self.relative > OPEN)
        return [name for name, yes in zip(self.names, lost, strict=True) if yes]

    @property
    def binding(self) -> list[tuple[Row, float]]:
        """Each limit with the share of it that is used, the tightest first."""
        pairs = zip(self.usage.rows, self.usage.most.tolist(), strict=True)
        return sorted(pairs, key=lambda pair: -pair[1])


def plan(campaign: Campaign, told: Told | None = None) -> Design:
    """Plan the motion of a campaign.

    Parameters
    ----------
    campaign : Campaign
    told : callable
        Called as the search goes on.

    Raises
    ------
    SettingError
        If no motion keeps the limits.
    KeyboardInterrupt
        If it is interrupted before there is a motion; later, the best so far is the plan.
    """
    kept = campaign.limits.within(campaign.margin)
    loads = [campaign.belief.load(loaded) for loaded in campaign.experiment.kinds]
    model = campaign.experiment.shared.model
    rest = resting(kept, model, loads)
    problem = PositionProblem(campaign.experiment, campaign.belief, kept, campaign.asked, campaign.duration, rest)
    found = optimise(problem, campaign.experiment.rate, campaign.seed, told)
    t = np.arange(round(campaign.duration * campaign.experiment.rate) + 1) / campaign.experiment.rate
    return judge(campaign, t, problem.motion(found.x, t), found.interrupted)


def judge(campaign: Campaign, t: FloatArray, motion: Motion, interrupted: bool = False) -> Design:
    """What the motion at the times `t` (N,) tells, and what it uses of the limits."""
    experiment, belief = campaign.experiment, campaign.belief
    slopes = Slopes(experiment.shared.model, motion, experiment.rate)
    loads = [belief.load(loaded) for loaded in experiment.kinds]
    information = Information(experiment, belief.mean, slopes)
    C = campaign.asked.covariance(information.S)
    every = max(1, round(experiment.rate / JUDGED_RATE))
    thinned = Motion(*(signal[:, ::every] for signal in (motion.theta, motion.omega, motion.alpha)))
    coarse = Slopes(experiment.shared.model, thinned, experiment.rate / every)
    arms = belief.draws(ARMS, campaign.seed)
    drawn = [campaign.asked.covariance(Information(experiment, arm, coarse).S) for arm in arms]
    parts = information.parts(round(SECOND * experiment.rate))
    return Design(
        campaign=campaign,
        t=t,
        motion=motion,
        torque={
            loaded: np.einsum("aqn,q->an", slopes.Y, belief.load(loaded).c)
            for loaded in ((False, True) if experiment.shared.payload else (False,))
        },
        std=np.sqrt(np.diag(C)),
        worst=np.sqrt(np.max([np.diag(one) for one in [C, *drawn]], axis=0)),
        shares=np.einsum("pi,bij,jp->pb", C, parts, C) / np.diag(C)[:, None],
        usage=usage(campaign.limits, slopes, loads, derivatives=False),
        interrupted=interrupted,
    )
