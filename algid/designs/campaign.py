"""From what is believed and allowed to a planned motion: what `algid design` does.

The motion is planned, the torque follows from the arm. Only the torque depends on which arm it is,
so that its largest value over all arms of the belief has a closed form, and one motion stands for
all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import UNDETERMINED
from algid.base.errors import SettingError
from algid.base.names import named_values
from algid.base.progress import Progress
from algid.designs.belief import Belief, Load, Objective, objective_of
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.limits import Limits, Request, Row, Usage, limits_of, resting, usage
from algid.designs.prior import PriorArm
from algid.designs.search import Evaluation, Fourier, Stage, middles, optimise, soft_maximum
from algid.estimators.whitening import NoiseLevels
from algid.model import Motion
from algid.notices import Notice
from algid.options import flag

if TYPE_CHECKING:
    import polars as pl

MARGIN = 0.05
"""Of each limit, kept for what a controller overshoots while its model is a fifth wrong."""
ARMS = 20  # of the belief, of which the worst is reported
JUDGED_RATE = 100.0  # Hz, at which finalists are compared
JUDGED_ARMS = 6  # of the belief
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
    source, doubts : of the prior: its file or case, and what does not fit
    joints : names of the joints, for a controller
    command : the command line behind it
    """

    experiment: Experiment
    belief: Belief
    limits: Limits
    asked: Objective
    duration: float
    margin: float = MARGIN
    seed: int = 0
    source: str = ""
    doubts: tuple[Notice, ...] = ()
    joints: tuple[str, str] = ("joint1", "joint2")
    command: str = ""

    @cached_property
    def family(self) -> Fourier:
        """The motions."""
        return Fourier(self.duration)

    @cached_property
    def kept(self) -> Limits:
        """The limits less the margin."""
        return self.limits.within(self.margin)

    @cached_property
    def loads(self) -> list[Load]:
        """What the arm carries in each kind of run."""
        return list(map(self.belief.load, self.experiment.kinds))

    @cached_property
    def rest(self) -> FloatArray:
        """A motion (n,) that keeps all limits: none at all, for all arms of the belief."""
        posture = resting(self.kept, self.experiment.shared.model, self.loads)
        return np.append(posture, np.zeros(self.family.size - 2))

    @cached_property
    def _basis(self) -> Callable[[float], FloatArray]:
        return cache(lambda rate: self.family.basis(middles(self.duration, rate)))

    def slopes(self, x: FloatArray, rate: float) -> Sensitivities:
        """The motion of `x` at `rate` Hz."""
        motion = self.family.motion(x, self._basis(rate))
        return Sensitivities(self.experiment.shared.model, motion, rate)

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion about the resting posture, of equal mean velocity in each harmonic."""
        return np.append(self.rest[:2], rng.standard_normal(self.rest.size - 2))

    def evaluate(self, x: FloatArray, stage: Stage) -> Evaluation:
        """Figure and limits of a motion."""
        slopes, basis = self.slopes(x, stage.rate), self._basis(stage.rate)
        information = Information(self.experiment, self.belief.mean, slopes)
        figure, A = self.asked.figure(information.S, stage.sharpness)
        used = usage(self.kept, slopes, self.loads)
        most, share = soft_maximum(used.u, stage.hardness)
        return Evaluation(
            figure,
            self.family.gradient(information.gradient(A), basis),
            1 - most,
            -self.family.gradient(used.by_motion * share[:, None], basis),
        )

    def excess(self, x: FloatArray, rate: float) -> float:
        """The largest usage of any limit by any arm of the belief."""
        return float(usage(self.kept, self.slopes(x, rate), self.loads, derivatives=False).u.max())

    def score(self, x: FloatArray) -> float:
        """The largest relative bound of the worst arm of the belief."""
        slopes = self.slopes(x, JUDGED_RATE)
        arms = [self.belief.mean, *self.belief.draws(JUDGED_ARMS, seed=0)]
        return max(self.asked.largest(Information(self.experiment, arm, slopes).S) for arm in arms)


def campaign_of(
    prior: PriorArm,
    asked: Request,
    noise: NoiseLevels,
    wanted: Sequence[str] | str | None,
    margin: float,
    seed: int,
) -> Campaign:
    """The campaign that is asked for, with defaults where nothing is."""
    shared = prior.belief.shared
    unloaded, loaded = (1, shared.payload) if asked.runs is None else asked.runs
    names = wanted
    if isinstance(wanted, str):
        names = [name.strip() for name in wanted.split(",")]
    return Campaign(
        experiment=Experiment(shared, (int(unloaded), int(loaded)), noise, asked.rate),
        belief=prior.belief,
        limits=limits_of(asked, prior.lengths),
        asked=objective_of(prior.belief, names, prior.source),
        duration=asked.duration,
        margin=margin,
        seed=seed,
        source=prior.source,
        doubts=prior.doubts,
    )


@dataclass(frozen=True, eq=False)
class Planned:
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
    """

    campaign: Campaign
    t: FloatArray
    motion: Motion
    torque: dict[bool, FloatArray]
    std: FloatArray
    worst: FloatArray
    shares: FloatArray
    usage: Usage

    def __repr__(self) -> str:
        return f"Planned({', '.join(f'{name} ± {std:.2g}' for name, std in self.bounds.items())})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.campaign.experiment.shared.names

    @property
    def bounds(self) -> dict[str, float]:
        """By parameter the standard deviation that is to be expected."""
        return named_values(self.names, self.std)

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

    def to_frame(self) -> pl.DataFrame:
        """The trajectory of ``trajectory.csv``: time, angle, velocity, acceleration, torque."""
        import polars as pl

        columns = {"t": self.t}
        for name in ("theta", "omega", "alpha"):
            columns |= of_joints(name, getattr(self.motion, name))
        for name, torque in zip(("tau", "loaded_tau"), self.torque.values(), strict=False):
            columns |= of_joints(name, torque)
        return pl.DataFrame(columns)


def of_joints(name: str, rows: FloatArray) -> dict[str, FloatArray]:
    """The rows of a signal (2, N), or its values (2,), by the joints' names."""
    return {f"{name}1": rows[0], f"{name}2": rows[1]}


def plan(campaign: Campaign, progress: Progress | None = None) -> Planned:
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
    """
    rate = campaign.experiment.rate
    t = np.arange(round(campaign.duration * rate) + 1) / rate
    experiment, belief = campaign.experiment, campaign.belief
    try:
        x = optimise(campaign, rate, campaign.seed, progress)
        motion = campaign.family.motion(x, campaign.family.basis(t))
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
    return Planned(
        campaign=campaign,
        t=t,
        motion=motion,
        torque={kind: np.einsum("aqn,q->an", slopes.Y, belief.load(kind).c) for kind in kinds},
        std=np.sqrt(np.diag(C)),
        worst=np.sqrt(worst),
        shares=np.einsum("pi,bij,jp->pb", C, parts, C) / np.diag(C)[:, None],
        usage=usage(campaign.limits, slopes, campaign.loads, derivatives=False),
    )
