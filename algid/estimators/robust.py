"""Parameters where no likelihood of white noise holds: windows' least squares, every term shrunk.

To choose terms is to set some of them to zero, and another half of the logs sets others to zero.
Here every term stays, with a normal prior whose spread is estimated and never exceeds what a real
arm may have (empirical Bayes: Efron & Morris 1973). All logs' scores disagree by more than white
noise explains; the information is divided by that factor first.

    H = S / φ + Λ,   p = H⁻¹ (g / φ + Λ m),   Λ = diag(1 / τ²)
            τ_t² / s² = min(1, (Σ ((p - m)² + H⁻¹) / s² + u²) / (n + 1))   for n coefficients a term

As one more coefficient stands the usual spread, u = ½ of the largest one: without it a spread
falls to nothing or stays open by chance, which would be a choice again.

A joint that stands is held by dry friction, which is any torque up to f there: its windows are
left out. From four logs on, leaving them out shows how far an estimate moves with what the model
lacks. With fewer, windows of half and of twice the length do: longer ones weigh slow errors more,
shorter ones fast ones. The scatter of their estimates is added to the covariance.

No window and no log shows what all of them have: a cable's pull looks like weight, and what a
driver swallows like a larger arm. The torques G that `algid.estimators.misfit` holds a residual
against show how far they may move an estimate: with a coefficient h of each, normal with a spread
σ of `BESIDE` of the joint's torque, likelihoods are those of what h leaves of them,

    S - BᵀQ,  g - QᵀGᵀe,   Q = (GᵀG + σ⁻²)⁻¹ B,   B = GᵀX

An interval takes in how far that moves the estimate, and is no narrower than what it leaves open.

**Endogenous torque.** Torque that the model lacks drives the motion, and least squares is
attenuated by it. Instruments (`algid.estimators.instruments`) are not, as long as they do not
answer that torque: the logged reference of a controller never does, the measured torque does not
in open loop. Both are compared with the same terms and the same prior, and the residual with the
torque after it:

    h  = dᵀ V⁻¹ d,   d = β_instruments − β_least squares          χ² of the number of constants
    r_l = Σ e(t) y(t + l) / v_l^½                                 normal, where no torque answers

V is the long-run variance of the difference of both estimates' influences, window by window
(Durbin, Wu & Hausman, in the form that needs no efficient estimate: Wooldridge 2010, §6.3.1), and
v_l that of the products.

======  ===============================================================  =========  ===============
symbol  name                                                             shape      unit
======  ===============================================================  =========  ===============
S, g    information and score of all logs                                (Q, Q), Q  1 / (unit unit)
X, G    columns of the parameters, and torques that no term has          (R, …)     N m / unit
p       shared parameters where prior and logs meet                      (Q,)       mixed
m, s    the prior's mean, and the spread that physics allows, of a term  (m,)       its own
τ       the spread that the logs show, at most s                         (m,)       its own
φ       overdispersion: variance of the scores over the information      scalar     1
e, y    residual of the instruments' windows, torque's moment            (2, R)     N m
v       long-run variance of the products' sum, lag by lag              (L, 2)     (N m)⁴
======  ===============================================================  =========  ===============
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray, keep_arrays
from algid.base.compiled import chi2_tail
from algid.base.criteria import AT_REST
from algid.base.names import named_values, outside, within
from algid.base.significance import chance, level
from algid.estimators import instruments, weak
from algid.estimators.combine import (
    LogInformation,
    Prior,
    by_kind,
    combine,
    joined,
    long_run_variance,
    of_kind,
    rank,
    scaled_pinv,
    scatters,
    scores_of,
)
from algid.estimators.diagnostics import broken_bounds, undriven
from algid.estimators.fit import Fit, finish, solved_anew, widened
from algid.estimators.instruments import Explained, followed
from algid.estimators.misfit import of_no_term
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import OF_A_WINDOW, Problem, TooShortError, WeakSettings
from algid.estimators.repeats import Groups, grouped, merged, shared_out
from algid.estimators.weak import Normal
from algid.model import DELAYS, EVERY_TERM, K3, K5, RIGID, SINES, TERMS, acting
from algid.notices import Notice, Remedy
from algid.signals.segments import Segment

_ROUNDS = 3  # linearisations: the third moves nothing by a hundredth of a standard deviation
_SOFT_ROUNDS = 5  # of them where joints are elastic
_MOST_KEPT = 1 << 20  # samples of all logs whose moments stay in memory, some 40 bytes each
_STEPS, _SETTLED = 200, 1e-3  # of expectation and maximisation, and change of log τ at the last
_LEAST = 1e-4  # of s: a spread that counts as nothing
_FEWEST = 3  # logs whose scatter shows an overdispersion
BESIDE = 0.01
"""Of a joint's torque, RMS: what a torque may be that no term has."""
WINDOWS = (0.5, 2.0)
"""Of the windows' length: others that few logs are estimated by too."""
ANSWERS = 0.01
"""p value of feedback below which instruments do not replace a biased least squares."""
MOVES = 1.0
"""Standard deviations of a constant that are worth another estimator.

Below that an interval loses less than 5 points of its coverage.
"""
_NEAR = 0.5  # of them: nearer, instruments are not simulated again
_LAGS = 8  # steps between windows, two windows in all


def fit(problem: Problem) -> Fit:
    """Parameters of the arm, of every term and of its payload where there are loaded logs.

    By least squares, or by instruments where the torque is endogenous and there is one.

    Parameters
    ----------
    problem : Problem
        Its model's gravity and shapes of friction count, not its terms. With a delay that is not
        zero none is estimated. The prior may know terms too.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor a prior.
    """
    robust = RobustProblem.of(problem)
    least = robust.least_squares()
    fit = robust.instruments_if_endogenous(least)
    if fit.intervals != "jackknife":
        fit = robust.with_scatter(fit, least, [{"window": window} for window in WINDOWS])
    return robust.with_scatter(fit, least, [{"beside": True}])


@dataclass(frozen=True, eq=False)
class Expected:
    """Prior of m coefficients before any log: their term, mean m, largest and usual spread (m,)."""

    names: tuple[str, ...]
    terms: tuple[str, ...]
    mean: FloatArray
    spread: FloatArray
    usual: FloatArray

    def __post_init__(self) -> None:
        keep_arrays(self)

    def prior(self, share: FloatArray) -> Prior:
        """The normal prior with `share` (m,) of the largest spreads."""
        return Prior(
            self.names, self.mean, np.diag((np.maximum(share, _LEAST) * self.spread) ** -2)
        )


@dataclass(frozen=True, eq=False)
class RobustProblem:
    """Logs that are long enough, with what all estimates on them have in common.

    Parameters
    ----------
    problem : Problem
        Of those logs, with every term that they can determine, and the speeds below which a joint
        stands.
    shared : Shared
    moved : (2,), rad, how far each joint travelled
    groups : logs that repeat each other
    keeps : whether the logs are short enough for their moments to stay in memory
    """

    problem: Problem
    shared: Shared
    moved: FloatArray
    groups: Groups
    keeps: bool

    @classmethod
    def of(cls, problem: Problem) -> RobustProblem:
        """See `fit`."""
        settings, prior = problem.settings, problem.prior
        bare = replace(settings, model=replace(settings.model, terms=()), estimate_delay=False)
        normals = weak.normals_of(replace(problem, settings=bare))
        unloaded, loaded = (
            [normal.source for normal in of_kind(normals, kind)] for kind in (False, True)
        )
        delay = settings.estimate_delay or settings.shift.delay == 0
        model = replace(settings.model, terms=offered(normals, prior.names if prior else ()))
        window = settings.window / OVERLAP
        first, second = AT_REST * weak.speeds([*unloaded, *loaded], settings)
        settings = replace(settings, model=model, estimate_delay=delay, rest=(first, second))
        ours = replace(problem, unloaded=unloaded, loaded=loaded, settings=settings)
        return cls(
            ours,
            replace(ours.shared, payload=bool(problem.loaded)),
            np.max([normal.moved for normal in normals], axis=0, initial=0.0),
            grouped(unloaded, loaded),
            sum(window * normal.rows.max() / normal.dt for normal in normals) <= _MOST_KEPT,
        )

    def least_squares(self, window: float = 1.0, *, beside: bool = False) -> Fit:
        """Every term shrunk, by windows of `window` times the settings' length.

        Where asked for, `beside` torques that no term has.

        Raises
        ------
        TooShortError
            If a log has no such window.
        """
        shared, settings, known = self.shared, self.problem.settings, self.problem.prior
        model, settings = settings.model, replace(settings, window=window * settings.window)
        problem = replace(self.problem, settings=settings)
        memory: weak.Memory | None = {} if self.keeps else None

        def others(piece: Segment, windows: Windows) -> FloatArray:
            return windows.beside(piece, partial(of_no_term, model))

        share: FloatArray = np.ones(1)  # of every spread
        columns, at = len(model.names), dict[bool, FloatArray]()
        for _ in range(_SOFT_ROUNDS if acting(model, "elastic") else _ROUNDS):
            besides = others if beside and at else None
            normals = weak.normals_of(problem, at, besides, memory)
            if len(normals) < len(problem.logs):
                raise TooShortError(f"no {OF_A_WINDOW}")
            if not at:
                beta, _ = weak.first_estimate(shared, normals, known)
                first, driven = normals, _driven(normals)
            expected = expectation(shared, first, settings, beta, known)
            logs = partial(self._weighed, normals, driven)
            shrunk = partial(shrink, shared, expected, known)
            (beta, share), weighed = weak.reweighted(logs, shrunk, (beta, share))
            at = {kind: shared.coefficients(beta, kind)[:columns] for kind, _ in problem.kinds()}
            if shared.delay:
                problem = problem.at(model, float(beta[columns]), estimate_delay=True)
        return self._finished("weak", weighed, beta, expected.prior(share))

    def _weighed(
        self,
        normals: Sequence[Normal],
        driven: Sequence[NDArray[np.bool_]],
        state: tuple[FloatArray, FloatArray],
    ) -> list[LogInformation]:
        """Each log's likelihood over φ, with the weights of its residual at the parameters (Q,)."""
        beta, _ = state
        logs = []
        for normal, counts in zip(normals, driven, strict=True):
            c = self.shared.coefficients(beta, normal.loaded)
            wide = np.append(c, np.zeros(normal.gram.shape[-1] - 1 - c.size))
            log = weak.evidence(normal.gram, normal.rows, wide, normal.loaded, used=counts)
            logs.append(_marginal(log, normal, c.size))
        return self._divided(logs, beta)

    def _divided(self, logs: Sequence[LogInformation], beta: FloatArray) -> list[LogInformation]:
        """Each log's likelihood, shared among its repeats and divided by φ at `beta` (Q,)."""
        logs = shared_out(logs, self.groups)
        phi = dispersion(self.shared, merged(logs, self.groups), beta)
        return [log.scaled(1 / phi) for log in logs]

    def _finished(
        self, estimator: str, logs: Sequence[LogInformation], beta: FloatArray, shrinkage: Prior
    ) -> Fit:
        """The fit of likelihoods over φ beside the prior that the terms are shrunk by."""
        return finish(
            estimator,
            self.shared,
            logs,
            beta,
            self.moved,
            joined(self.problem.prior, shrinkage),
            coloured=True,
            repeats=self.groups,
            shrinkage=shrinkage,
        )

    def with_scatter(self, fit: Fit, least: Fit, others: Sequence[Mapping[str, Any]]) -> Fit:
        """The fit with the scatter of n `others` about `least`: settings of other least squares.

            W = V + Σ d dᵀ / n,   d = β_other − β, by least squares

        V is no narrower than what torques beside the model's leave open.
        """
        determined = np.isfinite(least.std)
        moved, covariance = [], fit.covariance
        for settings in others:
            try:
                other = self.least_squares(**settings)
            except TooShortError:  # of the longer windows
                continue
            moved.append(np.where(determined, other.values - least.values, 0.0))
            if settings.get("beside"):
                # near the hanging arm a spring is weight: least squares does not move then, but
                # leaves open as much of the constant as the spring may be
                covariance = widened(covariance, other.covariance)
        scatter = np.sum([np.outer(d, d) for d in moved], axis=0) / max(1, len(moved))
        return replace(fit, covariance=covariance + scatter)

    def instruments_if_endogenous(self, least: Fit) -> Fit:
        """The fit by least squares, or by instruments where those differ and answer nothing.

        A reference that the logs hold and the arm follows is an instrument, else a torque that
        answers nothing.
        """
        following = followed(self.problem)
        corrected = self.by_instruments(least, least.values, following)
        if corrected is None:
            return least
        if compared(corrected, least)[1] > _NEAR:
            corrected = self.by_instruments(least, corrected.values, following) or corrected
        distance, moved, same = compared(corrected, least)
        fit = replace(least, endogeneity=distance)
        # least squares is off by more than its error bars take in
        if not (same < level("INSTRUMENTS") and moved > MOVES):
            return fit
        if following is None and (answers := feedback(corrected, self.problem, ANSWERS)):
            return fit.noted(answers)
        case = "torque" if following is None else "reference"
        note = Notice("INSTRUMENTS", numbers={"case": case, "distance": moved, "p_value": same})
        return replace(corrected, endogeneity=distance).noted(note)

    def by_instruments(
        self, least: Fit, at: FloatArray, following: Explained | None = None
    ) -> Fit | None:
        """The parameters of `least` by instruments at `at` (Q,), with its terms and its prior.

        Along the motion that a reference explains, where the arm is `following` one, else along a
        simulated one; None where the windows cannot be simulated.
        """
        delay = least.shared.delay
        problem = self.problem.at(least.shared.model, least.delay, estimate_delay=delay)
        logs = instruments.evidence(problem, self.shared, at, following)
        if len(logs) != len(least.logs) or least.shrinkage is None:
            return None
        return self._finished("instruments", self._divided(logs, at), at, least.shrinkage)


def _marginal(log: LogInformation, normal: Normal, q: int) -> LogInformation:
    """The likelihood of q coefficients, whatever those of the columns behind them are."""
    sizes = np.sqrt(np.diagonal(normal.total, axis1=1, axis2=2))
    own, torque = sizes[:, q:-1], np.sqrt(normal.power)[:, None]
    spread = BESIDE * np.sum(np.divide(torque, own, out=np.zeros_like(own), where=own > 0), axis=0)
    # in units of the spreads
    S = log.total[0][q:] * spread[:, None]
    Q = np.linalg.solve(np.eye(spread.size) + S[:, q:] * spread, S[:, :q])
    T = np.concatenate([np.eye(q), -spread[:, None] * Q])
    S = T.T @ log.S @ T + Q.T @ Q / len(log.S)
    return LogInformation(log.loaded, log.c0[:q], S, log.g @ T)


def offered(normals: Sequence[Normal], held: Sequence[str] = ()) -> tuple[str, ...]:
    """Terms that logs can determine: no gain without a motor; a lag is a delay to first order.

    Elastic joints are those of a first pass alone, which `held` tells.
    """
    driven = all(normal.power.all() for normal in normals)
    terms = []
    for name, term in TERMS.items():
        free = term.spread is not None and not term.elastic and (driven or not term.gains)
        if free or within(term.names, held):
            terms.append(name)
    return tuple(terms)


_HARDLY = 0.2
"""Share of the most torque that a joint has in any log of a kind: with less it is hardly driven."""


def _driven(normals: Sequence[Normal]) -> list[NDArray[np.bool_]]:
    """Which joints (2,) of each log are driven beside others of its kind, or have no motor.

    What moves a joint that is hardly driven is what the model lacks, and its equation is solved by
    constants near nothing: the better, the more it would weigh. An arm without its payload may need
    a fifth of the torque and is driven nevertheless.
    """
    driven = []
    for kind in (False, True):
        squares = [normal.power / np.maximum(normal.rows, 1) for normal in of_kind(normals, kind)]
        driven += list(np.sqrt(squares) >= _HARDLY * np.sqrt(np.max(squares, axis=0, initial=0.0)))
    return driven


def expectation(
    shared: Shared,
    normals: Sequence[Normal],
    settings: WeakSettings,
    beta: FloatArray,
    known: Prior | None = None,
) -> Expected:
    """Prior of the terms of logs whose torque has the size of `normals`, but of what is `known`."""
    held = () if known is None else known.names
    rows = np.sum([normal.rows for normal in normals], axis=0)
    torque = np.sqrt(np.sum([normal.power for normal in normals], axis=0) / np.maximum(rows, 1.0))
    # a joint without a motor carries a load like the other's
    torque = np.where(torque > 0, torque, torque.max())
    value = named_values(shared.names, np.abs(beta))
    found = []
    for term in shared.model.terms + (DELAYS if shared.delay else ()):
        spread, mean = EVERY_TERM[term].spread, 0.0
        if spread is None:
            continue
        if term in DELAYS and not settings.shift.held:
            mean = 0.5 * normals[0].dt  # of a torque that a digital controller holds
        for name in outside(within(EVERY_TERM[term].names, shared.names), held):
            second = name.endswith("2")
            units = {
                "inertia": value[K3],
                "compliance": 1 / max(value[K3 if second else K5], 1e-300),
                "torque": float(torque[int(second)]),
                "cosine": value.get(SINES.get(name, ""), 0.0),
            }
            # of an arm that shows no inertia none, in a number whose square has an inverse
            size = spread.size * max(units.get(spread.of, 1.0), 1e-100)
            found.append((name, term, mean, size, spread.usual))
    names, terms, *numbers = zip(*found, strict=True) if found else [()] * 5
    return Expected(names, terms, *map(np.array, numbers))


def dispersion(shared: Shared, logs: Sequence[LogInformation], beta: FloatArray) -> float:
    """φ at `beta` (Q,), 1 at least.

    Notes
    -----
    The larger of tr(S⁻¹ M) / q, M the long-run variance of the scores within logs, and tr(S⁻¹ Σ s
    sᵀ) n / (n - 1) / q over the scores s of n logs of a kind, where there are `_FEWEST` or more.
    """
    kinds = scatters(shared, logs, beta)
    many = [kind for kind in kinds if len(kind.each) >= _FEWEST]
    ratios = [1.0]
    for some, meats in (
        (kinds, [kind.within for kind in kinds]),
        (many, [kind.among() for kind in many]),
    ):
        if some:
            S = np.sum([kind.S for kind in some], axis=0)
            ratios.append(float(np.sum(scaled_pinv(S) * np.sum(meats, axis=0))) / rank(S))
    return max(ratios)


def shrink(
    shared: Shared,
    expected: Expected,
    known: Prior | None,
    logs: Sequence[LogInformation],
    start: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Parameters p (Q,) and spread shares τ / s (m,) by expectation and maximisation.

    Parameters
    ----------
    shared : Shared
    expected : Expected
    known : Prior, optional
        What an earlier result knows of other parameters.
    logs : each log's quadratic likelihood, divided by φ
    start : (Q,) and (m,), in 0 … 1
        Where the iteration starts.
    """
    beta, share = start
    places = list(map(shared.names.index, expected.names))
    alike = np.equal.outer(expected.terms, expected.terms).astype(np.float64)
    logs = by_kind(logs)
    for _ in range(_STEPS):
        beta, H, _ = combine(shared, logs, beta, joined(known, expected.prior(share)))
        variance = np.diag(scaled_pinv(H))[places]
        square = ((beta[places] - expected.mean) ** 2 + variance) / expected.spread**2
        # of n squares of a term, and one more of the usual size that it shrinks to
        mean = (alike @ square + expected.usual**2) / (alike.sum(axis=1) + 1)
        better = np.minimum(1.0, np.sqrt(mean))
        change = float(np.max(np.abs(np.log(better / np.maximum(share, _LEAST))), initial=0.0))
        share = better
        if change < _SETTLED:
            break
    beta, _, _ = combine(shared, logs, beta, joined(known, expected.prior(share)))
    return beta, share


def compared(better: Fit, least: Fit) -> tuple[float, float, float]:
    """How far instruments move a constant at most, in their deviations and in least squares' own.

    With that the chance of such differences where the torque is exogenous.
    """
    places = np.flatnonzero(np.isin(least.names, RIGID) & np.isfinite(better.std + least.std))
    if not places.size:
        return 0.0, 0.0, 1.0
    away = (better.values - least.values)[places]
    # of the first alone where stretches differ
    apart = [
        long_run_variance(one - other if one.shape == other.shape else one)[0]
        for one, other in zip(_influences(better), _influences(least), strict=True)
    ]
    V = np.sum(apart, axis=0)
    h = float(away @ scaled_pinv(V[np.ix_(places, places)]) @ away)
    distance, moved = (float(np.max(np.abs(away) / fit.std[places])) for fit in (better, least))
    return distance, moved, float(chi2_tail(places.size, max(h, 0.0)))


def _influences(fit: Fit) -> Iterator[FloatArray]:
    """What the stretches (B, Q) of each log move the estimate by."""
    _, H, _ = combine(fit.shared, fit.logs, fit.values, fit.prior)
    inverse = scaled_pinv(H)
    for log in fit.logs:
        T, scores = scores_of(fit.shared, log, fit.values)
        yield scores @ T @ inverse


def feedback(fit: Fit, problem: Problem, limit: float) -> Notice | None:
    """That the measured torque answers what the model lacks.

    By the Bonferroni p value of the residual's correlations with later torques, below `limit`.
    """
    settings = problem.at(fit.shared.model, fit.delay).settings
    sums = np.zeros((2, 2 * _LAGS))
    for kind, sources in problem.kinds():
        for source in sources:
            c = fit.shared.coefficients(fit.values, kind)[: len(settings.model.names)]
            parts = [(own.theta, own.tau) for _, own in weak.residual_rows(source, settings, c)]
            rows = np.concatenate([np.empty((2, 2, 0)), *parts], axis=2)
            if rows.shape[2] > 2 * _LAGS:
                sums += _crossed(*(rows - rows.mean(axis=2, keepdims=True)))
    products, variance = sums
    if not np.all(variance > 0):
        return None
    p_value = chance(float(np.max(np.abs(products) / np.sqrt(variance))), products.size)
    remedy = Remedy({"estimator": "weak"}, "to compare")
    notice = Notice("FEEDBACK", numbers={"p_value": p_value}, remedies=(remedy,))
    return notice if p_value < limit else None


def _crossed(e: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sums (2 L,) of products of residuals and torques 1 … L windows later, and variances."""
    count = e.shape[1] - _LAGS
    products = [e[:, :count] * y[:, lag : lag + count] for lag in range(1, _LAGS + 1)]
    later = np.concatenate(products).T
    return later.sum(axis=0), np.diag(long_run_variance(later)[0])


def with_feedback_noted(fit: Fit, problem: Problem) -> Fit:
    """A fit by instruments, with a warning where it is the torque and answers the motion."""
    answers = None if followed(problem) else feedback(fit, problem, level("FEEDBACK"))
    return fit.noted(answers) if answers else fit


def unshrunk(fit: Fit, name: str) -> Fit:
    """The fit of the same likelihoods with one term's parameter free of its prior.

    A parameter far outside its prior is drawn back into it, and the residual that this leaves makes
    every error bar wider: what is free shows what the logs say of it.
    """
    prior, shrinkage = fit.prior, fit.shrinkage
    if prior is None or shrinkage is None or name not in shrinkage.names:
        return fit
    silent = prior.silent_on((name,)), shrinkage.silent_on((name,))
    return solved_anew(fit, fit.shared, *silent)


def of_passive_joint(problem: Problem) -> Fit | None:
    """Parameters of an arm with a joint that has no motor, by windowed instruments.

    The equation of such a joint has no torque that scales it: constants near nothing solve it, and
    where friction and cables pull nearly as hard as the arm's load, its residual draws least
    squares there. Instruments are not drawn: a motion simulated from the other joint's torque holds
    nothing of what pulls, so that at the true constants its products with the residual vanish in
    the mean, and the joint with a motor sets the scale. The constants that it is simulated with
    need the right ratios and no scale: least squares with equal weights has them.

    Parameters
    ----------
    problem : Problem
        Of unloaded logs, with a linear model and no delay to estimate.

    Returns
    -------
    Fit or None
        None where instruments do not converge, or end at constants near nothing or that physics
        forbids.
    """
    start = weak.fit(problem)
    normals = weak.normals_of(problem)
    total = np.sum([normal.total for normal in normals], axis=(0, 1))
    start = replace(start, values=scaled_pinv(total[:-1, :-1]) @ total[:-1, -1])
    better = instruments.fit(problem, start)
    if not better.converged:
        return None
    for one in broken_bounds(better):
        if one.distance is None or one.distance > better.quantile:
            return None
    if undriven(better, problem) is not None:
        return None
    return better.noted(Notice("INSTRUMENTS", numbers={"case": "passive"}))
