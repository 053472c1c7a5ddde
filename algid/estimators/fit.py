"""Result of a statistical estimator: estimates, their covariance, and how far to trust them.

A fit's logs are quadratic likelihoods by stretch of time; those up to a moment add up as all of
them do, to what the estimator had found by then.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from algid.arm import FloatArray, keep_arrays, read_only
from algid.base.compiled import student_quantile
from algid.base.names import named_values, vector
from algid.base.significance import NORMAL
from algid.estimators.combine import (
    FEWEST_LOGS,
    LogInformation,
    Prior,
    combine,
    jackknife,
    left_out,
    likelihood,
    sandwich,
    scaled_pinv,
    scatters,
)
from algid.estimators.identifiability import (
    examine,
    open_directions,
)
from algid.estimators.innovations import ResidualSums
from algid.estimators.parametrisation import Shared
from algid.estimators.repeats import Groups, merged
from algid.estimators.whitening import NoiseLevels
from algid.model import DELAYS
from algid.notices import Notice, has_code

if TYPE_CHECKING:
    from algid.estimators.misfit import Products

Status = Literal["OK", "NOT_IDENTIFIABLE", "NOT_CONVERGED", "WEAK_EXCITATION", "FROM_PRIOR"]
Intervals = Literal["likelihood", "sandwich", "jackknife"]


@dataclass(frozen=True, eq=False)
class Fit:
    """Estimates of the shared parameters.

    Parameters
    ----------
    estimator : name of the estimator
    shared : Shared
        Which parameters, in which order.
    values : (Q,), in `algid.model.UNITS`
    covariance : (Q, Q)
        As wide as the logs leave it where a parameter is not identifiable; see `std`.
    intervals : "likelihood", "sandwich" or "jackknife"
        What `covariance` rests on: white noise; blocks of the logs; or the larger of that and of
        the jackknife over four logs or more, in which what differs from run to run is.
    quantile : float
        Half width of a 95 % interval in standard deviations, normal or Student's.
    status : Q words of `Status`
    unidentifiable : what the logs leave open
    logs : each log's quadratic likelihood, unloaded ones first
    noise : each log's noise levels; None for the weak estimator
    residual : sums over the innovations, log by log; empty where they were not gathered
    freedom : independent stretches of log behind a sandwich, else samples of torque
    iterations, converged : of the refined estimator
    endogeneity : distance of instruments from least squares, in standard deviations, or None
    notes : remarks on the fit, such as why the refined estimator returned the weak estimate
    moved : (2,), rad, how far each joint travelled
    shrinkage : the prior's part on the torque's terms; None where none is shrunk
    repeats : places of logs that repeat each other, where that was looked at
    products : what the likelihood at the estimates says of every term, where it was looked at
    """

    estimator: str
    shared: Shared
    values: FloatArray
    covariance: FloatArray
    intervals: Intervals
    quantile: float
    status: tuple[Status, ...]
    unidentifiable: tuple[Notice, ...]
    logs: tuple[LogInformation, ...]
    noise: tuple[NoiseLevels, ...] | None = None
    residual: tuple[ResidualSums, ...] = ()
    freedom: int = 1
    iterations: int = 0
    converged: bool = True
    prior: Prior | None = None
    endogeneity: float | None = None
    notes: tuple[Notice, ...] = ()
    moved: FloatArray = field(default_factory=lambda: np.full(2, np.inf))
    shrinkage: Prior | None = None
    repeats: Groups = ()
    products: Products | None = None

    def __post_init__(self) -> None:
        keep_arrays(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shared parameters."""
        return self.shared.names

    @property
    def delay(self) -> float | None:
        """The torque's delay in s, where it is estimated."""
        delays = self.values[np.isin(self.names, DELAYS)]
        return float(delays[0]) if delays.size else None

    @property
    def absent(self) -> tuple[str, ...]:
        """Parameters that are nothing, by what the torque is said to hold."""
        if self.prior is None:
            return ()
        return self.prior.absent

    @property
    def shrunk(self) -> tuple[str, ...]:
        """Parameters of the torque's terms that a prior holds where the logs do not."""
        return () if self.shrinkage is None else self.shrinkage.names

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of each parameter."""
        pairs = zip(self.values.tolist(), self.std.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def determined(self) -> set[str]:
        """Parameters that the logs determine, but for those that are nothing."""
        known = np.array(self.names)[np.isfinite(self.std)]
        return set(known.tolist()).difference(self.absent)

    @cached_property
    def std(self) -> FloatArray:
        """Standard deviations (Q,): infinite where a parameter is not identifiable."""
        std = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        std[np.array(self.status) == "NOT_IDENTIFIABLE"] = np.inf
        return read_only(std)

    @cached_property
    def each(self) -> tuple[Fit, ...]:
        """What each log tells of its own coefficients, by Student's intervals.

        Few stretches of a short log are independent.
        """
        white = self.freedom if self.intervals == "likelihood" else 0
        found = [alone(self.shared, [log], self.shrinkage, white=white) for log in self.logs]
        return tuple(replace(one, quantile=student_quantile(one.freedom)) for one in found)

    @cached_property
    def with_free_lengths(self) -> Fit:
        """The same likelihoods solved without the given link lengths, where a payload shows them.

        A wrong one moves the constants too.
        """
        if not (self.shared.lengths and self.shared.payload):
            return self
        return solved_anew(self, replace(self.shared, lengths={}), self.prior, self.shrinkage)

    @property
    def ci95(self) -> FloatArray:
        """95 % intervals (Q, 2)."""
        half = self.quantile * self.std
        return np.stack([self.values - half, self.values + half], axis=1)

    def marked(self, status: Status, names: Collection[str] | None = None) -> Fit:
        """The fit with `status` in the place of OK, for the parameters `names`, by default all."""
        chosen = self.names if names is None else names
        marked = [
            status if before == "OK" and name in chosen else before
            for name, before in zip(self.names, self.status, strict=True)
        ]
        return replace(self, status=tuple(marked))

    @property
    def refuted(self) -> bool:
        """True if the refined estimator returned another estimate.

        It rejected its likelihood, or did not converge.
        """
        return has_code(self.notes, "REFUTED", "SLOW_SAMPLING:turn")

    @property
    def beyond_errors(self) -> bool:
        """Whether bounds of physics are broken by what the error bars leave out: see `doubt`."""
        return has_code(self.notes, "HARDLY_DRIVEN:bounds")

    def noted(self, note: Notice) -> Fit:
        """The fit with one more thing to say of it."""
        return replace(self, notes=self.notes + (note,))

    def wald(self, names: Iterable[str]) -> float:
        """Wald statistic of the parameters `names`: their squares in their covariance's units."""
        places = list(map(self.names.index, names))
        values, C = self.values[places], self.covariance[np.ix_(places, places)]
        return float(values @ scaled_pinv(C) @ values)

    def spread(self, share: FloatArray) -> float:
        """Standard deviation of the sum `share` (Q,) @ values.

        Infinite where the logs leave that sum open.

        A sum may be known where its terms are not: k3 + k5 of an arm whose second joint never
        moved.
        """
        if np.any((share != 0) & np.isinf(self.std)):
            _, S, _ = combine(self.shared, self.logs, self.values, self.prior)
            null, size = open_directions(self.names, self.values, S)
            along = null.T @ (share * size)
            if np.linalg.norm(along) > 1e-3 * np.linalg.norm(share * size):
                return float("inf")
            share = share - null @ along / size
        return float(np.sqrt(max(float(share @ self.covariance @ share), 0.0)))


def finish(
    estimator: str,
    shared: Shared,
    logs: Sequence[LogInformation],
    beta: FloatArray,
    moved: FloatArray,
    prior: Prior | None = None,
    *,
    coloured: bool,
    samples: int = 1,
    repeats: Groups = (),
    shrinkage: Prior | None = None,
) -> Fit:
    """Solve for the shared parameters, and attach error bars and statuses.

    Parameters
    ----------
    estimator : name of the estimator
    shared : Shared
    logs : each log's quadratic likelihood
    beta : (Q,)
        Where the solver starts, and what a direction without information keeps.
    moved : (2,), rad
        How far each joint travelled.
    prior : Prior, optional
        All that is known beforehand.
    coloured : bool
        Whether the residuals are not white: error bars then rest on a sandwich, and with
        `FEWEST_LOGS` logs on a jackknife too.
    samples : int
        Independent samples behind error bars that rest on white noise.
    repeats : Groups
        Logs that repeat each other, where that was looked at: one log for sandwich and jackknife.
    shrinkage : Prior, optional
        The prior's part on terms that are shrunk, which physics bounds and no log leaves open.

    Notes
    -----
    Where both a sandwich and a jackknife have a part in the variance, Student's quantile is that
    of the degrees of freedom of Satterthwaite 1946, with the parts' mean share over the
    parameters.

    Beside shrunk terms the covariance is the mean of three, H⁻¹ (M + Λ) H⁻¹ with Λ for what the
    prior's mean is off, as each errs where logs are few: M is what moves as logs are left out, or
    how the logs' scores differ, or the sandwich's.
    """
    beta, S, _ = combine(shared, logs, beta, prior)
    bounded = (prior.absent if prior else ()) + (shrinkage.names if shrinkage else ())
    left_open, white, lacking = examine(shared.names, beta, S, moved, bounded)
    covariance, quantile, freedom = white, NORMAL, samples
    intervals: Intervals = "likelihood"
    if coloured:
        each = merged(logs, repeats) if repeats else logs
        repeated = []
        if len(each) >= FEWEST_LOGS:
            repeated = [jackknife(each, left_out(shared, each, beta, prior))]
        intervals = "jackknife" if repeated else "sandwich"
        kinds, (_, _, before) = scatters(shared, each, beta), likelihood(shared, (), beta, prior)
        meat, freedom = sandwich(kinds)
        inverse = scaled_pinv(S) if shrinkage else white
        of_prior, covariance = inverse @ before @ inverse, inverse @ (meat + before) @ inverse
        if shrinkage:
            among = np.sum([kind.among(_PRIOR_LOGS) for kind in kinds], axis=0)
            moves = [inverse @ among @ inverse, *repeated]
            covariance = np.mean([covariance, *(of_prior + one for one in moves)], axis=0)
            quantile = OF_FEW
        else:
            if estimator == "refined":
                # The long-run variance of a short log errs low: white noise is the least there is.
                covariance = widened(covariance, white)
            within = covariance
            for one in repeated:
                covariance = widened(covariance, one)
            quantile = student_quantile(_satterthwaite(within, covariance, freedom, each))
    return Fit(
        estimator=estimator,
        shared=shared,
        values=beta,
        covariance=covariance,
        intervals=intervals,
        quantile=quantile,
        freedom=freedom,
        status=tuple("NOT_IDENTIFIABLE" if lost else "OK" for lost in lacking),
        unidentifiable=left_open,
        logs=tuple(logs),
        prior=prior,
        moved=moved,
        repeats=repeats,
        shrinkage=shrinkage,
    )


def solved_anew(fit: Fit, shared: Shared, prior: Prior | None, shrinkage: Prior | None) -> Fit:
    """The fit of the same likelihoods by other parameters or another prior.

    It starts from what the fit knows, given lengths included; what is new is zero. The arm's own
    parameters are no surer than they were.
    """
    known = named_values(fit.names, fit.values) | fit.shared.lengths
    anew = finish(
        fit.estimator,
        shared,
        fit.logs,
        vector(shared.names, known, otherwise=0.0),
        fit.moved,
        prior,
        coloured=fit.intervals != "likelihood",
        samples=fit.freedom,
        repeats=fit.repeats,
        shrinkage=shrinkage,
    )
    arm = len(shared.log_names)
    status = [
        own if before == "OK" else before
        for own, before in zip(anew.status[:arm], fit.status, strict=False)
    ]
    return replace(
        anew,
        status=(*status, *anew.status[arm:]),
        noise=fit.noise,
        residual=fit.residual,
        iterations=fit.iterations,
        endogeneity=fit.endogeneity,
        notes=fit.notes,
    )


def alone(
    shared: Shared,
    logs: Sequence[LogInformation],
    prior: Prior | None = None,
    *,
    white: int = 0,
) -> Fit:
    """The fit of a log's own coefficients, `Shared.log_names`, to logs of one kind alone.

    Of residuals that are `white` over so many samples error bars rest on white noise.
    """
    own, plain = Shared(shared.model, shared.delay), [replace(log, loaded=False) for log in logs]
    nowhere = np.full(2, np.inf)
    c0 = logs[0].c0
    return finish("weak", own, plain, c0, nowhere, prior, coloured=not white, samples=white)


OF_FEW = 2.3
"""Half width of a 95 % interval in standard deviations beside shrunk terms: `make run-to-run`."""
_PRIOR_LOGS = 4.0
"""Logs that the information counts as, beside the scatter of few logs: `make run-to-run`."""


def _satterthwaite(
    within: FloatArray, wide: FloatArray, freedom: int, logs: Sequence[LogInformation]
) -> float:
    """Degrees of freedom of variances whose part `within` has `freedom` degrees (Satterthwaite).

    The rest has as many as there are logs of each kind, less one.
    """
    part, whole = np.diag(within), np.diag(wide)
    share = 0.0
    if np.any(whole > 0):
        share = float(np.mean(1 - part[whole > 0] / whole[whole > 0]))
    repeats = len(logs) - len({log.loaded for log in logs})
    return 1 / (share**2 / max(1, repeats) + (1 - share) ** 2 / max(1, freedom))


def widened(robust: FloatArray, least: FloatArray) -> FloatArray:
    """The covariance `robust` (Q, Q), no standard deviation below that of `least`."""
    size = np.sqrt(np.maximum(np.diag(robust), 0.0))
    floor = np.sqrt(np.maximum(np.diag(least), 0.0))
    factor = np.divide(np.maximum(size, floor), size, out=np.ones_like(size), where=size > 0)
    return robust * np.outer(factor, factor)


_NEAR = 0.5
"""Standard deviations from the largest likelihood within which a running estimate is drawn."""
MOMENTS = 48
"""About how many moments the logs are looked at together."""


def running(fit: Fit, durations: Sequence[float], moments: int = MOMENTS) -> dict[str, FloatArray]:
    """Estimates of a fit's parameters as its logs are gone over one after the other.

    Parameters
    ----------
    fit : Fit
    durations : s, of each of its logs
    moments : int
        About how many there are in all; each log has two at least, and no more than stretches.

    Returns
    -------
    dict of arrays (T,)
        `log`, the time `t` in s of it, each parameter, and, as ``NAME_half``, half its interval:
        NaN where the data so far do not determine it.

    Notes
    -----
    The band is that of the information so far, wider by the factor that the fit's own intervals
    are wider than the information of all logs has it: that of coloured residuals and of what
    differs from run to run.
    """

    def by_information(logs: Sequence[LogInformation]) -> Fit:
        """What some of the logs tell, by their information alone."""
        start = fit.shared, logs, fit.values, fit.moved, fit.prior
        return finish(fit.estimator, *start, coloured=False)

    plain = by_information(fit.logs).std
    known = np.isfinite(fit.std + plain) & (plain > 0)
    widening = np.divide(fit.std, plain, out=np.ones_like(plain), where=known)
    places, times, rows = [], [], []
    for number, log in enumerate(fit.logs):
        count = max(2, round(moments * durations[number] / sum(durations)))
        S, g = np.cumsum(log.S, axis=0), np.cumsum(log.g, axis=0)
        ends = np.unique(np.linspace(0, len(S), count + 1).astype(int))[1:]
        for end in ends:
            own = replace(log, S=S[end - 1 : end], g=g[end - 1 : end])
            found = by_information([*fit.logs[:number], own])
            places.append(number)
            times.append(durations[number] * end / len(S))
            # the fit may know better than its sums
            determined = np.isfinite(found.std + fit.std)
            row = np.stack([found.values, fit.quantile * widening * found.std])
            rows.append(np.where(determined, row, np.nan).ravel())
    names = (*fit.names, *(f"{name}_half" for name in fit.names))
    columns = {"log": np.array(places, dtype=np.int32), "t": np.array(times)}
    return columns | dict(zip(names, np.transpose(rows), strict=True))


def has_running(fit: Fit) -> bool:
    """Whether the fit is near where its likelihood is largest, within half a standard deviation.

    One that is averaged over the payload's bodies is near; one held within bounds may not be.
    """
    beta, S, _ = combine(fit.shared, fit.logs, fit.values, fit.prior)
    step = beta - fit.values
    return bool(fit.converged and step @ S @ step < _NEAR**2)
