"""Instrumental variables on sliding windows: what the arm would have done, in place of what it did.

On a real arm the torque that no model holds (friction, play, cogging) drives the motion. The
columns X of the momentum form are then correlated with its residual, and least squares on them is
attenuated, however they are weighed. Instruments Z are the same columns of a motion which that
torque did not drive: simulated from each window's measured start with the measured torque and the
present coefficients, or the motion that a logged reference explains (`references`): under feedback
the torque answers, the reference does not. The estimate solves

    Σ w Z (y − Xᵀ c) = 0

(Janot, Vandanjon & Gautier 2014, IEEE Trans. Control Syst. Technol. 22; Brunot et al. 2018).
Projected on the instruments, each log's likelihood is quadratic, so that logs, payloads and priors
combine as for any estimator:

    S = Aᵀ V⁻¹ A,    g = Aᵀ V⁻¹ Σ w Z (y − Xᵀ c0),    A = Σ w Z Xᵀ,    V = Σ w Z Zᵀ

======  ================================================  ========================  ========
symbol  name                                              shape                     unit
======  ================================================  ========================  ========
X       columns of the two equations                      (2, q, R)                 mixed
Z       the same of the simulated motion                  (2, q, R)                 mixed
y       the torque's moments                              (2, R)                    N m
w       inverse residual variance of a row of each joint  (2,)                      1/(N m)²
gram    [Z X y] [Z X y]ᵀ by stretch and joint             (B, 2, 2 q + 1, 2 q + 1)  mixed
======  ================================================  ========================  ========
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

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
from algid.estimators.modulating_functions import OVERLAP, Windows, row_weights
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.estimators.references import Following, followed
from algid.model import Model, advanced, inertia
from algid.signals.filters import correlate, differentiator, half_length, smoother
from algid.signals.segments import Segment

_ROUNDS = 4
_STRIDE = 2  # windows overlap four-fold: more add little, and each is simulated
_STEP = 4e-3  # s: of the simulation, in which motions of 10 Hz turn by a quarter of a radian
_ASTRAY = 100.0  # rad: a simulated window that ends so far from the measured one has run away
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
    beta, logs = start.values, None
    for _ in range(_ROUNDS):
        logs = evidence(problem, shared, beta, following)
        if not logs:
            return replace(start.marked("NOT_CONVERGED"), converged=False)
        before = beta
        beta, S, _ = combine(shared, logs, before, problem.prior)
        if float((beta - before) @ S @ (beta - before)) < SETTLED_SIMULATED**2:
            break
    assert logs is not None
    return finish("instruments", shared, logs, beta, start.moved, problem.prior, coloured=True)


def evidence(
    problem: Problem,
    shared: Shared,
    beta: FloatArray,
    following: Following | None = None,
) -> list[LogInformation] | None:
    """Each log's likelihood projected on instruments, simulated at shared parameters `beta` (Q,).

    Where it is known how the arm is `following` a reference, the motion that this explains stands
    in place of a simulated one. Rows weigh by their residual at `beta`. None where the parameters
    move no arm, or most windows cannot be simulated. The windows of many pieces are simulated side
    by side: a step costs the same for few as for many.
    """
    logs, settings = [], problem.settings
    model, delay = settings.model, settings.estimate_delay
    for kind, sources in problem.kinds():
        c0 = shared.coefficients(beta, kind)
        c = c0.copy()
        if shared.delay:
            c[-1] -= settings.shift.delay  # the windows are shifted by it: the column is a change's
        linear = c[: len(model.names)]
        grams = [BlockSums() for _ in sources]
        rows, lost = np.zeros((2, len(grams)), dtype=np.int64)
        for batch in _batches(sources, settings):
            motions = _explained(following, batch) if following else _driven(batch, model, linear)
            for (number, piece, windows), (own, motion, step, good) in zip(
                batch, motions, strict=True
            ):
                X = windows.equations(model, piece, delay, linear)[:, :, ::_STRIDE]
                Z = own.equations(model, motion, delay, linear)[:, :-1, ::step]
                used = good
                if settings.rest is not None:  # a joint that stands
                    least = np.square(settings.rest)[:, None]
                    used = good & (windows.square_speeds(piece)[:, ::_STRIDE] >= least)
                both = np.where(used[..., None, :], np.concatenate([Z, X], axis=1), 0.0)
                rows[number] += good.size
                lost[number] += np.sum(~good)
                grams[number].add(weak.grams(both, OVERLAP // _STRIDE))
        if np.any(lost > _FEWEST * rows):
            return None
        for sums, count in zip(grams, (rows - lost).tolist(), strict=True):
            if count:
                logs.append(replace(projected(sums.values(), count, c, kind), c0=c0))
    return logs


def projected(gram: FloatArray, rows: int, c: FloatArray, loaded: bool) -> LogInformation:
    """A log's likelihood projected on the instruments, weighed by its residual at `c` (q,).

    `gram` is that of so many `rows`, as in the module's table.
    """
    q = c.size
    v = np.concatenate([np.zeros(q), -c, [1.0]])
    weights = row_weights(gram.sum(axis=0), v, rows)
    # Overlapping rows repeat each other: a window's worth of rows counts as two.
    gram = np.einsum("a,baxy->bxy", weights * (2.0 * _STRIDE / OVERLAP), gram)
    A, V = gram[:, :q, q : 2 * q], gram[:, :q, :q].sum(axis=0)
    projection = A.sum(axis=0).T @ scaled_pinv(V)
    scores = gram[:, :q, -1] - A @ c
    return LogInformation(loaded, c, projection @ A, scores @ projection.T)


_Piece = tuple[int, Segment, Windows]
"""The number of a log, a piece of it and the windows on that."""


def _batches(sources: Sequence[Source], settings: WeakSettings) -> Iterator[list[_Piece]]:
    """Pieces with whole windows, those together that are alike and have not too many samples."""
    batch: list[_Piece] = []
    samples = 0
    for number, source in enumerate(sources):
        for piece, windows, _ in weak.overlapping(source(), settings):
            if (len(piece) - 2 * windows.margin) // windows.step < OVERLAP:
                continue
            if batch and (samples + len(piece) > _TOGETHER or not _alike(windows, batch[0][2])):
                yield batch
                batch, samples = [], 0
            batch.append((number, piece, windows))
            samples += len(piece)
    if batch:
        yield batch


def _alike(one: Windows, other: Windows) -> bool:
    """Whether windows have the same samples and steps, whatever the sampling period."""
    return (one.step, _stride(one.dt)) == (other.step, _stride(other.dt))


def _stride(dt: float) -> int:
    """Samples that a step of the simulation spans: every window is a multiple of it."""
    return int(np.clip(2 ** np.floor(np.log2(max(_STEP / dt, 1.0))), 2, OVERLAP))


_Motion = tuple[Windows, Segment, int, NDArray[np.bool_]]
"""Windows on a motion, every how many of them count, and which are good."""


def _driven(batch: Sequence[_Piece], model: Model, c: FloatArray) -> Iterator[_Motion]:
    """What the torque and `c` (q,) make of each piece's windows, one window after the other."""
    cuts = [cut(piece, windows) for _, piece, windows in batch]
    dt = [
        np.full(own[0].shape[1], windows.dt)
        for own, (_, _, windows) in zip(cuts, batch, strict=True)
    ]
    theta, omega, tau, measured = (
        np.concatenate(parts, axis=1) for parts in zip(*cuts, strict=True)
    )
    start = np.concatenate([theta, omega])
    states, good = simulated(model, c, np.concatenate(dt), start, tau, measured)
    last = 0
    for (_, _, windows), periods in zip(batch, dt, strict=True):
        own = slice(last, last := last + periods.size)
        ends = [rows[:, own].reshape(2, -1) for rows in (states[:2], tau[:, :, :-1], states[2:])]
        motion = Segment(0.0, windows.dt, ends[0], ends[1], ends[2])
        yield Windows(windows.dt, windows.length, 0.0, None), motion, OVERLAP, good[own]


def _explained(following: Following, batch: Sequence[_Piece]) -> Iterator[_Motion]:
    """What the reference explains of each piece; of one without, no window is good."""
    for _, piece, windows in batch:
        motion = following.motion(piece)
        count = (len(piece) - 2 * windows.margin) // windows.step - OVERLAP
        good = np.full(count // _STRIDE + 1, motion is not None)
        yield windows, motion or piece, _STRIDE, good


def cut(piece: Segment, windows: Windows) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Every `_STRIDE`-th window of a piece: R windows of L samples.

    Returns
    -------
    Angles and velocities (2, R) at their starts, torques (2, R, L + 1) and angles (2, R, L)
    """
    length, margin = OVERLAP * windows.step, windows.margin
    starts = margin + np.arange(
        0, len(piece) - 2 * margin - length + 1, windows.step * _STRIDE, dtype=np.int64
    )
    instants = starts[:, None] + np.arange(length + 1)
    at = np.clip(instants - windows.shift / windows.dt, 0, len(piece) - 1)
    before = np.minimum(at.astype(np.int64), len(piece) - 2)
    tau = piece.tau[:, before] + (at - before) * (piece.tau[:, before + 1] - piece.tau[:, before])
    measured = piece.theta[:, instants[:, :-1]]
    if windows.bandwidth is None:
        assert piece.omega is not None  # `Windows.equations` has asked for it
        return piece.theta[:, starts], piece.omega[:, starts], tau, measured
    reach = half_length(piece.dt, windows.bandwidth)
    theta, omega = (
        correlate(piece.theta, kernel(piece.dt, windows.bandwidth))[:, starts - reach]
        for kernel in (smoother, differentiator)
    )
    return theta, omega, tau, measured


def simulated(
    model: Model,
    c: FloatArray,
    dt: FloatArray,
    start: FloatArray,
    tau: FloatArray,
    measured: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The motion that windows cut from logs would have had, of samples `dt` (R,) s apart.

    Runge-Kutta's fourth order in steps of some `_STEP` s, all windows side by side, from the
    measured `start` (4, R). (To start earlier, so that what the unmodelled torque did before has
    faded, made the instruments too weak.)

    Returns
    -------
    Angles and velocities (4, R, L), and the windows (R,) that have not gone astray: their mass
    matrix is positive definite all along, and they end near the measured ones
    """
    stride = _stride(float(dt[0]))
    h = stride * dt
    inside = np.arange(stride) / stride
    # the torque where the method asks for it
    acts = np.ascontiguousarray(np.moveaxis(tau[:, :, :: stride // 2], 2, 0))
    x = start
    parts = []  # a step each: states at both ends, and their rates
    with np.errstate(
        divide="ignore", invalid="ignore", over="ignore"
    ):  # what moves no arm is judged afterwards
        for step in range(0, 2 * (measured.shape[2] // stride), 2):
            ahead, first, last = advanced(model, c, x, acts[step : step + 3], h)
            # of the angles, the velocity at the end is nearer than the method's last rate
            last = np.concatenate([ahead[2:], last[2:]])
            parts.append((x, ahead, h * first, h * last))
            x = np.clip(ahead, -1e6, 1e6)
    states = _cubic(np.moveaxis(np.array(parts), 0, -1), inside)
    (m11, m12), (_, m22) = inertia(model, c, states[:2, :, ::stride])
    good = np.all((m11 > 0) & (m11 * m22 > m12**2), axis=-1)
    good &= np.abs(states[:2] - measured).max(axis=(0, 2)) < _ASTRAY
    # A window that went astray is left out; products of its velocities would overflow.
    states[:, ~good] = 0.0
    return states, good


def _cubic(parts: FloatArray, s: FloatArray) -> FloatArray:
    """Cubic Hermite (4, R, K S) at shares `s` (S,) of K steps.

    `parts` (4, 4, R, K) are what the steps begin and end at, and how much both ends rise a step.
    """
    rise_of_end = s**2 * (3 - 2 * s)
    weights = np.stack([1 - rise_of_end, rise_of_end, s * (1 - s) ** 2, s**2 * (s - 1)])
    return np.einsum("wark,ws->arks", parts, weights).reshape(*parts.shape[1:3], -1)
