"""Covariance and statuses of parameters found with shrunk terms, and what stays undetermined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
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
    given = (*shrinkage.names, *prior.absent)
    statuses, left_open = _judged(shared.names, beta, H, given, moved)
    without = _left_out(shared, logs, beta, prior)
    each = merged(logs, groups)
    alone = without if len(each) == len(logs) else _left_out(shared, each, beta, prior)
    wide = spread(shared, each, beta, prior, alone)
    intervals: Intervals = "sandwich" if wide.jackknife is None else "jackknife"
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


def _judged(
    names: Sequence[str], beta: FloatArray, H: FloatArray, shrunk: Sequence[str], moved: FloatArray
) -> tuple[tuple[Status, ...], tuple[Notice, ...]]:
    """Each parameter's status, and what is open.

    A term is never open, since physics bounds it.
    """
    free = np.array([name not in shrunk for name in names])
    own = scaled_pinv(scaled_pinv(H)[np.ix_(free, free)])
    judged = examine([name for name in names if name not in shrunk], beta[free], own, moved)
    determined = iter(judged.determined)
    statuses: list[Status] = [
        "OK" if not yes or next(determined) else "NOT_IDENTIFIABLE" for yes in free
    ]
    return tuple(statuses), judged.left_open


def _left_out(
    shared: Shared, logs: Sequence[LogInformation], beta: FloatArray, prior: Prior
) -> FloatArray:
    """Parameters (n, Q) without each log, with the same spreads.

    Without the only one of its kind, those of all.
    """
    rows = []
    for place, log in enumerate(logs):
        rest = [*logs[:place], *logs[place + 1 :]]
        alone = not any(other.loaded is log.loaded for other in rest)
        rows.append(beta if alone else combine(shared, rest, beta, prior)[0])
    return np.array(rows)
