"""Whether least squares is valid: tests for endogenous torque and for feedback from the motion.

Torque that the model lacks drives the motion, and least squares is attenuated by it. Instruments
(`algid.estimators.instruments`) are not, as long as they do not answer that torque: the logged
reference of a controller never does, the measured torque does not in open loop. Both are compared
with the same terms and the same prior, and the residual with the torque after it:

    h  = dᵀ V⁻¹ d,   d = β_instruments − β_least squares          χ² of the number of constants
    r_l = Σ e(t) y(t + l) / (Σ_k N γ_e(k) γ_y(k))^½               normal, where no torque answers

V is the long-run variance of the difference of both estimates' influences, window by window
(Durbin, Wu & Hausman, in the form that needs no efficient estimate: Wooldridge 2010, §6.3.1); the
variance of a cross-correlation is Bartlett's 1946. Instruments stand in place of least squares
where h shows that they differ, the instrument does not answer, and a constant moves by its own
standard deviation: below that an interval loses less than 5 points of its coverage.

======  =======================================================  ==========  =================
symbol  name                                                     shape       unit
======  =======================================================  ==========  =================
e, y    residual of the instruments' windows, torque's moment    (2, R)      N m
γ       autocovariances, lag by lag                              (K, 2)      (N m)²
======  =======================================================  ==========  =================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.base.compiled import chi2_tail
from algid.base.significance import LEVEL, chance
from algid.estimators import instruments, weak
from algid.estimators.combine import combine, long_run_variance, scaled_pinv, scores_of
from algid.estimators.fit import Fit
from algid.estimators.references import Following, followed
from algid.estimators.repeats import merged, shared_out
from algid.estimators.shrinkage import dispersion, divided
from algid.estimators.shrunk import resting
from algid.estimators.shrunk_fit import concluded
from algid.estimators.weak import Source, WeakSettings
from algid.model import RIGID
from algid.notices import Notice, Remedy

ANSWERS = 0.01
"""p value of feedback below which instruments do not replace a biased least squares."""
MOVES = 1.0  # standard deviations of a constant that are worth another estimator
_NEAR = 0.5  # of them: nearer, instruments are not simulated again
_LAGS = 8  # steps between windows, two windows in all
_MEMORY = 40  # lags of the autocovariances


@dataclass(frozen=True)
class Exogeneity:
    """What the tests say.

    Parameters
    ----------
    distance : how far a constant moves, in standard deviations of the instruments, at most
    moved : the same in standard deviations of least squares
    same : chance of such a difference where the torque is exogenous
    silent : chance of such correlations where the torque does not answer the motion
    """

    distance: float
    moved: float
    same: float
    silent: float

    @property
    def endogenous(self) -> bool:
        """Whether least squares is off by more than its error bars take in."""
        return self.same < LEVEL and self.moved > MOVES

    @property
    def answers(self) -> bool:
        """Whether the measured torque answers the motion, so that it is no instrument."""
        return self.silent < ANSWERS


def settled(
    fit: Fit, unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings
) -> Fit:
    """The fit of shrunk terms, by instruments where the torque is endogenous and there is one.

    A reference that the logs hold and the arm follows is one, else a torque that answers nothing.

    Parameters
    ----------
    fit : Fit
        By least squares.
    unloaded, loaded : sequences of callables
        Each gives a fresh iterable of `Segment`.
    settings : WeakSettings
        Of the fit: window, bandwidth and hold; model and delay are the fit's.
    """
    settings = resting(unloaded, loaded, settings)
    following = followed(list(unloaded) + list(loaded), settings)
    corrected = instrumented(fit, fit.values, unloaded, loaded, settings, following)
    if corrected is None:
        return fit
    if _moved(corrected, fit) > _NEAR:
        better = instrumented(fit, corrected.values, unloaded, loaded, settings, following)
        corrected = better or corrected
    tests = examined(corrected, fit, unloaded, loaded, settings)
    fit = replace(fit, endogeneity=tests.distance)
    if not tests.endogenous:
        return fit
    if following is None and tests.answers:
        return fit.noted(feedback(tests.silent))
    case = "torque" if following is None else "reference"
    note = Notice("INSTRUMENTS", numbers={"case": case, "distance": tests.moved})
    return replace(corrected, endogeneity=tests.distance, notes=fit.notes).noted(note)


def watched(
    fit: Fit, unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings
) -> Fit:
    """A fit by instruments, with a warning where it is the torque and answers the motion."""
    if followed(list(unloaded) + list(loaded), settings) is not None:
        return fit
    silent = _silent(fit, unloaded, loaded, settings)
    if silent >= LEVEL:
        return fit
    return fit.noted(feedback(silent))


def feedback(p_value: float) -> Notice:
    """That the measured torque answers what the model lacks."""
    remedy = Remedy({"estimator": "weak"}, "to compare")
    return Notice("FEEDBACK", numbers={"p_value": p_value}, remedies=(remedy,))


def instrumented(
    fit: Fit,
    at: FloatArray,
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
    following: Following | None = None,
) -> Fit | None:
    """The fit's parameters by instruments simulated at `at` (Q,), with its terms and its prior.

    Or along the motion that a reference explains, where the arm is `following` one. None where the
    windows cannot be simulated.
    """
    shared = fit.shared
    settings, base = _of(fit, settings)
    logs = []
    for kind, sources in ((False, unloaded), (True, loaded)):
        if not sources:  # without loaded logs there is no payload among the parameters
            continue
        c0 = shared.coefficients(at, kind)
        c = c0.copy()
        if shared.delay:
            c[-1] -= base  # the windows are shifted by it: the column is a change's
        for sums in instruments.moments(sources, settings, c, following=following):
            if sums is None or instruments.gone_astray(sums):
                return None
            if sums.rows:
                logs.append(replace(instruments.projected(sums, c, kind), c0=c0))
    if len(logs) != len(fit.logs) or fit.prior is None or fit.shrinkage is None:
        return None
    logs = shared_out(logs, fit.repeats)
    scaled = divided(logs, dispersion(shared, merged(logs, fit.repeats), at))
    by_instruments = concluded(shared, scaled, at, fit.prior, fit.shrinkage, fit.moved, fit.repeats)
    return replace(by_instruments, estimator="instruments")


def examined(
    better: Fit,
    least: Fit,
    unloaded: Sequence[Source],
    loaded: Sequence[Source],
    settings: WeakSettings,
) -> Exogeneity:
    """The tests on estimates by instruments and by least squares."""
    places = np.flatnonzero(np.isin(least.names, RIGID) & np.isfinite(better.std + least.std))
    if not places.size:
        return Exogeneity(0.0, 0.0, 1.0, 1.0)
    away = (better.values - least.values)[places]
    V = np.zeros_like(better.covariance)
    for one, other in zip(_influences(better), _influences(least), strict=True):
        V = V + _variance(one, other)
    h = float(away @ scaled_pinv(V[np.ix_(places, places)]) @ away)
    same = float(chi2_tail(places.size, max(h, 0.0)))
    distance = float(np.max(np.abs(away) / better.std[places]))
    silent = _silent(better, unloaded, loaded, settings)
    return Exogeneity(distance, _moved(better, least), same, silent)


def _moved(better: Fit, least: Fit) -> float:
    """How far a constant moves at most, in standard deviations of least squares."""
    known = np.isin(least.names, RIGID) & np.isfinite(least.std)
    away = np.abs(better.values - least.values)[known]
    return float(np.max(away / least.std[known], initial=0.0))


def _of(fit: Fit, settings: WeakSettings) -> tuple[WeakSettings, float]:
    """The settings with the fit's model and delay, and that delay in s."""
    shared = fit.shared
    base = settings.shift.delay
    if fit.delay is not None:
        base = fit.delay
    own = replace(settings.delayed(base), model=shared.model, estimate_delay=shared.delay)
    return own, base


def _influences(fit: Fit) -> list[FloatArray]:
    """What the stretches (B, Q) of each log move the estimate by."""
    _, H, _ = combine(fit.shared, fit.logs, fit.values, fit.prior)
    inverse = scaled_pinv(H)
    influences: list[FloatArray] = []
    for log in fit.logs:
        T, scores = scores_of(fit.shared, log, fit.values)
        influences.append(scores @ T @ inverse)
    return influences


def _variance(one: FloatArray, other: FloatArray) -> FloatArray:
    """Variance (Q, Q) of the sum of a difference of influences.

    Of the first alone where stretches differ.
    """
    if one.shape == other.shape:
        one = one - other
    variance, _ = long_run_variance(one)
    return variance


def _silent(
    fit: Fit, unloaded: Sequence[Source], loaded: Sequence[Source], settings: WeakSettings
) -> float:
    """Bonferroni p value of the residual's correlations with later torques without feedback."""
    settings, _ = _of(fit, settings)
    settings = replace(settings, estimate_delay=False)
    products, variance = np.zeros((_LAGS, 2)), np.zeros(2)
    for kind, sources in ((False, unloaded), (True, loaded)):
        for source in sources:
            c = fit.shared.coefficients(fit.values, kind)[: len(settings.model.names)]
            e, y = _residual(source, settings, c)
            if e.shape[1] > 2 * _LAGS:
                own, spread = _crossed(e, y)
                products, variance = products + own, variance + spread
    if not np.all(variance > 0):
        return 1.0
    largest = float(np.max(np.abs(products) / np.sqrt(variance)))
    return chance(largest, products.size)


def _residual(
    source: Source, settings: WeakSettings, c: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals and torques' moments (2, R) of a log's windows, less their means."""
    rows = [np.empty((4, 0))]
    for piece, windows, _ in weak.overlapping(source(), settings):
        X = windows.equations(settings.model, piece, False, c)
        residual = X[:, -1] - np.einsum("q,aqr->ar", c, X[:, :-1])
        rows.append(np.concatenate([residual, X[:, -1]]))
    every = np.concatenate(rows, axis=1)
    if every.shape[1]:
        every = every - every.mean(axis=1, keepdims=True)
    return every[:2], every[2:]


def _crossed(e: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sums (L, 2) of products of residuals and torques l = 1 … L windows later; variances (2,)."""
    count = e.shape[1]
    memory = min(_MEMORY, count // 3)

    def products(x: FloatArray, later: FloatArray, lags: range) -> FloatArray:
        """Sums (lags, 2) of products of one signal and another, `lags` windows later."""
        return np.array([np.sum(x[:, : count - lag] * later[:, lag:], axis=1) for lag in lags])

    covariance_e = products(e, e, range(memory)) / count
    covariance_y = products(y, y, range(memory)) / count
    both = covariance_e * covariance_y
    variance = count * np.maximum(both[0] + 2 * both[1:].sum(axis=0), both[0])
    return products(e, y, range(1, _LAGS + 1)), variance
