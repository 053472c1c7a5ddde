"""Instrumental variables on sliding windows: what the arm would have done, in place of what it did.

On a real arm the torque that no model holds (friction, play, cogging) drives the motion. The
columns X of the momentum form are then correlated with its residual, and least squares on them is
attenuated, however they are weighed. Instruments Z are the same columns of a motion which that
torque did not drive: simulated from each window's measured start with the measured torque and the
present coefficients, or the motion that a logged reference explains: under feedback the torque
answers what the model lacks, the reference that the controller follows does not. The estimate
solves

    Σ w Z (y − Xᵀ c) = 0

(Janot, Vandanjon & Gautier 2014, IEEE Trans. Control Syst. Technol. 22; Brunot et al. 2018).
Projected on the instruments, each log's likelihood is quadratic, so that logs, payloads and priors
combine as for any estimator:

    S = Aᵀ V⁻¹ A,    g = Aᵀ V⁻¹ Σ w Z (y − Xᵀ c0),    A = Σ w Z Xᵀ,    V = Σ w Z Zᵀ

What a reference q_d explains of the motion is found by least squares, joint by joint, on both
joints' references some time ago, of all logs together:

    θ̂(t) = b0 + Σ_l B_l q_d(t − l),   l = 0 … `_LONGEST` s, denser near zero

The columns along θ̂ are then the instruments: the auxiliary model of Janot et al., made of the log
in place of a simulated controller, of which a log says nothing. A right θ̂ makes them strong; a
wrong one leaves them valid.

======  ================================================  ========================  ========
symbol  name                                              shape                     unit
======  ================================================  ========================  ========
X       columns of the two equations                      (2, q, R)                 mixed
Z       the same of the simulated motion                  (2, q, R)                 mixed
y       the torque's moments                              (2, R)                    N m
w       inverse residual variance of a row of each joint  (2,)                      1/(N m)²
gram    [Z X y] [Z X y]ᵀ by stretch and joint             (B, 2, 2 q + 1, 2 q + 1)  mixed
q_d     reference                                         (2, N)                    rad
F       references some time ago, and 1                   (m, N)                    rad
B       what the reference makes of angles and torques    (4, m)                    mixed
======  ================================================  ========================  ========
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from math import ceil
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import SETTLED_SIMULATED
from algid.estimators import weak
from algid.estimators.combine import (
    BlockSums,
    LogInformation,
    combine,
    scaled_pinv,
)
from algid.estimators.fit import Fit, finish
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.model import Model, advanced, inertia
from algid.signals.segments import Segment

_ROUNDS = 4
_STRIDE = 2  # windows overlap four-fold: more add little, and each is simulated
_STEP = 4e-3  # s: of the simulation at most, in which 10 Hz turn by a quarter of a radian
_ASTRAY = 100.0  # rad: a simulated window that turns so far has run away
_FEWEST = 0.5  # share of the windows that must not go astray
_TOGETHER = 8 * (weak.PIECE_SAMPLES + 4096)  # samples whose windows are simulated side by side


def fit(problem: Problem, start: Fit | None = None) -> Fit:
    """Parameters of the arm, and of its payload if there are loaded logs, by windowed instruments.

    Each log is gone over up to ten times.

    Parameters
    ----------
    problem : Problem
    start : Fit
        The weak estimate, where it has been made.

    Returns
    -------
    Fit
        With `converged` false and the weak estimate in its place where the coefficients move no
        arm: a mass matrix that is not positive definite, or windows that go astray.

    Raises
    ------
    ValueError
        If no log is long enough for a window, or there is neither an unloaded log nor a prior.
    """
    if start is None:
        start = weak.fit(problem)
    shared = start.shared
    if shared.delay:
        problem = problem.at(shared.model, start.delay, estimate_delay=True)
    following = followed(problem)
    beta = start.values
    for _ in range(_ROUNDS):
        logs = evidence(problem, shared, beta, following)
        if not logs:
            return replace(start.marked("NOT_CONVERGED"), converged=False)
        before = beta
        beta, S, _ = combine(shared, logs, before, problem.prior)
        if float((beta - before) @ S @ (beta - before)) < SETTLED_SIMULATED**2:
            break
    return finish("instruments", shared, logs, beta, start.moved, problem.prior, coloured=True)


def evidence(
    problem: Problem,
    shared: Shared,
    beta: FloatArray,
    following: Explained | None = None,
) -> list[LogInformation]:
    """Each log's likelihood projected on instruments, simulated at shared parameters `beta` (Q,).

    Where it is known how the arm is `following` a reference, the motion that this explains stands
    in place of a simulated one. Rows weigh by their residual at `beta`. Nothing where the
    parameters move no arm, or most windows cannot be simulated. The windows of many pieces are
    simulated side by side: a step costs the same for few as for many.
    """
    logs, settings = [], problem.settings
    model, delay = settings.model, settings.estimate_delay
    for kind, sources in problem.kinds():
        c0 = shared.coefficients(beta, kind)
        linear = c0[: len(model.names)]
        grams = [BlockSums() for _ in sources]
        rows, lost = np.zeros((2, len(grams)), dtype=np.int64)
        for batch in _batches(sources, settings):
            motions = _explained(following, batch) if following else _driven(batch, model, linear)
            for (number, piece, windows), (own, motion, step, good) in zip(
                batch, motions, strict=True
            ):
                X = windows.equations(model, piece, delay, linear)
                X = weak.of_whole_delay(X, settings)[:, :, ::_STRIDE]
                Z = own.equations(model, motion, delay, linear)[:, :-1, ::step]
                used = good & windows.moving(piece, settings.rest)[:, ::_STRIDE]
                both = np.where(used[:, None], np.concatenate([Z, X], axis=1), 0.0)
                rows[number] += good.size
                lost[number] += np.sum(~good)
                grams[number].add(weak.grams(both, OVERLAP // _STRIDE))
        if np.any(lost > _FEWEST * rows):
            return []
        for sums, count in zip(grams, (rows - lost).tolist(), strict=True):
            if count:
                logs.append(weak.evidence(sums.values(), count, c0, kind, every=_STRIDE))
    return logs


_Piece = tuple[int, Segment, Windows]
"""The number of a log, a piece of it and the windows on that."""


def _batches(sources: Sequence[Source], settings: WeakSettings) -> Iterator[list[_Piece]]:
    """Pieces with whole windows, those together that are alike and have not too many samples."""

    def placed() -> Iterator[tuple[tuple[int, int], _Piece]]:
        samples = 0
        for number, source in enumerate(sources):
            for piece, windows in weak.overlapping(source(), settings):
                if windows.count(piece):
                    samples += len(piece)
                    yield (_steps(windows), samples // _TOGETHER), (number, piece, windows)

    for _, batch in groupby(placed(), itemgetter(0)):
        yield [piece for _, piece in batch]


def _steps(windows: Windows) -> int:
    """Steps of the simulation in a window: as many in each part that windows overlap by."""
    return OVERLAP * ceil(windows.step * windows.dt / _STEP)


_Motion = tuple[Windows, Segment, int, NDArray[np.bool_]]
"""Windows on a motion, every how many of them count, and which are good."""


def _driven(batch: Sequence[_Piece], model: Model, c: FloatArray) -> Iterator[_Motion]:
    """What the torque and `c` (q,) make of each piece's windows, one window after the other."""
    cuts = [cut(piece, windows) for _, piece, windows in batch]
    start, acts = (np.concatenate(parts, axis=-1) for parts in zip(*cuts, strict=True))
    steps, counts = len(acts) // 2, [own[0].shape[1] for own in cuts]
    periods = [OVERLAP * windows.step * windows.dt / steps for _, _, windows in batch]
    states, good = simulated(model, c, np.repeat(periods, counts), start, acts)
    signals = np.concatenate([states, acts[:-1:2]], axis=1)
    ends = np.cumsum(counts)[:-1]
    parts = np.split(signals, ends, axis=-1), np.split(good, ends)
    for h, part, own in zip(periods, *parts, strict=True):
        rows = np.moveaxis(part, 0, -1).reshape(6, -1)  # window by window
        motion = Segment(0.0, h, rows[:2], rows[4:], rows[2:4])
        yield Windows(h, steps * h, 0.0, None), motion, OVERLAP, own


def _explained(following: Explained, batch: Sequence[_Piece]) -> Iterator[_Motion]:
    """What the reference explains of each piece; of one without, no window is good."""
    for _, piece, windows in batch:
        motion = following(piece)
        good = np.full(-(-windows.count(piece) // _STRIDE), motion is not None)
        yield windows, motion or piece, _STRIDE, good


def cut(piece: Segment, windows: Windows) -> tuple[FloatArray, FloatArray]:
    """Every `_STRIDE`-th window of a piece: R windows, each of K steps.

    Returns
    -------
    Angles and velocities (4, R) at their starts, and torques (2 K + 1, 2, R) at each half step
    """
    starts = windows.step * np.arange(0, windows.count(piece), _STRIDE)
    length, steps = OVERLAP * windows.step, _steps(windows)
    late = windows.shift / windows.dt - windows.margin
    instants = starts + length / (2 * steps) * np.arange(2 * steps + 1)[:, None] - late
    samples = np.arange(len(piece))
    acts = np.stack([np.interp(instants, samples, tau) for tau in piece.tau], axis=1)
    states = np.concatenate([windows.angles(piece), windows.velocities(piece)])
    return states[:, starts], acts


def simulated(
    model: Model,
    c: FloatArray,
    h: FloatArray,
    start: FloatArray,
    acts: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The motion that windows cut from logs would have had, in steps of `h` (R,) s.

    All windows side by side, from the measured `start` (4, R) under the torques that `acts` holds.
    (To start earlier, so that what the unmodelled torque did before has faded, made the instruments
    too weak.)

    Returns
    -------
    Angles and velocities (K, 4, R), and the windows (R,) that have not gone astray: their mass
    matrix is positive definite, and they are near where they started, all along
    """
    states = np.empty((len(acts) // 2, *start.shape))
    # what moves no arm is judged afterwards
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for step, state in enumerate(states):
            state[:] = start
            ahead = advanced(model, c, start, acts[2 * step : 2 * step + 3], h)
            start = np.clip(ahead, -1e6, 1e6)
    (m11, m12), (_, m22) = inertia(model, c, states[:, :2].swapaxes(0, 1))
    good = np.all((m11 > 0) & (m11 * m22 > m12**2), axis=0)
    good &= np.abs(states[:, :2] - states[0, :2]).max(axis=(0, 1)) < _ASTRAY
    # A window that went astray is left out; products of its velocities would overflow.
    states[..., ~good] = 0.0
    return states, good


_LONGEST = 1.0  # s: a joint has followed its reference by then
_LAGS = 16
_TOLERANCE = 1e-9  # relative eigenvalue: a slow reference is almost the one a lag before
_FARTHEST = 1e4  # rad: no joint turns so far
_KNOWN = 0.5  # share of a piece's samples that have a reference
FOLLOWED = 0.5
"""Share of each joint's motion (R²) that a reference explains, at least, to be an instrument."""


Explained = Callable[[Segment], Segment | None]
"""Gives a piece with the angles, velocities and torques that its reference explains; None where it
has none."""


def followed(problem: Problem) -> Explained | None:
    """How the arm follows the references of its logs; None where one has none, or it does not."""
    gram: FloatArray = np.zeros(())
    for source in problem.logs:
        known = False
        for piece, _ in weak.overlapping(source(), problem.settings):
            if piece.reference is None:
                return None
            F = _features(piece)
            if F is not None:
                rows = np.concatenate([F, piece.theta, piece.tau])
                gram = gram + rows @ rows.T
                known = True
        if not known:
            return None
    if not gram.shape:  # there is no log
        return None
    m = len(gram) - 4
    B = gram[m:, :m] @ scaled_pinv(gram[:m, :m], _TOLERANCE)
    count, sums = gram[m - 1, m - 1], gram[m : m + 2, m - 1]
    total = np.diag(gram)[m : m + 2] - sums**2 / count
    left = np.diag(gram)[m : m + 2] - np.sum(B[:2] * gram[m : m + 2, :m], axis=1)
    if not np.all(left < (1 - FOLLOWED) * total):
        return None

    def explained(piece: Segment) -> Segment | None:
        F = _features(piece)
        if F is None:
            return None
        theta, tau = np.split(B @ F, 2)
        omega = None if piece.omega is None else np.gradient(theta, piece.dt, axis=1)
        return replace(piece, theta=theta, tau=tau, omega=omega)

    return explained


def _features(piece: Segment) -> FloatArray | None:
    """F (m, N), the last row 1; None where most samples of the piece have no reference.

    Before its beginning a reference is taken to have stood still; over gaps it is straight.
    """
    if piece.reference is None:
        return None
    good = np.all(np.abs(piece.reference) < _FARTHEST, axis=0)
    if np.mean(good) < _KNOWN:
        return None
    count = len(piece)
    lags = np.unique(
        np.rint(_LONGEST / piece.dt * (np.arange(_LAGS) / (_LAGS - 1)) ** 2).astype(np.int64)
    )
    ago = [
        np.interp(np.arange(count) - lags[:, None], np.flatnonzero(good), row[good])
        for row in piece.reference
    ]
    return np.concatenate([*ago, np.ones((1, count))])
