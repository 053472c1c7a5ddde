"""The payload in time: stretches of constant mass, their intervals, and m_p(t) with its band.

The variance of a mass is what its rows leave open and what the arm's own uncertainty adds,

    var m_p = s² / A + Jᵀ Σ J,    J = T / A

with Σ the covariance of constants and link lengths, T the cells' sensitivity to them and s² the
rows' variance where it exceeds one, slow errors (`algid.tracks.change_points`) included.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid import __version__
from algid.arm import FloatArray
from algid.base.criteria import HOLE
from algid.base.errors import LogError
from algid.base.files import read_whole
from algid.base.names import given
from algid.base.runtime import one_blas_thread
from algid.estimators.problem import TooShortError
from algid.identification.known import as_logged, contradictions, read_otherwise, reused
from algid.identification.recordings import LogLike, Recordings, open_source
from algid.notices import Notice, lossy, merged
from algid.results import Result, read_result, result_json
from algid.signals.segments import Segment
from algid.tracks.arm import LENGTHS, IdentifiedArm, arm_of
from algid.tracks.cells import CELL, Cells, cells_of, joined
from algid.tracks.change_points import (
    AHEAD,
    BEHIND,
    SHORTEST,
    excess,
    first_segmentation,
    rough_variance,
    sums,
)
from algid.tracks.change_times import ChangeTime, confirmed, windows
from algid.tracks.drift import Drift, drift_of, variances
from algid.tracks.result import Stretch, Track, TrackResult

if TYPE_CHECKING:
    from algid.profile import Profile

ROUNDS = 2  # of linearising each stretch at its own mass and looking for the changes again
FEWEST = 4  # cells that weigh a stretch
CALM = 2
"""Cells more on both sides of the times at which a payload may be changing: the trajectory at which
rows are linearised is smoothed at 40 Hz, which spreads a heavy payload's jolt over 40 ms."""
LASTING = 2.5  # s: for so long friction that drifts counts as constant where rows are linearised
LONGEST = 60.0  # s of log that are held at once to be linearised
HALF_BAND = 0.25  # s: m_p(t) rests on so much log on both sides of t

Pass = Callable[[], Iterable[Segment]]


def track_log(
    log: LogLike,
    parameters: Result | str | Path,
    *,
    l1: float | None = None,
    l2: float | None = None,
    profile: Profile | None = None,
    settings: Mapping[str, Any] | None = None,
) -> TrackResult:
    """The track of a log by an arm: see `algid.track`; `settings` are what else it should hold.

    Raises
    ------
    LogError
        If the log cannot be used or is too short.
    """
    if isinstance(parameters, Result):
        result, content, called = parameters, result_json(parameters).encode(), parameters.log.path
    else:
        file, called = Path(parameters), str(parameters)
        result = read_result(file)
        content = read_whole(file / "result.json" if file.is_dir() else file)
    profile = reused(profile, result, called)
    source = open_source(log, "loaded", profile, changing=True)
    survey = Recordings([source], gravity=profile.gravity)
    first = next(survey.segments(source), None)
    if first is None:
        raise LogError(f"{source.name}: it holds no samples; record longer")
    lengths = given(l1=l1, l2=l2)
    arm, covariance = arm_of(as_logged(result, profile), first, **lengths)
    try:
        with one_blas_thread():
            weighed = track(partial(survey.segments, source), arm, covariance)
    except TooShortError as error:
        raise LogError(f"{source.name}: {error}; record longer") from error
    truth, of_log = source.origin.truth, survey.whole(source).notices
    judged = result.verdict
    notices = []
    if judged.grade != "good":
        numbers = {"grade": judged.word.lower(), "headline": judged.headline}
        notices.append(Notice("ARM_DOUBTFUL", numbers=numbers))
    notices += contradictions(result, lengths)
    notices += read_otherwise([survey.summary(source)], result, called)
    notices += merged(of_log)
    schedule = None
    if truth is not None:
        schedule = truth.schedule or ((0.0, truth.payload),)
    own_settings = {name: arm.value(name) for name in LENGTHS}
    own_settings["gravity"] = arm.model.gravity
    return TrackResult(
        track=weighed,
        log=survey.summary(source),
        arm=called,
        arm_sha256=hashlib.sha256(content).hexdigest(),
        settings=own_settings | dict(settings or {}),
        version=__version__,
        schedule=schedule,
        notices=tuple(notices),
        data_lost=lossy(of_log),
    )


def track(source: Pass, arm: IdentifiedArm, covariance: FloatArray) -> Track:
    """Find the payload's stretches in a log.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`; called several times.
    arm : IdentifiedArm
    covariance : (p, p) float64
        Of coefficients, link lengths and the payload's body.

    Raises
    ------
    TooShortError
        If the log is too short.
    """
    parts = cells_of(source(), arm, arm.k, settle=False)
    if not parts or sum(map(len, parts)) < 2 * SHORTEST:
        raise TooShortError(f"the log is too short: expected {2 * SHORTEST * CELL:g} s at least")
    cells = joined(parts)
    places, drift, spread = first_segmentation(cells)
    for _ in range(ROUNDS):
        cells, _ = _settled(source, arm, _cut(cells, places), drift)
        places, drift, spread = first_segmentation(cells)
    # those that cells show, as far as their rows confirm them
    shown = []
    for place in places[1:-1]:
        time = float(cells.start[place])
        safe = float(cells.start[place - AHEAD]), time + BEHIND * CELL
        shown.append(ChangeTime(time, safe, safe, np.inf))
    masses = [drift.freed(part).mass for part in _cut(cells, places)]
    ends = float(cells.start[0]), float(cells.end[-1])
    changes = confirmed(source, arm, drift, ends, spread, shown, masses)
    # whitening remembers: what a stretch is weighed by starts behind the jolt at its beginning
    inner, stretch = _settled(source, arm, _inner_parts(cells, changes), drift)
    return _weigh(cells, changes, inner, stretch, arm, covariance)


def _cut(cells: Cells, places: Sequence[int]) -> list[Cells]:
    """The cells between each two neighbouring places."""
    return list(starmap(cells.part, pairwise(places)))


def _weigh(
    cells: Cells,
    changes: Sequence[ChangeTime],
    inner: Cells,
    own: NDArray[np.int64],
    arm: IdentifiedArm,
    covariance: FloatArray,
) -> Track:
    """The track of a log with payload changes at `changes`, each stretch from its `inner` cells.

    `own` is the number (C,) of each inner cell's stretch.
    """
    places = np.searchsorted(own, np.arange(len(changes) + 2))
    starts = places[:-1]
    drift = drift_of(inner, starts, rough_variance(inner))
    calm = drift.freed(inner)
    information = np.maximum(np.add.reduceat(calm.A, starts), 1e-300)
    weights = np.add.reduceat(calm.B, starts) / information
    masses = weights[own]
    T = drift.followed(calm, starts, calm.sensitivity(arm, masses))
    parts = np.stack([starts, places[1:]], axis=1)
    slow = excess(calm.A, calm.B, parts, known=(T, covariance), robust=False)
    colour = max(rough_variance(calm), slow)
    squares = calm.less(masses[:, None] * np.eye(1, calm.b.shape[1])).E
    noise = np.add.reduceat(squares, starts) / (np.add.reduceat(calm.rows, starts) - 1)
    noise = np.maximum(noise, colour)  # a stretch's own, or the log's where that is larger
    J = np.add.reduceat(T, starts) / information[:, None]
    stds = np.sqrt(noise * (1 / information + drift.variances) + variances(J, covariance))
    # m_p(t): each cell's mass comes from its neighbourhood within the stretch
    half, place = round(HALF_BAND / CELL), np.arange(len(calm))
    low = np.maximum(place - half, starts[own])
    high = np.minimum(place + half + 1, places[own + 1])
    A = np.maximum(sums(calm.A, low, high), 1e-300)
    by_constants = sums(T, low, high) / A[:, None]
    by_friction = sums(calm.M[:, 0, 1:], low, high) / A[:, None]
    spread = noise[own] * (1 / A + drift.variance_at(calm.middle, by_friction))
    spread += variances(by_constants, covariance)
    signal, left = calm.Q.sum() - calm.rows.sum(), max(squares.sum() - calm.rows.sum(), 0.0)
    wide = np.flatnonzero(cells.start[1:] - cells.end[:-1] > HOLE)
    times = [float(cells.start[0]), *(one.time for one in changes), float(cells.end[-1])]
    of_stretches = zip(times[:-1], times[1:], weights.tolist(), stds.tolist(), strict=True)
    return Track(
        stretches=list(starmap(Stretch, of_stretches)),
        t=calm.middle,
        m_p=sums(calm.B, low, high) / A,
        std=np.sqrt(spread),
        stretch=own.astype(np.float64),
        left=np.sqrt(np.maximum(squares, 0.0) / calm.rows),
        changes=np.array([(one.time, *one.bracket) for one in changes]).reshape(-1, 3),
        colour=colour,
        explained=float(1 - left / signal) if signal > 0 else 0.0,
        holes=np.stack([cells.end[wide], cells.start[wide + 1]], axis=1),
        tip_equivalent=arm.tip_equivalent,
    )


def _settled(
    source: Pass, arm: IdentifiedArm, rough: Sequence[Cells], drift: Drift
) -> tuple[Cells, NDArray[np.int64]]:
    """All stretches' cells, linearised again at their own mass and friction, in one pass.

    The second is the number (C,) of each cell's stretch.
    """
    parts, about, spans, numbers = list[Cells](), [], [], []
    for number, cells in enumerate(rough):
        # in parts so short that friction hardly changes in them, and that memory holds them
        lasting = LASTING if drift.phi.any() else LONGEST
        count = max(1, round(len(cells) * CELL / lasting))
        mass = drift.freed(cells).mass
        for part in _cut(cells, np.linspace(0, len(cells), count + 1).astype(int).tolist()):
            # The angles' noise passes through the torque's partial derivatives, friction's among
            # them: where these are of another friction, rows have not the noise that is reckoned
            # with, and masses err.
            c = arm.k + mass * arm.unit
            c[arm.friction] += drift.at(part.middle).mean(axis=0)
            parts.append(part)
            about.append(c)
            spans.append((float(part.start[0]), float(part.end[-1])))
            numbers.append(number)
    settled = [list[Cells]() for _ in parts]
    for at, piece in windows(source(), spans, arm.shift):
        settled[at] += cells_of([piece], arm, about[at])
    whole = [joined(own or [part]) for own, part in zip(settled, parts, strict=True)]
    return joined(whole), np.repeat(numbers, list(map(len, whole)))


def _inner_parts(cells: Cells, changes: Sequence[ChangeTime]) -> list[Cells]:
    """Cells of each stretch where its payload surely is constant, or some in its middle."""
    count = len(cells)
    times, safe = [one.time for one in changes], np.array([one.safe for one in changes])
    before, behind = safe.reshape(-1, 2).T
    firsts = np.append(0, np.searchsorted(cells.start, behind) + CALM)
    lasts = np.append(np.searchsorted(cells.end, before, side="right") - CALM, count)
    ends = np.array([0, *np.searchsorted(cells.start, times), count])
    amid = np.clip((ends[1:] + ends[:-1] - FEWEST) // 2, 0, count - FEWEST)
    few = lasts - firsts < FEWEST
    firsts, lasts = np.where(few, amid, firsts), np.where(few, amid + FEWEST, lasts)
    return list(map(cells.part, firsts.tolist(), lasts.tolist()))
