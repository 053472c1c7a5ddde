"""The likelihood of one log at given coefficients: its training set, its passes, its noise levels.

A pass linearises every piece of a log, whitens it, and adds up information and scores by stretch.
Between the passes of the training stay the pieces' trajectories and the log's noise levels, which
is the state kept here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import ArrayLike

from algid.arm import FloatArray
from algid.base.quantiles import medians
from algid.estimators.combine import BlockSums, LogInformation
from algid.estimators.innovations import ResidualSums, residual_sums
from algid.estimators.noise import (
    VarianceScore,
    first_guess,
    newton_step,
    quantum,
    roughness,
    variance_score,
)
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem, Source, TooShortError
from algid.estimators.whitening import (
    Linearised,
    NoiseLevels,
    first_trajectory,
    linearise,
    trajectory,
    whiten,
)
from algid.model import Model, Motion
from algid.signals.differences import POINTS, Stencil, TorqueShift
from algid.signals.segments import Segment, pieces, spread_pieces

Beside = Callable[[Model, FloatArray, Motion, float], FloatArray]
"""Torques (m, 2, n) in N m beside those of a model at coefficients (q,), of a motion sampled every
so many s."""
PIECE_SAMPLES = 16384
_TRAINED = 4  # whole pieces of a log in the training set, up to twice as many
SHORTEST = 8 * POINTS  # samples: shorter pieces do not inform
_STRETCH = 64  # samples over which scores are summed
_FINEST = 1e-10  # relative noise that no sensor undercuts, and floating point can still weigh
_EXCESS = 4.0
"""Times what neighbouring samples differ by, jumps among them: what every term leaves of a torque
is no more where the likelihood stands. Of 60 simulated logs with sound models none leaves 1.2
times, of real arms each leaves 4.8 times or more."""
SURE = 0.9
"""Of what neighbouring torques differ by is noise of the torque: a short log may hide it in its
angles' noise."""
_FOLLOWED = 0.5  # change of a log variance, beyond which what follows it is not linear
_NEGLIGIBLE = 1e-3  # torque error relative to the torque that no one need worry about


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one pass over pieces of a log gives.

    `deviance` is minus twice the log-likelihood at the pass's coefficients, but for a constant;
    `residual` the sums over the innovations, and `noise_change` the largest change of a log
    variance in its deviations.
    """

    information: LogInformation
    residual: ResidualSums
    deviance: float
    noise_change: float = 0.0


_Part = tuple[Segment, Linearised, FloatArray]
"""A piece, linearised, and how its innovations fall with log variances (m, 2 n)."""


class LogEvidence:
    """One log: its source, the pieces it trains on, and their trajectories and noise levels so far.

    Parameters
    ----------
    source : callable that gives a fresh pass over the log's segments
    loaded : bool
    shift : TorqueShift
        After how long a logged torque acts; its delay is where none is estimated.

    `kept` is empty where the log has no piece long enough; `sure` says that its noise levels stay,
    `smooth` that derivatives by coefficients are taken at smoothed trajectories, `by_motion` that
    the motion, not the torque, tells what bends elastic joints.
    """

    def __init__(
        self,
        source: Source,
        loaded: bool,
        shift: TorqueShift,
    ) -> None:
        self.loaded = loaded
        self.sure = self.smooth = self.by_motion = False
        self._source = source
        self._shift = shift
        kept, self.whole = spread_pieces(self._pieces(), _TRAINED, PIECE_SAMPLES)
        self.kept = [replace(piece, omega=None) for piece in kept]
        if not self.kept:
            return
        self._trajectories = [first_trajectory(piece.theta, piece.dt) for piece in self.kept]
        floor = _digitisation(self.kept)
        guesses = [first_guess(piece.theta, piece.tau) for piece in self.kept]
        guess = _floored(medians(np.stack(guesses, axis=-1)), floor)
        squares = np.mean([roughness(piece.tau) ** 2 for piece in self.kept], axis=0)
        self._rough = np.maximum(guess.tau, np.sqrt(squares))
        self._floor = floor._replace(tau=np.maximum(floor.tau, SURE * guess.tau))
        self.noise = self._guess = guess
        rms = np.max([np.sqrt(np.mean(piece.tau**2, axis=1)) for piece in self.kept], axis=0)
        # A joint without a motor carries a load of the size of the other's.
        self._least = _NEGLIGIBLE * np.where(rms > 0, rms, rms.max())

    def _pieces(self) -> Iterator[Segment]:
        return pieces(self._source(), PIECE_SAMPLES, SHORTEST)

    def training(self) -> list[Segment]:
        """The pieces that it trains on."""
        return self.kept

    @property
    def trained(self) -> int:
        """Samples of the training set."""
        return sum(map(len, self.kept))

    def exceeds_noise(self, tau: FloatArray) -> bool:
        """True if errors (2,) of the torques in N m are beyond what neighbouring samples differ by.

        Not in a log without noise to speak of, where it is the error of sampling.
        """
        return bool(np.any((tau > _EXCESS * self._rough) & (self._rough > self._least)))

    def afresh(self) -> LogEvidence:
        """The same trajectories, whose noise levels start where they did."""
        other = object.__new__(LogEvidence)  # the source is not gone over again
        own = {"noise": self._guess, "sure": False, "_trajectories": self._trajectories[:]}
        vars(other).update(vars(self) | own)
        return other

    def train(self, shared: Shared, beta: FloatArray, *, free: bool = True) -> Outcome:
        """Linearise the training set at the parameters `beta` (Q,) of `shared`.

        Keeps the trajectories found, and, where they are `free`, better noise levels, which the
        trajectories and the score follow. Levels that are sure stay.
        """
        c = shared.coefficients(beta, self.loaded)
        scores: list[VarianceScore] = []
        changes: list[FloatArray] = []
        scored = free and not self.sure

        def scoring() -> Iterator[_Part]:
            for seed, (piece, linear, by_noise) in enumerate(self._trained(shared, c)):
                self._trajectories[seed] = trajectory(piece, linear, self.noise)
                if scored:
                    score, by_noise, change = variance_score(linear, seed)
                    scores.append(score)
                    changes.append(change)
                yield piece, linear, by_noise

        outcome, by_noise = self._passed(c, scoring())
        if not scored:
            return outcome
        total = VarianceScore(*(np.sum(one, axis=0) for one in zip(*scores, strict=True)))
        before, information = self.noise, outcome.information
        self.noise = _floored(newton_step(before, total, information.total[0]), self._floor)
        step = 2 * np.log(np.divide(self.noise, before)).ravel()
        followed = np.where(np.abs(step) < _FOLLOWED, step, 0.0)
        for place, change in enumerate(changes):
            moved = before.theta[:, None] * np.tensordot(followed, change, axes=1)
            self._trajectories[place] = self._trajectories[place] + moved
        # every stretch bears as much of its change; scores have changes of their own
        less = np.tensordot(followed, total.absorbed, axes=1) / len(information.S)
        g = information.g - by_noise @ followed
        information = replace(information, S=information.S - less, g=g)
        # in its own standard deviations
        most = float(np.max(np.abs(step) * np.sqrt(np.diag(total.average))))
        return replace(outcome, information=information, noise_change=most)

    def held(self, shared: Shared, beta: FloatArray) -> Outcome:
        """Pass over the training set at `beta`; trajectories and noise levels stay."""
        c = shared.coefficients(beta, self.loaded)
        return self._passed(c, self._trained(shared, c))[0]

    def run(self, shared: Shared, beta: FloatArray) -> Outcome:
        """Pass over the whole log at `beta`; each piece has its own trajectory."""
        c = shared.coefficients(beta, self.loaded)

        def linearised() -> Iterator[_Part]:
            for piece in self._pieces():
                start = first_trajectory(piece.theta, piece.dt)
                first = self._linearise(shared, c, start, piece, residual_only=True)
                theta = trajectory(piece, first, self.noise)
                linear = self._linearise(shared, c, theta, piece)
                yield piece, linear, linear.columns[:0]

        return self._passed(c, linearised())[0]

    def _trained(self, shared: Shared, c: FloatArray) -> Iterator[_Part]:
        """The training set at its trajectories and at the coefficients `c`."""
        for piece, theta in zip(self.kept, self._trajectories, strict=True):
            linear = self._linearise(shared, c, theta, piece)
            yield piece, linear, linear.columns[:0]

    def _passed(self, c: FloatArray, parts: Iterable[_Part]) -> tuple[Outcome, FloatArray]:
        """What a pass at `c` (q,) gives, and how scores (B, q, m) fall with the noise."""
        products, residuals, deviance = BlockSums(), list[ResidualSums](), 0.0
        for piece, linear, by_noise in parts:
            w, rows = linear.columns[-1], 2 * _STRETCH
            own = (
                w @ w + 2 * np.log(linear.factor[-1]).sum() + w.size * np.log(self.noise.tau).sum()
            )
            deviance += float(own)
            columns = np.concatenate([linear.columns, by_noise])
            padded = np.pad(columns, [(0, 0), (0, -w.size % rows)])
            stretches = padded.reshape(len(columns), -1, rows).swapaxes(0, 1)
            products.add(stretches[:, : len(c)] @ stretches.swapaxes(1, 2))
            residuals.append(residual_sums(np.ascontiguousarray(w.reshape(-1, 2).T), piece.dt))
        S, g, fall = np.split(products.values(), [len(c), len(c) + 1], axis=2)
        information = LogInformation(self.loaded, c, S, g[:, :, 0])
        return Outcome(information, reduce(add, residuals), deviance), fall

    @property
    def relative_error(self) -> float:
        """The larger torque's error over the least that anybody need worry about."""
        return float(np.max(self.noise.tau / self._least))

    def products(self, shared: Shared, c: FloatArray, beside: Beside) -> tuple[FloatArray, float]:
        """Products (2, m, m) by joint of the training set's whitened columns at `c` of `shared`.

        Torques `beside` the model's follow those of the q coefficients, the residual is last. With
        them the logarithm of the covariance's determinant.
        """
        gram, determinant, model = np.zeros(()), 0.0, shared.model
        for piece, linear, _ in self._trained(shared, c):
            made = beside(model, c[: len(model.names)], linear.motion, piece.dt)
            rows = whiten(linear.factor, made / self.noise.tau[:, None])
            own, residual = np.split(linear.columns, [-1])
            columns = np.concatenate([own, rows, residual])
            by_joint = columns.reshape(len(columns), -1, 2).transpose(2, 0, 1)
            gram = gram + by_joint @ by_joint.swapaxes(1, 2)
            determinant += 2 * float(np.log(linear.factor[-1]).sum())
        return gram, determinant

    def _linearise(
        self,
        shared: Shared,
        c: FloatArray,
        theta: FloatArray,
        piece: Segment,
        *,
        residual_only: bool = False,
    ) -> Linearised:
        smooth, shift = None, self._shift
        if self.smooth and not residual_only:
            smooth = first_trajectory(theta, piece.dt)
        if shared.delay:
            shift = replace(shift, delay=float(c[-1]))
        return linearise(
            shared.model,
            c[: len(shared.model.names)],
            theta,
            piece,
            Stencil(piece.dt, shift.at(piece.dt), held=shift.held, lag=shared.model.lag(c)),
            self.noise,
            shared.delay,
            residual_only=residual_only,
            smooth=smooth,
            by_motion=self.by_motion,
        )


def opened(problem: Problem) -> list[LogEvidence]:
    """The logs that are long enough.

    Raises
    ------
    TooShortError
        If there are logs of a kind and none is.
    """
    logs: list[LogEvidence] = []
    shift = problem.settings.shift
    for loaded, sources in problem.kinds():
        every = [LogEvidence(one, loaded, shift) for one in sources]
        kept = [log for log in every if log.kept]
        if not kept:
            kind = "loaded" if loaded else "unloaded"
            raise TooShortError(
                f"no {kind} log is long enough for the likelihood: expected at least {SHORTEST} "
                "samples without a gap"
            )
        logs += kept
    return logs


def _digitisation(kept: Sequence[Segment]) -> NoiseLevels:
    """Noise of digitisation alone: step / √12 of angles and torques, and floating point's own."""
    least = []
    for name, finest in (("theta", _FINEST), ("tau", 10 * _FINEST)):
        signal = np.concatenate([getattr(piece, name) for piece in kept[:2]], axis=1)
        rounding = finest * np.abs(signal).max() + 1e-300
        least.append(np.maximum(quantum(signal) / np.sqrt(12), rounding))
    return NoiseLevels(*least)


def _floored(noise: ArrayLike, floor: NoiseLevels) -> NoiseLevels:
    return NoiseLevels(*np.maximum(noise, floor))
