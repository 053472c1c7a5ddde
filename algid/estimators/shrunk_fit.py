"""Covariance and statuses of parameters beside shrunk terms, and what stays undetermined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.base.names import outside, places_outside
from algid.estimators.combine import LogInformation, Prior, combine, scaled_pinv
from algid.estimators.fit import Fit, Intervals, Status
from algid.estimators.identifiability import examine
from algid.estimators.parametrisation import Shared
from algid.estimators.repeats import Groups, merged
from algid.estimators.shrinkage import spread
from algid.notices import Notice

QUANTILE = 2.3
"""Half width of a 95 % interval in standard deviations from few logs: see `make run-to-run`."""


def concluded(
    shared: Shared,
    logs: Sequence[LogInformation],
    beta: FloatArray,
    prior: Prior,
    shrinkage: Prior,
    moved: FloatArray,
    groups: Groups,
) -> Fit:
    """The fit of likelihoods divided by φ, with error bars and statuses.

    Parameters
    ----------
    shared : Shared
    logs : each log's quadratic likelihood
    beta : (Q,)
        Where the solver starts.
    prior : Prior
        All that is known beforehand.
    shrinkage : Prior
        Its part on the terms that are shrunk.
    moved : (2,), rad
        How far each joint travelled.
    groups : Groups
        Logs that repeat each other, among which each likelihood is shared out already.
    """
    beta, H, _ = combine(shared, logs, beta, prior)
    bounded = shrinkage.names + prior.absent
    statuses, left_open = _judged(shared.names, beta, H, bounded, moved)
    without = _left_out(shared, logs, beta, prior)
    each = merged(logs, groups)
    alone = without
    if len(each) < len(logs):
        alone = _left_out(shared, each, beta, prior)
    wide = spread(shared, each, beta, prior, alone)
    intervals: Intervals = "jackknife"
    if wide.jackknife is None:
        intervals = "sandwich"
    ways = [way for way in (wide.jackknife, wide.scores, wide.stretches) if way is not None]
    return Fit(
        estimator="weak",
        shared=shared,
        values=beta,
        covariance=np.mean(ways, axis=0),
        intervals=intervals,
        quantile=QUANTILE,
        freedom=wide.freedom,
        status=statuses,
        unidentifiable=left_open,
        logs=tuple(logs),
        prior=prior,
        shrinkage=shrinkage,
        without=without,
        moved=moved,
        repeats=groups,
    )


def unshrunk(fit: Fit, name: str) -> Fit:
    """The fit of the same likelihoods with one term's parameter free of its prior.

    A parameter far outside its prior is drawn back into it, and the residual that this leaves makes
    every error bar wider: what is free shows what the logs say of it.
    """
    prior, shrinkage = fit.prior, fit.shrinkage
    if prior is None or shrinkage is None or name not in shrinkage.names:
        return fit
    prior, shrinkage = prior.silent_on(name), shrinkage.silent_on(name)
    return concluded(fit.shared, fit.logs, fit.values, prior, shrinkage, fit.moved, fit.repeats)


def _judged(
    names: Sequence[str],
    beta: FloatArray,
    H: FloatArray,
    bounded: Sequence[str],
    moved: FloatArray,
) -> tuple[tuple[Status, ...], tuple[Notice, ...]]:
    """Each parameter's status, and what is open.

    A term is never open, since physics bounds it.
    """
    free = places_outside(names, bounded)
    own = scaled_pinv(scaled_pinv(H)[np.ix_(free, free)])
    judged = examine(outside(names, bounded), beta[free], own, moved)
    statuses: list[Status] = ["OK"] * len(names)
    for place, determined in zip(free, judged.determined, strict=True):
        if not determined:
            statuses[place] = "NOT_IDENTIFIABLE"
    return tuple(statuses), judged.left_open


def _left_out(
    shared: Shared, logs: Sequence[LogInformation], beta: FloatArray, prior: Prior
) -> FloatArray:
    """Parameters (n, Q) without each log, with the same spreads.

    Without the only one of its kind, those of all.
    """
    rows = np.tile(beta, (len(logs), 1))
    for place, log in enumerate(logs):
        rest = list(logs)
        del rest[place]
        if any(other.loaded is log.loaded for other in rest):
            rows[place] = combine(shared, rest, beta, prior)[0]
    return rows
