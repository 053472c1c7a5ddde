"""Information of logs on the shared parameters: quadratic likelihoods that add up.

======  ===================================================  =========  =================
symbol  name                                                 shape      unit
======  ===================================================  =========  =================
S       information on a log's coefficients, by stretch      (B, q, q)  1 / (unit unit)
g       score at the coefficients `c0`, by stretch           (B, q)     1 / unit
======  ===================================================  =========  =================

Near c0 the log-likelihood is g·(c − c0) − ½ (c − c0)ᵀ S (c − c0). Both are kept by stretch, in
bounded memory, because the stretches' disagreement shows the error that white noise does not
explain. When the stretches become too many, neighbours are added up.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from operator import add
from typing import Protocol, TypeVar

import numpy as np

from algid.arm import FloatArray, keep_arrays, read_only
from algid.base.names import outside, places_outside
from algid.estimators.parametrisation import Shared

RANK_TOLERANCE = 1e-13  # relative eigenvalue of the scaled information that counts as nothing
_STEPS = 60
_DONE = 1e-10  # change of the log-likelihood at which the quadratic problem counts as solved


@dataclass(frozen=True, eq=False)
class LogInformation:
    """One log's quadratic likelihood: see the module's table."""

    loaded: bool
    c0: FloatArray
    S: FloatArray
    g: FloatArray

    def __post_init__(self) -> None:
        keep_arrays(self)

    @cached_property
    def total(self) -> tuple[FloatArray, FloatArray]:
        """S (q, q) and g (q,) over the whole log."""
        return read_only(self.S.sum(axis=0)), read_only(self.g.sum(axis=0))

    def about(self, c: FloatArray) -> LogInformation:
        """The same likelihood, with its score at other coefficients `c` (q,)."""
        return LogInformation(self.loaded, c, self.S, self.g - self.S @ (c - self.c0))

    def scaled(self, share: float) -> LogInformation:
        """The likelihood of so large a share of the log."""
        return LogInformation(self.loaded, self.c0, share * self.S, share * self.g)


@dataclass(frozen=True, eq=False)
class Prior:
    """Gaussian prior of the first parameters: mean (p,) and precision (p, p).

    The precision is zero along directions that are not known.

    Those of the names that are `absent` are nothing, by what the torque is said to hold.
    """

    names: tuple[str, ...]
    mean: FloatArray
    precision: FloatArray
    absent: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        keep_arrays(self)

    @classmethod
    def of(cls, names: tuple[str, ...], mean: FloatArray, covariance: FloatArray) -> Prior:
        """The knowledge that an estimate `mean` (p,) with `covariance` (p, p) holds."""
        return cls(names, mean, scaled_pinv(covariance))

    def places(self, names: Sequence[str]) -> list[int]:
        """Where its parameters stand among `names`."""
        return list(map(names.index, self.names))

    def silent_on(self, names: Collection[str]) -> Prior:
        """The same without parameters that do not correlate with others, or are known better."""
        kept = places_outside(self.names, names)
        precision = self.precision[np.ix_(kept, kept)]
        absent = outside(self.absent, names)
        return Prior(outside(self.names, names), self.mean[kept], precision, absent)


def joined(first: Prior | None, second: Prior) -> Prior:
    """What two priors on different parameters know together."""
    if first is None:
        return second
    between = np.zeros((len(first.names), len(second.names)))
    precision = np.block([[first.precision, between], [between.T, second.precision]])
    mean = np.concatenate([first.mean, second.mean])
    return Prior(first.names + second.names, mean, precision, first.absent + second.absent)


_NOTHING = 1e-6  # standard deviation of what is absent, in its unit: far below any estimate's


def without(prior: Prior | None, absent: tuple[str, ...]) -> Prior | None:
    """What is known beforehand where the parameters `absent` are nothing."""
    if not absent:
        return prior
    none = Prior(absent, np.zeros(len(absent)), np.eye(len(absent)) / _NOTHING**2, absent)
    return joined(None if prior is None else prior.silent_on(absent), none)


def scaled_pinv(S: FloatArray, tolerance: float = RANK_TOLERANCE) -> FloatArray:
    """Pseudo-inverse of a symmetric matrix, scaled to unit diagonal so that units do not matter.

    Parameters
    ----------
    S : (Q, Q)
        A row whose diagonal is not positive counts as nothing.
    tolerance : float
        Eigenvalues of the scaled matrix below this share of the largest count as nothing.

    Returns
    -------
    (Q, Q), zero along what counts as nothing
    """
    size = np.sqrt(np.maximum(np.diag(S), 0.0))
    inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    values, vectors = np.linalg.eigh(S * np.outer(inverse, inverse))
    size = np.abs(values)
    kept = size > tolerance * size.max(initial=0.0)
    half = inverse[:, None] * vectors[:, kept]
    return (half / values[kept]) @ half.T


def combine(
    shared: Shared, logs: Sequence[LogInformation], beta: FloatArray, prior: Prior | None = None
) -> tuple[FloatArray, FloatArray, float]:
    """Most likely shared parameters by damped Gauss-Newton on the sum of quadratic likelihoods.

    Parameters
    ----------
    shared : Shared
    logs : each log's quadratic likelihood
    beta : (Q,)
        Where it starts; directions without information keep these values.
    prior : Prior, optional

    Returns
    -------
    beta (Q,), its information (Q, Q), and the log-likelihood there less that of each kind's logs at
    the coefficients c0 of the first
    """
    damping = 0.0
    logs = by_kind(logs)
    value, gradient, S = likelihood(shared, logs, beta, prior)
    for _ in range(_STEPS):
        step = scaled_pinv(S + damping * np.diag(np.diag(S))) @ gradient
        trial = likelihood(shared, logs, beta + step, prior)
        if not np.isfinite(trial[0]) or trial[0] < value - 1e-9 * (1 + abs(value)):
            damping = max(10 * damping, 1e-3)
            if damping > 1e12:
                break
            continue
        gain = float(gradient @ step)
        beta = beta + step
        damping = damping / 10 if damping > 1e-6 else 0.0
        value, gradient, S = trial
        if gain < _DONE and damping == 0.0:
            break
    return beta, S, value


class OfLog(Protocol):
    """What belongs to a log."""

    @property
    def loaded(self) -> bool:
        """Whether that is a loaded one."""
        ...


OneOfLog = TypeVar("OneOfLog", bound=OfLog)


def of_kind(logs: Iterable[OneOfLog], loaded: bool) -> list[OneOfLog]:
    """Those of the logs that are loaded, or those that are not."""
    return [log for log in logs if log.loaded is loaded]


def by_kind(logs: Iterable[LogInformation]) -> list[LogInformation]:
    """Unloaded and loaded logs in one sum each, at the coefficients c0 of the first."""
    sums = []
    for loaded in (False, True):
        own = of_kind(logs, loaded)
        if own:
            S, g = map(np.stack, zip(*(log.total for log in own), strict=True))
            change = own[0].c0 - np.stack([log.c0 for log in own])
            score = g.sum(axis=0) - np.einsum("lij,lj->i", S, change)
            sums.append(LogInformation(loaded, own[0].c0, S.sum(axis=0)[None], score[None]))
    return sums


def likelihood(
    shared: Shared, logs: Iterable[LogInformation], beta: FloatArray, prior: Prior | None
) -> tuple[float, FloatArray, FloatArray]:
    """Log-likelihood of shared parameters `beta` (Q,).

    Returns
    -------
    Its value less that at the logs' own coefficients c0, its gradient Tᵀ (g − S (c − c0)) of shape
    (Q,), and its information Tᵀ S T of shape (Q, Q), T = dc/dβ; the prior's with them.
    """
    size = len(shared.names)
    value, gradient, information = 0.0, np.zeros(size), np.zeros((size, size))
    for log in logs:
        T = shared.jacobian(beta, log.loaded)
        change = shared.coefficients(beta, log.loaded) - log.c0
        S, g = log.total
        value += float(g @ change - 0.5 * change @ S @ change)
        gradient += T.T @ (g - S @ change)
        information += T.T @ S @ T
    if prior is not None:
        places = prior.places(shared.names)
        change = beta[places] - prior.mean
        value -= 0.5 * float(change @ prior.precision @ change)
        gradient[places] -= prior.precision @ change
        information[np.ix_(places, places)] += prior.precision
    return value, gradient, information


def scores_of(
    shared: Shared, log: LogInformation, beta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """T = dc/dβ, and the scores (B, q) of a log's stretches at `beta` (Q,)."""
    own = log.about(shared.coefficients(beta, log.loaded))
    return shared.jacobian(beta, log.loaded), own.g


@dataclass(frozen=True, eq=False)
class Scatter:
    """How the scores of the logs of one kind scatter at shared parameters.

    Parameters
    ----------
    S : (Q, Q), the information of all of them
    within : (Q, Q), long-run variance of the sum of the stretches' scores
    each : (n, Q), each log's score
    stretches : how many stretches of log are independent
    """

    S: FloatArray
    within: FloatArray
    each: FloatArray
    stretches: int

    def among(self, logs: float = 0.0) -> FloatArray:
        """Variance (Q, Q) of the sum of the logs' scores, by how n of them differ.

        It is w n / (n - 1) Σ s sᵀ + (1 - w) S, w = (n - 1) / (n - 1 + `logs`): the scatter of few
        scores s is drawn to the information, as if that were so many logs.
        """
        n = len(self.each)
        weight = (n - 1) / (n - 1 + logs)
        return np.asarray(
            weight * n / max(1, n - 1) * self.each.T @ self.each + (1 - weight) * self.S
        )


def scatters(shared: Shared, logs: Sequence[LogInformation], beta: FloatArray) -> list[Scatter]:
    """The scatter at `beta` (Q,) of unloaded and of loaded logs, where there are any."""
    found = []
    for kind in (False, True):
        own = of_kind(logs, kind)
        S, within = (np.zeros((len(shared.names),) * 2) for _ in range(2))
        each, stretches = [], 0
        for log in own:
            T, scores = scores_of(shared, log, beta)
            variance, lags = long_run_variance(scores)
            S += T.T @ log.total[0] @ T
            within += T.T @ variance @ T
            each.append(scores.sum(axis=0) @ T)
            stretches += len(scores) // (lags + 1)
        if own:
            found.append(Scatter(S, within, np.array(each), stretches))
    return found


def sandwich(kinds: Sequence[Scatter]) -> tuple[FloatArray, int]:
    """Covariance of the sum of all logs' scores, allowing for coloured residuals.

    Returns
    -------
    meat : (Q, Q), in the units of the information
    freedom : int
        Independent stretches of log less parameters, at least 2; the covariance is larger by their
        ratio.

    Notes
    -----
    Between the inverses of the information it makes the sandwich of White 1982 and Newey & West
    1987.
    """
    stretches = sum(kind.stretches for kind in kinds)
    freedom = max(2, stretches - rank(np.sum([kind.S for kind in kinds], axis=0)))
    within = np.sum([kind.within for kind in kinds], axis=0)
    return within * (max(stretches, freedom + 1) / freedom), freedom


def rank(S: FloatArray) -> int:
    """How many parameters the information (Q, Q) tells anything of, at least one."""
    return max(1, int(np.sum(np.diag(S) > 0)))


def left_out(
    shared: Shared, logs: Sequence[LogInformation], beta: FloatArray, prior: Prior | None = None
) -> FloatArray:
    """Shared parameters (n, Q) without each of n logs in turn, from `beta` and no further pass.

    The others are the sums before and behind it: in a difference of sums one log that informs 1e16
    times as much as they do would leave its rounding.
    """
    nothing = list[LogInformation]()
    before, behind = (
        list(accumulate(own, lambda sums, log: by_kind([*sums, log]), initial=nothing))
        for own in (logs, logs[::-1])
    )
    estimates = []
    for others in map(add, before, behind[-2::-1]):
        estimates.append(combine(shared, others, beta, prior)[0])
    return np.array(estimates)


FEWEST_LOGS = 4
"""Logs from which on leaving them out shows how far an estimate moves."""


def jackknife(logs: Sequence[LogInformation], without: FloatArray) -> FloatArray:
    """Covariance (Q, Q) of an estimate from how it moves as logs are left out.

    Parameters
    ----------
    logs : n of them
    without : (n, Q), estimates without each log: see `left_out`

    Notes
    -----
    Tukey's jackknife, stratified by kind of log (Wolter 2007, eq. 4.5.3): Σ_h (n_h − 1)/n_h Σ_i
    (β_(hi) − β̄_h)². What differs from run to run is in it. A kind of which there is one log alone
    adds nothing.
    """
    covariance = np.zeros((without.shape[1], without.shape[1]))
    loaded = np.array([log.loaded for log in logs])
    for kind in (without[~loaded], without[loaded]):
        if len(kind) > 1:
            moved = kind - kind.mean(axis=0)
            covariance += (1 - 1 / len(kind)) * moved.T @ moved
    return covariance


MOST_BLOCKS = 4096


class BlockSums:
    """Sums (B, ...) over consecutive stretches, B at most `2 * MOST_BLOCKS`."""

    def __init__(self) -> None:
        self._sums: list[FloatArray] = []
        self._factor = 1  # stretches in a sum
        self._missing = 0  # of them that the last sum still lacks

    def add(self, blocks: FloatArray) -> None:
        """Append the sums (b, ...) of the next b stretches."""
        for block in blocks:
            if self._missing:
                self._sums[-1] += block
                self._missing -= 1
                continue
            if len(self._sums) == 2 * MOST_BLOCKS:
                self._sums = list(map(add, self._sums[::2], self._sums[1::2]))
                self._factor *= 2
            self._sums.append(block.copy())
            self._missing = self._factor - 1

    def values(self) -> FloatArray:
        """All sums (B, ...) in time order; the last stretch may be shorter.

        Raises
        ------
        ValueError
            If nothing was added.
        """
        return np.stack(self._sums)


def long_run_variance(scores: FloatArray) -> tuple[FloatArray, int]:
    """Covariance of the sum of correlated scores and the lags used.

    Parameters
    ----------
    scores : (B, q), in time order, with zero sum at the estimate

    Returns
    -------
    (q, q) covariance of the sum, and the number of lags of Bartlett's window

    Notes
    -----
    Newey & West 1987 with the bandwidth of Andrews 1991, eq. (6.2) and (6.4), from a first-order
    autoregression.
    """
    count = len(scores)
    power = np.sum(scores**2, axis=0)
    size = np.sqrt(power)
    usable = scores * np.divide(1.0, size, out=np.zeros_like(size), where=power > 0)
    rho = np.clip(np.sum(usable[1:] * usable[:-1], axis=0), -0.97, 0.97)
    # α(1) with unit weights: each score was scaled to unit power above.
    numerator = np.sum(4 * rho**2 / ((1 - rho) ** 6 * (1 + rho) ** 2))
    persistence = numerator / max(float(np.sum((power > 0) / (1 - rho) ** 4)), 1e-300)
    lags = int(min(1.1447 * (persistence * count) ** (1 / 3), count / 4))
    total = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = (1 - lag / (lags + 1)) * scores[lag:].T @ scores[: count - lag]
        total += cross + cross.T
    return total, lags
