"""Runs of one motion: the model's error is the same in each, so that together they count as one.

Two logs repeat each other where their velocities are alike: with v of both joints at `_RATE` Hz,

        max_l Σ v(t) w(t + l) / (Σ v(t)² Σ w(t + l)²)^½ > `ALIKE`    for shifts l up to `_SHIFT` s

Names of files tell nothing of it. The likelihoods of n repeats count as one: each is divided by n,
and where errors are judged by how logs and stretches scatter, their mean stands for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation
from algid.signals.segments import Segment

ALIKE = 0.95  # of one: a tenth of the power may differ
_RATE = 50.0  # Hz
_LONGEST = 60.0  # s that are compared
_SHIFT = 2.0  # s
_LENGTHS = 0.8  # of the longer one: a log that is shorter is no repeat

Source = Callable[[], Iterable[Segment]]
Groups = tuple[tuple[int, ...], ...]
"""Places of logs that repeat each other; each log is in one group."""


def grouped(unloaded: Sequence[Source], loaded: Sequence[Source]) -> Groups:
    """Groups of the unloaded and then the loaded logs, by their places in that order."""
    first = _groups([_velocities(source) for source in unloaded], 0)
    return first + _groups([_velocities(source) for source in loaded], len(unloaded))


def _groups(motions: Sequence[FloatArray], start: int) -> Groups:
    groups: list[list[int]] = []
    for place, motion in enumerate(motions):
        same = (group for group in groups if alike(motions[group[0]], motion))
        group = next(same, None)
        if group is None:
            groups.append([place])
        else:
            group.append(place)
    return tuple(tuple(start + place for place in group) for group in groups)


def alike(one: FloatArray, other: FloatArray) -> bool:
    """Whether velocities (2, N) and (2, M) at `_RATE` Hz are of one motion."""
    count = min(one.shape[1], other.shape[1])
    if count < _LENGTHS * max(one.shape[1], other.shape[1]) or count < 2:
        return False
    reach = min(round(_SHIFT * _RATE), count // 4)
    return any(_like(one[:, :count], other[:, :count], shift) for shift in range(-reach, reach + 1))


def _like(one: FloatArray, other: FloatArray, shift: int) -> bool:
    """Whether velocities (2, N) are alike where the second comes `shift` steps later."""
    if shift < 0:
        one, other, shift = other, one, -shift
    first, second = one[:, : one.shape[1] - shift], other[:, shift:]
    power = float(np.sqrt(np.sum(first**2) * np.sum(second**2)))
    return power > 0 and float(np.sum(first * second)) > ALIKE * power


def _velocities(source: Source) -> FloatArray:
    """Velocities (2, N) of the beginning of a log at `_RATE` Hz, gaps closed, in rad a step."""
    means: list[FloatArray] = [np.zeros((2, 0))]
    for segment in source():
        width = max(1, round(1 / (_RATE * segment.dt)))
        count = len(segment) // width
        means.append(segment.theta[:, : count * width].reshape(2, count, width).mean(axis=2))
        if sum(part.shape[1] for part in means) > _LONGEST * _RATE:
            break
    theta = np.concatenate(means, axis=1)[:, : round(_LONGEST * _RATE)]
    return np.diff(theta, axis=1)


def shared_out(logs: Sequence[LogInformation], groups: Groups) -> list[LogInformation]:
    """Each log's likelihood, divided by how many repeat its motion."""
    count = {place: len(group) for group in groups for place in group}
    return [
        replace(log, S=log.S / count[place], g=log.g / count[place])
        for place, log in enumerate(logs)
    ]


def merged(logs: Sequence[LogInformation], groups: Groups) -> list[LogInformation]:
    """One likelihood for each group, the sum of those of its logs stretch by stretch."""
    return [_sum([logs[place] for place in group]) for group in groups]


def _sum(logs: Sequence[LogInformation]) -> LogInformation:
    first = logs[0]
    if len(logs) == 1:
        return first
    S = np.zeros((max(len(log.S) for log in logs), *first.S.shape[1:]))
    g = np.zeros((len(S), first.g.shape[1]))
    for log in logs:
        S[: len(log.S)] += log.S
        g[: len(log.g)] += log.g - log.S @ (first.c0 - log.c0)
    return replace(first, S=S, g=g)
