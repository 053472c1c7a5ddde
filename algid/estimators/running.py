"""What an estimator had found by each moment of its logs, taken in turn, and how sure it was.

A fit's logs are quadratic likelihoods by stretch of time; those up to a moment add up as all of
them do.

"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation, combine
from algid.estimators.fit import Fit
from algid.estimators.identifiability import examine

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
    _, plain = _estimate(fit, fit.logs)
    known = np.isfinite(fit.std) & (plain > 0)
    widening = np.divide(fit.std, plain, out=np.ones_like(plain), where=known)
    places, times, rows = [], [], []
    for number, log in enumerate(fit.logs):
        count = max(2, round(moments * durations[number] / sum(durations)))
        ends = np.unique(np.linspace(0, log.S.shape[0], count + 1).astype(int))[1:]
        S, g = np.cumsum(log.S, axis=0), np.cumsum(log.g, axis=0)
        for end in ends:
            so_far = [
                *fit.logs[:number],
                LogInformation(log.loaded, log.c0, S[end - 1 : end], g[end - 1 : end]),
            ]
            beta, std = _estimate(fit, so_far)
            places.append(number)
            times.append(durations[number] * end / log.S.shape[0])
            rows.append(np.concatenate([beta, fit.quantile * widening * std]))
    names = (*fit.names, *(f"{name}_half" for name in fit.names))
    columns = {"log": np.array(places, dtype=np.int32), "t": np.array(times)}
    return columns | dict(zip(names, np.transpose(rows), strict=True))


def _estimate(fit: Fit, logs: Sequence[LogInformation]) -> tuple[FloatArray, FloatArray]:
    """Parameters (Q,) by some of the fit's logs, and their standard deviations (Q,).

    NaN where they are open.
    """
    beta, S, _ = combine(fit.shared, logs, fit.values, fit.prior)
    if not S.any():  # a joint at rest, and nothing else so far
        return np.full(beta.shape, np.nan), np.full(beta.shape, np.nan)
    known = examine(fit.names, beta, S, fit.moved, fit.absent)
    std = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))
    # the fit may know better than its sums
    lost = np.array([status == "NOT_IDENTIFIABLE" for status in fit.status])
    determined = np.array(known.determined) & ~lost
    return np.where(determined, beta, np.nan), np.where(determined, std, np.nan)


def has_running(fit: Fit) -> bool:
    """Whether the fit is near where its likelihood is largest, within half a standard deviation.

    One that is averaged over the payload's bodies is near; one held within bounds may not be.
    """
    beta, S, _ = combine(fit.shared, fit.logs, fit.values, fit.prior)
    step = beta - fit.values
    return bool(fit.converged and step @ S @ step < _NEAR**2)
