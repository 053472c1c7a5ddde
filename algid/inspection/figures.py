"""Figures of one signal and of a clock: noise floor, step, saturation, rate, jitter, gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from algid.arm import FloatArray
from algid.base.criteria import GAP
from algid.base.quantiles import distinct, median
from algid.estimators.convention_search import Judgement
from algid.log import Log
from algid.model import K2, K3, K4, K5
from algid.notices import of_codes
from algid.readers.clock import PAUSE
from algid.signals.spacing import spaced

ENOUGH = 1 << 18
"""Values that give a quantile of any number of them: a median to 0.25 % of the deviation."""


def channels(
    log: Log, quantities: Sequence[str] = ("theta", "tau")
) -> Iterator[tuple[str, FloatArray]]:
    """The channels (N,) of some quantities of a log by their names, ``theta1`` first."""
    for quantity in quantities:
        pair = getattr(log, quantity)
        for joint, values in enumerate(() if pair is None else pair, start=1):
            yield f"{quantity}{joint}", values


def thinned(values: Any) -> Any:
    """Evenly spread values (…, N), a view: all below `ENOUGH`, else that many or up to twice."""
    return values[..., :: max(1, values.shape[-1] // ENOUGH)]


def windows(values: Any, size: int) -> Any:
    """Each `size` values in a row out of values (…, N), `thinned`, as columns (…, size, M)."""
    return thinned(sliding_window_view(values, size, axis=-1).swapaxes(-1, -2))


def differences(values: Any, order: int) -> Any:
    """Differences of that order of values (…, N), `thinned`; below `ENOUGH` the same as NumPy's."""
    return np.diff(windows(values, order + 1), order, axis=-2)[..., 0, :]


@dataclass(frozen=True)
class SignalFigures:
    """One channel, in its unit. `step` is 0 where values do not lie on a grid."""

    low: float
    high: float
    noise: float
    step: float
    saturated: float


@dataclass(frozen=True)
class ClockFigures:
    """The stamps: rate in Hz, jitter (standard deviation of steps but gaps), longest gap in s."""

    rows: int
    duration: float
    rate: float
    jitter: float
    gaps: int
    longest_gap: float


def signal_figures(values: FloatArray) -> SignalFigures:
    """Figures of a channel (N,)."""
    low, high = float(values.min()), float(values.max())
    return SignalFigures(low, high, noise_floor(values), grid_step(values), saturated_share(values))


@dataclass(frozen=True)
class DynamicFigures:
    """What the equations of motion say of a log as it was read.

    Parameters
    ----------
    condition : float
        Of the scaled regressor: of its estimates' correlations, the root.
    explained : float
        Share of the torque that they explain, of the joint where that is less.
    weight1, weight2 : float, N m
        Gravity constants k4 and k2; 0 of an arm in a horizontal plane.
    inertia : float, kg m^2
        k3 + k5.
    """

    condition: float
    explained: float
    weight1: float
    weight2: float
    inertia: float


def dynamic_figures(judgement: Judgement | None) -> DynamicFigures | None:
    """Figures of what all conventions say of a log; None where they say nothing."""
    if judgement is None:
        return None
    one = judgement.as_read
    k, std = one.constants, np.sqrt(np.diag(one.covariance))
    return DynamicFigures(
        condition=float(np.sqrt(np.linalg.cond(one.covariance / np.outer(std, std)))),
        explained=1 - float(one.left.max()),
        weight1=k.get(K4, 0.0),
        weight2=k.get(K2, 0.0),
        inertia=k[K3] + k[K5],
    )


def noise_floor(values: FloatArray) -> float:
    """Standard deviation of noise, by the median size of third differences: smooth motion has none.

    1.4826 times it is normal noise's deviation, robust to outliers; a third difference has √20 of a
    value's.
    """
    if values.size < 4:
        return 0.0
    return 1.4826 * median(np.abs(differences(values, 3))) / math.sqrt(20)


def grid_step(values: FloatArray) -> float:
    """The step of an encoder or converter: the smallest difference, if all are multiples of it.

    Else 0.
    """
    levels = distinct(values[:20_000])
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.abs(levels).max()]
    if steps.size < 2:
        return 0.0
    ratios = steps / steps.min()
    return float(steps.min() * (np.abs(ratios - np.rint(ratios)).max() < 0.05))


def saturated_share(values: FloatArray) -> float:
    """Share of samples at the highest or lowest value whose neighbours on both sides are too."""
    low, high = values.min(), values.max()
    extreme = (values == high) | (values == low)
    inner = extreme[2:] & extreme[1:-1] & extreme[:-2]
    return float(np.count_nonzero(inner) / values.size) if low < high else 0.0


def clock_figures(log: Log) -> ClockFigures:
    """Figures of a log's stamps, two at least.

    Gaps and jitter are those left once clusters are in their place; a pause that the reader put
    between two runs is no gap.
    """
    period = log.period
    stamp_ns = np.concatenate([block.stamp_ns for block in spaced([log], period)])
    steps = np.diff(stamp_ns) * 1e-9
    wide = steps > GAP * period
    gaps = steps[wide]
    pauses = sum(one.numbers.get("joined", 0) for one in of_codes(log.notices, "GAPS"))
    gaps = np.delete(gaps, np.argsort(np.abs(gaps - PAUSE * period))[:pauses])
    return ClockFigures(
        rows=len(log),
        duration=log.duration,
        rate=1 / period,
        jitter=round(float(np.std(steps[~wide])), 12),  # stamps count nanoseconds
        gaps=gaps.size,
        longest_gap=float(gaps.max(initial=0.0)),
    )
