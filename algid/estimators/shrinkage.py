"""Shrink the torque's terms toward physics: an empirical-Bayes prior in physical scales.

To choose terms is to set some of them to zero, and another half of the logs sets others to zero.
Here every term stays, with a normal prior whose spread is estimated and never exceeds what a real
arm may have (Efron & Morris 1973). All logs' scores disagree by more than white noise explains;
the information is divided by that factor first.

    H = S / φ + Λ,   p = H⁻¹ (g / φ + Λ m),   Λ = diag(1 / τ²)
            τ_t² / s² = min(1, (Σ ((p - m)² + H⁻¹) / s² + u²) / (n + 1))   for n coefficients a term

As one more coefficient stands the usual spread, u = ½ of the largest one: without it a spread
falls to nothing or stays open by chance, which would be a choice again.

======  ===============================================================  =========  ===============
symbol  name                                                             shape      unit
======  ===============================================================  =========  ===============
S, g    information and score of all logs                                (Q, Q), Q  1 / (unit unit)
p       shared parameters where prior and logs meet                      (Q,)       mixed
m, s    the prior's mean, and the spread that physics allows, of a term  (m,)       its own
τ       the spread that the logs show, at most s                         (m,)       its own
φ       overdispersion: variance of the scores over the information      scalar     1
======  ===============================================================  =========  ===============
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray, keep_arrays
from algid.estimators.combine import (
    LogInformation,
    Prior,
    by_kind,
    combine,
    jackknife,
    long_run_variance,
    scaled_pinv,
    scores_of,
)
from algid.estimators.parametrisation import Shared

_STEPS = 200
_SETTLED = 1e-3  # change of log τ
_LEAST = 1e-4  # of s: a spread that counts as nothing
_PRIOR_LOGS = 4.0  # logs that the white information counts as, beside the scores' own scatter
_FEWEST = 3  # logs whose scatter shows an overdispersion


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


def dispersion(shared: Shared, logs: Sequence[LogInformation], beta: FloatArray) -> float:
    """φ at `beta` (Q,), 1 at least.

    Notes
    -----
    The larger of tr(S⁻¹ M) / q, M the long-run variance of the scores within logs, and tr(S⁻¹ Σ s
    sᵀ) n / (n - 1) / q over the scores s of n logs of a kind, where there are `_FEWEST` or more.
    """
    size = len(shared.names)
    S, within = np.zeros((size, size)), np.zeros((size, size))
    among, informed = np.zeros((size, size)), np.zeros((size, size))
    for kind in (False, True):
        scores = []
        own = np.zeros((size, size))
        for log in logs:
            if log.loaded is not kind:
                continue
            T, by_stretch = scores_of(shared, log, beta)
            within += T.T @ long_run_variance(by_stretch)[0] @ T
            own += T.T @ log.total[0] @ T
            scores.append(by_stretch.sum(axis=0) @ T)
        S += own
        if len(scores) >= _FEWEST:
            among += len(scores) / (len(scores) - 1) * np.transpose(scores) @ np.array(scores)
            informed += own
    ratios = [float(np.sum(scaled_pinv(S) * within)) / _rank(S)]
    if informed.any():
        ratios.append(float(np.sum(scaled_pinv(informed) * among)) / _rank(informed))
    return max(1.0, *ratios)


def _rank(S: FloatArray) -> int:
    return max(1, int(np.sum(np.diag(S) > 0)))


def divided(logs: Sequence[LogInformation], phi: float) -> list[LogInformation]:
    """Each log's likelihood with its information divided by `phi`."""
    return [replace(log, S=log.S / phi, g=log.g / phi) for log in logs]


def joined(first: Prior | None, second: Prior) -> Prior:
    """What two priors on different parameters know together."""
    if first is None:
        return second
    size = len(first.names)
    precision = np.zeros((size + len(second.names),) * 2)
    precision[:size, :size], precision[size:, size:] = first.precision, second.precision
    mean = np.concatenate([first.mean, second.mean])
    return Prior(first.names + second.names, mean, precision, first.absent + second.absent)


def shrink(
    shared: Shared,
    logs: Sequence[LogInformation],
    beta: FloatArray,
    expected: Expected,
    share: FloatArray,
    known: Prior | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Parameters p (Q,) and spread shares τ / s (m,) by expectation and maximisation.

    The iteration starts at `beta` and `share`.

    Parameters
    ----------
    shared : Shared
    logs : each log's quadratic likelihood, divided by φ
    beta : (Q,)
    expected : Expected
    share : (m,), in 0 … 1
    known : Prior, optional
        What an earlier result knows of other parameters.
    """
    places = list(map(shared.names.index, expected.names))
    terms = np.array(expected.terms)
    logs, _ = by_kind(logs)
    for _ in range(_STEPS):
        beta, H, _ = combine(shared, logs, beta, joined(known, expected.prior(share)))
        variance = np.diag(scaled_pinv(H))[places]
        square = ((beta[places] - expected.mean) ** 2 + variance) / expected.spread**2
        better = np.empty(len(terms))
        for place, (term, usual) in enumerate(zip(terms, expected.usual, strict=True)):
            better[place] = _share(square[terms == term], usual)
        change = float(np.max(np.abs(np.log(better / np.maximum(share, _LEAST))), initial=0.0))
        share = better
        if change < _SETTLED:
            break
    beta, _, _ = combine(shared, logs, beta, joined(known, expected.prior(share)))
    return beta, share


def _share(squares: FloatArray, usual: float) -> float:
    """Share of s from n squares of a term, and one more of the size `usual` that it shrinks to."""
    return min(1.0, float(np.sqrt((np.sum(squares) + usual**2) / (squares.size + 1))))


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariances (Q, Q) of p: by what is left out, by the logs' scores, by stretches.

    `freedom` is of the last.
    """

    jackknife: FloatArray | None
    scores: FloatArray
    stretches: FloatArray
    freedom: int


def spread(
    shared: Shared,
    logs: Sequence[LogInformation],
    beta: FloatArray,
    prior: Prior,
    without: FloatArray,
) -> Spread:
    """How far p may be from the truth.

    Parameters
    ----------
    shared : Shared
    logs : each log's quadratic likelihood, divided by φ
    beta : (Q,), p
    prior : Prior
        With the estimated spreads.
    without : (n, Q)
        The parameters without each log, with the same spreads and φ.

    Notes
    -----
    All are H⁻¹ (meat + Λ) H⁻¹, Λ for what the prior's mean is off. The meat is, of n logs of a
    kind with scores s, w n / (n - 1) Σ s sᵀ + (1 - w) S with w = (n - 1) / (n - 1 +
    `_PRIOR_LOGS`): the scatter of few scores is drawn to the information; or the long-run variance
    of the stretches' scores; or what moves as logs are left out.
    """
    size = len(shared.names)
    precision = np.zeros((size, size))
    places = prior.places(shared.names)
    precision[np.ix_(places, places)] = prior.precision
    meat, long_run, S = (np.zeros((size, size)) for _ in range(3))
    stretches = 0
    for kind in (False, True):
        scores, own = [], np.zeros((size, size))
        for log in logs:
            if log.loaded is not kind:
                continue
            T, by_stretch = scores_of(shared, log, beta)
            variance, lags = long_run_variance(by_stretch)
            long_run += T.T @ variance @ T
            stretches += len(by_stretch) // (lags + 1)
            own += T.T @ log.total[0] @ T
            scores.append(by_stretch.sum(axis=0) @ T)
        S += own
        n = len(scores)
        weight = 0.0
        if n > 1:
            weight = (n - 1) / (n - 1 + _PRIOR_LOGS)
            meat += weight * n / (n - 1) * np.transpose(scores) @ np.array(scores)
        meat += (1 - weight) * own
    inverse = scaled_pinv(S + precision)
    freedom = max(2, stretches - _rank(S))
    moved = jackknife(logs, without)
    if moved is not None:
        moved = moved + inverse @ precision @ inverse
    return Spread(
        moved,
        inverse @ (meat + precision) @ inverse,
        inverse @ (long_run * (max(stretches, freedom + 1) / freedom) + precision) @ inverse,
        freedom,
    )
