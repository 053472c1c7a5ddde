"""The refined estimator: errors-in-variables maximum likelihood over any number of logs.

It starts from the weak estimate. On a training set, whole short logs or evenly spread pieces of long ones, it
alternates Gauss-Newton steps for the shared parameters, for every piece's trajectory and for the noise levels.
Where pieces were left out, one pass over everything at the trained values and one more step make the estimate
efficient (Le Cam's one-step estimator): the start is already within its own error bars.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.identify.blocks import BlockSums
from algid.identify.filters import smoothed
from algid.identify.fit import Fit, conclude
from algid.identify.information import LogInformation, Prior, combine
from algid.identify.model import Model
from algid.identify.noise import (
    VarianceScore,
    change_told,
    first_guess,
    floored,
    newton_step,
    quantum,
    variance_score,
)
from algid.identify.shared import Shared
from algid.identify.stencil import POINTS, Stencil
from algid.identify.weak import Source, WeakSettings
from algid.identify.weak import fit as weak_fit
from algid.identify.whiteness import Correlations, correlations, judge
from algid.identify.whitening import Linearised, NoiseLevels, linearise, trajectory
from algid.sampling import Segment, pieces

PIECE_SAMPLES = 16384
_TRAINED = 4  # pieces of a log in the training set
_SHORTEST = 8 * POINTS  # samples: shorter pieces tell nothing
_STRETCH = 64  # samples over which scores are summed
_SMOOTHING = 40.0  # Hz: of the trajectory at which a piece is first linearised
_FINEST = 1e-10  # relative noise that no sensor undercuts, and floating point can still weigh
_STEPS = 20
_NOISE_STEPS = 12  # then the noise levels stay, so that the rest can settle
_EXCESS = 10.0  # torque error beyond the sensor's noise that tells unmodelled dynamics
_NEGLIGIBLE = 1e-3  # torque error relative to the torque that no one need worry about
_REFUTED = (
    "the torque's error is far larger and slower than its sensor's noise (unmodelled dynamics): the likelihood of "
    "white noise does not hold, and the weak estimate with robust intervals stands in its place"
)
_SETTLED = 0.02  # change of every parameter in its standard deviations
_NOISE_SETTLED = 0.2  # change of every log variance in its standard deviations
_FAR = 3.0  # standard deviations of the training set beyond which the last step is repeated
_PASSES = 4


@dataclass(frozen=True, eq=False)
class RefinedSettings:
    """Settings of the refined estimator.

    Parameters
    ----------
    model : Model
    hold : "foh" or "zoh"
        Whether the torque moved evenly from sample to sample, or was held from each sample to the next.
    delay : float, s
        After how long a logged torque acts; where the estimate of it starts with `estimate_delay`.
    estimate_delay : bool
    noise : NoiseLevels or None
        Known noise levels; None estimates them log by log.
    lengths : dict
        Known link lengths "l1", "l2" in m.
    prior : Prior or None
        What an earlier result knows of the arm; unloaded logs are not needed then.
    weak : WeakSettings
        Window and bandwidth of the weak estimate that it starts from.
    """

    model: Model = field(default_factory=Model)
    hold: Literal["foh", "zoh"] = "foh"
    delay: float = 0.0
    estimate_delay: bool = False
    noise: NoiseLevels | None = None
    lengths: dict[str, float] = field(default_factory=dict)
    prior: Prior | None = None
    weak: WeakSettings = field(default_factory=WeakSettings)

    def shift(self, dt: float) -> float:
        """Time in s by which the hold delays a torque."""
        return 0.5 * dt if self.hold == "zoh" else 0.0


@dataclass(frozen=True, eq=False)
class _Outcome:
    """What one pass over pieces of a log gives."""

    information: LogInformation
    noise_score: VarianceScore | None
    innovations: Correlations
    trajectories: list[FloatArray]


@dataclass(frozen=True, eq=False)
class _Training:
    """How the alternation ended: whether it settled, or the data refuted white torque noise."""

    beta: FloatArray
    outcomes: list[_Outcome]
    iterations: int
    settled: bool = False
    refuted: bool = False


class _Log:
    """One log: its source, the pieces it trains on, and their trajectories and noise levels so far."""

    def __init__(
        self, source: Source, loaded: bool, settings: RefinedSettings, kept: list[Segment], whole: bool
    ) -> None:
        self.source = source
        self.loaded = loaded
        self.settings = settings
        self.kept = kept
        self.whole = whole
        self.trajectories = [_first_trajectory(piece) for piece in self.kept]
        self.floor = _floor(self.kept)
        guess = _guessed_noise(kept, self.floor)
        self.noise = settings.noise or guess
        self._sensor = guess.tau
        self._least = _NEGLIGIBLE * np.max([np.sqrt(np.mean(piece.tau**2, axis=1)) for piece in kept], axis=0)

    @property
    def refuted(self) -> bool:
        """Whether the torque's error is no white noise: far above what neighbouring samples differ by."""
        return bool(np.any(self.noise.tau > np.maximum(_EXCESS * self._sensor, self._least)))

    def train(self, shared: Shared, c: FloatArray) -> _Outcome:
        """Linearise the training set at the coefficients `c`; keeps the trajectories found."""
        stretches, scores = (BlockSums(), BlockSums()), []
        innovations: list[Correlations] = []
        for seed, (piece, theta) in enumerate(zip(self.kept, self.trajectories, strict=True)):
            linear = _linearise(self.settings, shared, c, theta, piece, self.noise)
            _collect(linear, stretches, innovations)
            multiplier = linear.solve_transposed(linear.columns[-1:])[0]
            self.trajectories[seed] = trajectory(piece, linear, multiplier, self.noise)
            if self.settings.noise is None:
                scores.append(variance_score(linear, len(piece), seed))
        score = sum(scores[1:], scores[0]) if scores else None
        return _Outcome(_information(self.loaded, c, stretches), score, _added(innovations), self.trajectories)

    def run(self, shared: Shared, c: FloatArray) -> _Outcome:
        """Pass over the whole log at the coefficients `c`, settling each piece's trajectory by itself."""
        stretches = (BlockSums(), BlockSums())
        innovations: list[Correlations] = []
        for piece in pieces(self.source(), PIECE_SAMPLES):
            if len(piece) < _SHORTEST:
                continue
            first = _linearise(self.settings, shared, c, _first_trajectory(piece), piece, self.noise)
            multiplier = first.solve_transposed(first.columns[-1:])[0]
            theta = trajectory(piece, first, multiplier, self.noise)
            _collect(_linearise(self.settings, shared, c, theta, piece, self.noise), stretches, innovations)
        return _Outcome(_information(self.loaded, c, stretches), None, _added(innovations), [])


def fit(unloaded: Sequence[Source], loaded: Sequence[Source] = (), settings: RefinedSettings | None = None) -> Fit:
    """Most likely parameters of the arm, and of its payload where there are loaded logs.

    Parameters
    ----------
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`, the stretches of one log in time; it is called several times.
    settings : RefinedSettings

    Returns
    -------
    Fit
        With `converged` false and the weak estimate in its place where the iteration failed.

    Raises
    ------
    ValueError
        If there is no log, or no log long enough, or a known noise level is not positive.
    """
    settings = settings or RefinedSettings()
    _check_noise(settings.noise)
    start = weak_fit(unloaded, loaded, _weak_settings(settings), settings.lengths, settings.prior)
    shared = start.shared
    logs = [*_opened(unloaded, False, settings), *_opened(loaded, True, settings)]
    try:
        training = _train(shared, logs, start.values, settings)
        if training.refuted:
            return replace(start, note=_REFUTED, iterations=training.iterations)
        if not training.settled or not np.all(np.isfinite(training.beta)):
            return _not_converged(start, training.iterations)
        beta, outcomes = training.beta, training.outcomes
        if not all(log.whole for log in logs):
            beta, outcomes = _finish(shared, logs, beta, settings)
    except np.linalg.LinAlgError:
        return _not_converged(start, 0)
    whiteness = judge(_added([outcome.innovations for outcome in outcomes]))
    informations = [outcome.information for outcome in outcomes]
    coloured = not whiteness.white
    fitted = conclude(
        "refined",
        shared,
        informations,
        beta,
        start.moved,
        settings.prior,
        coloured=coloured,
        samples=int(_count(outcomes)),
    )
    noise = tuple(log.noise for log in logs)
    return replace(fitted, noise=noise, whiteness=whiteness, iterations=training.iterations)


def _check_noise(noise: NoiseLevels | None) -> None:
    if noise is not None and not (np.all(noise.theta > 0) and np.all(noise.tau > 0)):
        raise ValueError(f"known noise levels must be positive, got {noise.theta} rad and {noise.tau} N m")


def _opened(sources: Sequence[Source], loaded: bool, settings: RefinedSettings) -> Iterator[_Log]:
    for source in sources:
        kept, whole = _training_set(source())
        if kept:
            yield _Log(source, loaded, settings, kept, whole)


def _not_converged(start: Fit, iterations: int) -> Fit:
    status = tuple("NOT_CONVERGED" if word == "OK" else word for word in start.status)
    return replace(start, status=status, converged=False, iterations=iterations)


def _weak_settings(settings: RefinedSettings) -> WeakSettings:
    return replace(
        settings.weak,
        model=settings.model,
        hold=settings.hold,
        delay=settings.delay,
        estimate_delay=settings.estimate_delay,
    )


def _train(shared: Shared, logs: Sequence[_Log], beta: FloatArray, settings: RefinedSettings) -> _Training:
    for iteration in range(1, _STEPS + 1):
        outcomes = [log.train(shared, shared.coefficients(beta, log.loaded)) for log in logs]
        better, S, _ = combine(shared, [outcome.information for outcome in outcomes], beta, settings.prior)
        free = settings.noise is None and iteration <= _NOISE_STEPS
        told = _better_noise(logs, outcomes) if free else 0.0
        moved = _distance(better - beta, S)
        beta = better
        if settings.noise is None and any(log.refuted for log in logs):
            return _Training(beta, outcomes, iteration, refuted=True)
        if iteration > 1 and moved < _SETTLED and told < _NOISE_SETTLED:
            return _Training(beta, outcomes, iteration, settled=True)
    return _Training(beta, outcomes, _STEPS)


def _better_noise(logs: Sequence[_Log], outcomes: Sequence[_Outcome]) -> float:
    told = 0.0
    for log, outcome in zip(logs, outcomes, strict=True):
        assert outcome.noise_score is not None
        better = floored(newton_step(log.noise, outcome.noise_score, outcome.information.total[0]), log.floor)
        told = max(told, change_told(log.noise, better, outcome.noise_score))
        log.noise = better
    return told


def _finish(
    shared: Shared, logs: Sequence[_Log], beta: FloatArray, settings: RefinedSettings
) -> tuple[FloatArray, list[_Outcome]]:
    """Passes over whole logs until the step is one that a single Gauss-Newton step can make."""
    for _ in range(_PASSES):
        outcomes = [log.run(shared, shared.coefficients(beta, log.loaded)) for log in logs]
        better, S, _ = combine(shared, [outcome.information for outcome in outcomes], beta, settings.prior)
        share = sum(len(piece) for log in logs for piece in log.kept)
        far = _distance(better - beta, S) * np.sqrt(share / max(share, _count(outcomes)))
        beta = better
        if far < _FAR * np.sqrt(beta.size):
            break
    return beta, outcomes


def _distance(step: FloatArray, S: FloatArray) -> float:
    """Length of a step in standard deviations."""
    return float(np.sqrt(np.maximum(step @ S @ step, 0.0)))


def _count(outcomes: Sequence[_Outcome]) -> float:
    return float(sum(outcome.innovations.count[0] for outcome in outcomes))


def _training_set(segments: Iterable[Segment]) -> tuple[list[Segment], bool]:
    """Evenly spread pieces of a log, and whether they are all of it."""
    kept: list[Segment] = []
    stride = 1
    whole = True
    usable = (piece for piece in pieces(segments, PIECE_SAMPLES) if len(piece) >= _SHORTEST)
    for index, piece in enumerate(usable):
        if index % stride:
            continue
        kept.append(_copied(piece))
        if len(kept) > 2 * _TRAINED:
            kept, stride, whole = kept[::2], 2 * stride, False
    return kept, whole


def _copied(piece: Segment) -> Segment:
    """The piece without hold on the block it was cut from."""
    return replace(piece, theta=piece.theta.copy(), tau=piece.tau.copy(), omega=None)


def _first_trajectory(piece: Segment) -> FloatArray:
    return smoothed(piece.theta, piece.dt, min(_SMOOTHING, 0.1 / piece.dt))


def _guessed_noise(kept: Sequence[Segment], floor: NoiseLevels) -> NoiseLevels:
    guesses = [first_guess(piece.theta, piece.tau) for piece in kept]
    guess = NoiseLevels(
        np.median([level.theta for level in guesses], axis=0), np.median([level.tau for level in guesses], axis=0)
    )
    return floored(guess, floor)


def _floor(kept: Sequence[Segment]) -> NoiseLevels:
    """What the digitisation of angles and torques alone contributes: step / √12, and floating point's own."""
    theta = np.concatenate([piece.theta for piece in kept[:2]], axis=1)
    tau = np.concatenate([piece.tau for piece in kept[:2]], axis=1)
    least_theta = np.maximum(quantum(theta) / np.sqrt(12), _FINEST * np.abs(theta).max() + 1e-300)
    least_tau = np.maximum(quantum(tau) / np.sqrt(12), 10 * _FINEST * np.abs(tau).max() + 1e-300)
    return NoiseLevels(least_theta, least_tau)


def _linearise(
    settings: RefinedSettings, shared: Shared, c: FloatArray, theta: FloatArray, piece: Segment, noise: NoiseLevels
) -> Linearised:
    columns = len(shared.model.names)
    delay = float(c[columns]) if shared.delay else settings.delay
    stencil = Stencil(piece.dt, settings.shift(piece.dt) + delay)
    return linearise(shared.model, c[:columns], theta, piece, stencil, noise, shared.delay)


def _collect(linear: Linearised, stretches: tuple[BlockSums, BlockSums], innovations: list[Correlations]) -> None:
    """Add a piece's information and score, by stretches, and the sums over its innovations."""
    Z, w = linear.columns[:-1], linear.columns[-1]
    rows = 2 * _STRETCH
    count = -(-w.size // rows)
    padded = np.zeros((Z.shape[0] + 1, count * rows))
    padded[:, : w.size] = linear.columns
    parts = padded.reshape(-1, count, rows).swapaxes(0, 1)
    gram = parts @ parts.swapaxes(1, 2)
    stretches[0].add(gram[:, :-1, :-1])
    stretches[1].add(gram[:, :-1, -1])
    innovations.append(correlations(np.ascontiguousarray(w.reshape(-1, 2).T)))


def _information(loaded: bool, c: FloatArray, stretches: tuple[BlockSums, BlockSums]) -> LogInformation:
    return LogInformation(loaded, c, stretches[0].values(), stretches[1].values())


def _added(innovations: Sequence[Correlations]) -> Correlations:
    return sum(innovations[1:], innovations[0])
