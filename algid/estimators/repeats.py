"""Runs of one motion: the model's error is the same in each, so that together they count as one.

Two logs repeat each other where their velocities are alike: with v of both joints at `_RATE` Hz,

        max_l Σ v(t) w(t + l) / (Σ v(t)² Σ w(t + l)²)^½ > `ALIKE`    for shifts l up to `_SHIFT` s

Names of files do not count. The likelihoods of n repeats count as one: each is divided by n,
and where errors are judged by how logs and stretches scatter, their mean stands for them.

Of two recordings of one motion the noise is another's. Logs whose very samples are those of
another, in another format or cut out of it, are no second measurement: see `shared_samples`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation
from algid.estimators.problem import Source

ALIKE = 0.95  # of one: a tenth of the power may differ
_RATE = 50.0  # Hz
_LONGEST = 60.0  # s that are compared
_SHIFT = 5.0  # s, by which two recordings of one motion are started apart by hand
_LENGTHS = 0.8  # of the longer one: a log that is shorter is no repeat

_PROBES, _RUN = 8, 32  # runs of a log that are looked for, and samples of each
_DIFFERENT = 8  # values that a run holds at least, else it may stand still
_ROUNDED = 0.05  # of the median step from sample to sample: what a text format may round off

Groups = tuple[tuple[int, ...], ...]
"""Places of logs that repeat each other; each log is in one group."""


def grouped(unloaded: Sequence[Source], loaded: Sequence[Source]) -> Groups:
    """Groups of the unloaded and then the loaded logs, by their places in that order."""
    groups: list[list[int]] = []
    motions = [_velocities(source) for source in (*unloaded, *loaded)]
    for place, motion in enumerate(motions):
        for group in groups:
            same_kind = (group[0] < len(unloaded)) is (place < len(unloaded))
            if same_kind and alike(motions[group[0]], motion):
                group.append(place)
                break
        else:
            groups.append([place])
    return tuple(map(tuple, groups))


def shared_samples(logs: Sequence[FloatArray]) -> FloatArray:
    """Share (L, L) of each log's samples that another one holds too, by `_PROBES` runs of it.

    Parameters
    ----------
    logs : angles and torques (4, N) of each
    """
    every, shares = np.concatenate(logs, axis=1), np.zeros((len(logs), len(logs)))
    ends = np.cumsum([log.shape[1] for log in logs])

    @cache
    def sorting(row: int) -> NDArray[np.int64]:
        return np.argsort(every[row])

    for own, log in enumerate(logs):
        if log.shape[1] < _RUN:
            continue
        steps = np.median(np.abs(np.diff(log, axis=1)), axis=1)
        error = (_ROUNDED * steps + 1e-9 * np.abs(log).max(axis=1))[:, None]
        starts = np.linspace(0, log.shape[1] - _RUN, _PROBES).astype(np.int64)
        holders = []
        for start in starts.tolist():
            # by as few of the rows as tell
            run = log[:, start : start + _RUN]
            counts = [np.unique(values).size for values in run]
            row = int(np.argmax(np.minimum(counts, _RUN // 2)))
            if counts[row] < _DIFFERENT:
                continue
            bounds = run[row, 0] + error[row] * (-1, 1)
            first, last = np.searchsorted(every[row], bounds, sorter=sorting(row))
            found = sorting(row)[first:last]
            found = found[found <= every.shape[1] - _RUN]
            found = found[np.all(np.abs(every[:, found] - run[:, :1]) <= error, axis=0)]
            there = every[:, found[:, None] + np.arange(_RUN)]
            same = np.all(np.abs(there - run[:, None]) <= error[:, None], axis=(0, 2))
            holders.append(np.isin(range(len(logs)), np.searchsorted(ends, found[same], "right")))
        if holders:
            shares[own] = np.mean(holders, axis=0)
    return shares


def alike(one: FloatArray, other: FloatArray) -> bool:
    """Whether velocities (2, N) and (2, M) at `_RATE` Hz are of one motion."""
    count = min(one.shape[1], other.shape[1])
    if count < _LENGTHS * max(one.shape[1], other.shape[1]) or count < 2:
        return False
    one, other = one[:, :count], other[:, :count]
    reach = min(round(_SHIFT * _RATE), count // 4)
    shifts = np.arange(-reach, reach + 1)  # steps that the second comes later
    padded = np.pad(other, ((0, 0), (reach, reach)))
    pairs = zip(padded, one, strict=True)
    products = np.sum([np.correlate(others, own, "valid") for others, own in pairs], axis=0)
    power = np.sqrt(_overlapping(one, shifts) * _overlapping(other, -shifts))
    return bool(np.any(products > ALIKE * power))


def _overlapping(velocities: FloatArray, shifts: NDArray[np.int64]) -> FloatArray:
    """Sums of squares of the part of velocities (2, N) that the other log's overlap.

    For shifts (L,) by which those come later.
    """
    sums = np.append(0.0, np.cumsum(velocities**2, axis=1).sum(axis=0))
    return sums[sums.size - 1 - np.maximum(shifts, 0)] - sums[np.maximum(-shifts, 0)]


def _velocities(source: Source) -> FloatArray:
    """Velocities (2, N) of the beginning of a log at `_RATE` Hz, gaps closed, in rad a step."""
    means: list[FloatArray] = [np.zeros((2, 0))]
    gathered = 0
    for segment in source():
        width = max(1, round(1 / (_RATE * segment.dt)))
        count = len(segment) // width
        means.append(segment.theta[:, : count * width].reshape(2, count, width).mean(axis=2))
        gathered += count
        if gathered > _LONGEST * _RATE:
            break
    theta = np.concatenate(means, axis=1)[:, : round(_LONGEST * _RATE)]
    return np.diff(theta, axis=1)


def shared_out(logs: Sequence[LogInformation], groups: Groups) -> list[LogInformation]:
    """Each log's likelihood, divided by how many repeat its motion."""
    repeats = {place: len(group) for group in groups for place in group}
    return [log.scaled(1 / repeats[place]) for place, log in enumerate(logs)]


def merged(logs: Sequence[LogInformation], groups: Groups) -> list[LogInformation]:
    """One likelihood for each group, the sum of those of its logs stretch by stretch."""
    sums = []
    for group in groups:
        own = [logs[place].about(logs[group[0]].c0) for place in group]
        longest = max(own, key=lambda log: len(log.S))
        S, g = np.zeros_like(longest.S), np.zeros_like(longest.g)
        for log in own:
            S[: len(log.S)] += log.S
            g[: len(log.g)] += log.g
        sums.append(replace(longest, S=S, g=g))
    return sums
