"""The refined estimator: errors-in-variables maximum likelihood over any number of logs.

It starts from the weak estimate. On a training set, whole short logs or evenly spread pieces of
long ones, it alternates Gauss-Newton steps for the shared parameters, for every piece's trajectory
and for the noise levels. Where pieces were left out, one pass over everything at the trained
values and one more step make the estimate efficient (Le Cam's one-step estimator): the start is
already within its own error bars.

Over x, the logarithms of friction's widths ω_s and ω_S, the deviance D (minus twice the
log-likelihood, all other parameters at their best) is walked down by octaves and then by half
octaves. A paraboloid through the lowest value and those beside it has its bottom at the widths, and
by its curvature

    Cov(x) = 2 (D″)⁻¹,   Cov(β) gains  β′ Cov(x) β′ᵀ

with β′ the change of the best parameters with x.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import SETTLED
from algid.base.names import evenly_spread, named_values
from algid.base.progress import Progress
from algid.base.quantiles import quantile
from algid.base.significance import level
from algid.estimators.body import with_body
from algid.estimators.combine import Prior, combine
from algid.estimators.fit import Fit, finish
from algid.estimators.identifiability import open_directions
from algid.estimators.innovations import judge
from algid.estimators.log_likelihood import LogEvidence, Outcome, opened
from algid.estimators.misfit import Products, misfit, shapes
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem
from algid.estimators.repeats import Groups, grouped
from algid.estimators.weak import fit as weak_fit
from algid.model import acting, widths_in
from algid.notices import Notice
from algid.physics.signals import TRIED
from algid.signals.segments import Segment

_STEPS = 20
_NOISE_STEPS = 12  # then noise levels stay and columns are smooth, so that the rest can settle
_NOISE_SETTLED = 0.2  # change of every log variance in its standard deviations
_REST = 0.01  # standard deviations: sum of the steps that are not taken
_MOST_SCORED = 32  # logs; of more, those whose noise levels have settled are not scored again
_MOST_TESTED = 32  # logs whose residual is held against the motion, evenly spread
_MOST_COMPARED = 32  # logs among which repeats of a motion are looked for, pair by pair
_CLOSE = 0.1  # standard deviations of the last step: friction's step at noisy speeds may keep it up
_FAR = 3.0  # standard deviations of the training set beyond which the last step is repeated
_PASSES = 4
_DRIVEN = 0.5  # standard deviations of a step back over the one before: noise drives it
_WIDTHS = 4  # times that the width of friction's step is looked for
_WIDTH_SETTLED = 0.05  # change of its logarithm
_WIDTH_FAR = 0.5  # the same where the likelihood was refuted: no less would mend that
_ANCHOR = 1e-3  # of a parameter's size: how firmly a direction without information is held


End = Literal["settled", "refuted", "unsettled"]


def fit(problem: Problem) -> Fit:
    """Most likely parameters of the arm, and of its payload where there are loaded logs.

    Parameters
    ----------
    problem : Problem
        Its window and bandwidth are of the weak estimate that this starts from.

    Returns
    -------
    Fit
        The weak estimate, with the reason among its notes, where the likelihood does not hold or
        the iteration did not converge.

    Raises
    ------
    TooShortError
        If there is no log, or no log long enough.
    """
    start, prior = weak_fit(problem), problem.prior
    logs, anchored = opened(problem), _anchored(start)
    turn, dt = max((largest_turn(log.kept), log.kept[0].dt) for log in logs)
    if turn > FAR:
        numbers = {"case": "turn", "kept": start.estimator, "turn": turn, "rate": turn / FAR / dt}
        return start.noted(Notice("SLOW_SAMPLING", numbers=numbers))
    iterations = 0

    def given_up(case: str, **more: float) -> Fit:
        numbers = {"case": case, "kept": start.estimator} | more
        return replace(start.noted(Notice("REFUTED", numbers=numbers)), iterations=iterations)

    try:
        trained = _train(start.shared, logs, start.values, anchored, problem.progress)
        iterations = trained.steps
        trained, of_width = _settled_widths(trained, logs, anchored, problem.progress)
        if trained.end == "refuted":
            return given_up("noise")
        if trained.end == "unsettled":
            return given_up("not converged")
        if not all(log.whole for log in logs):
            trained = _finish(trained, logs, anchored)
        residual = tuple(outcome.residual for outcome in trained.outcomes)
        repeats: Groups = ()
        if len(logs) <= _MOST_COMPARED:
            kinds = ([log.training for log in logs if log.loaded is kind] for kind in (False, True))
            repeats = grouped(*kinds)
        fitted = finish(
            "refined",
            trained.shared,
            [outcome.information for outcome in trained.outcomes],
            trained.beta,
            start.moved,
            prior,
            coloured=not all(judge(residual).joint_white),
            samples=int(_count(trained.outcomes)),
            repeats=repeats,
        )
        tested, at = evenly_spread(logs, _MOST_TESTED), {}
        for log in tested:
            log.smooth, log.by_motion = True, not acting(fitted.shared.model, "elastic")
            c = fitted.shared.coefficients(fitted.values, log.loaded)
            at[log.loaded] = named_values(fitted.shared.log_names, c)
        delay = problem.settings.shift.delay
        products = Products(tested, fitted.shared.model, at, delay, shapes)
        p_value = misfit(tested, (log.noise.tau for log in tested), fitted, products)
    except np.linalg.LinAlgError:  # also of joints that never move
        return given_up("not converged")
    if p_value < level("REFUTED"):
        return replace(given_up("motion", p_value=p_value), products=products)
    # No surer than the weak estimate: a joint at rest trembles in noise, which is no motion.
    status = [
        own if before == "OK" else before
        for own, before in zip(fitted.status, start.status, strict=True)
    ]
    return with_body(
        replace(
            fitted,
            covariance=fitted.covariance + of_width,
            status=tuple(status),
            unidentifiable=tuple(dict.fromkeys(fitted.unidentifiable + start.unidentifiable)),
            noise=tuple(log.noise for log in logs),
            residual=residual,
            iterations=iterations,
            products=products,
        )
    )


def _anchored(start: Fit) -> Prior | None:
    """The prior, and an anchor on every direction that the weak estimate leaves open.

    There the trajectories and the parameters would chase each other for ever, in nothing but noise.
    """
    prior, names = start.prior, start.names
    _, S, _ = combine(start.shared, start.logs, start.values, prior)
    null, size = open_directions(names, start.values, S)
    if null.shape[1] == 0:
        return prior
    mean = start.values.copy()
    precision = (null @ null.T) / np.outer(size, size) / _ANCHOR**2
    if prior is not None:
        places = prior.places(names)
        precision[np.ix_(places, places)] += prior.precision
        mean[places] = prior.mean
    return Prior(names, mean, precision)


FAR = 0.35
"""rad from one sample to the next: beyond it derivatives by differences do not follow a turn. A
stencil of nine samples errs by the eighth power of this angle, over 3150, of the fastest part of
an acceleration, and the joints' coupling has parts three times as fast as the joints turn."""
_SELDOM = 1e-3
"""Share of the samples between which a joint may turn further."""


def largest_turn(pieces: Sequence[Segment]) -> float:
    """What a joint turns from sample to sample, in rad, but for the largest `_SELDOM` of turns."""
    turns = [np.abs(np.diff(piece.theta, axis=1)).max(axis=0) for piece in pieces]
    return float(quantile(np.concatenate(turns), 1 - _SELDOM)) if turns else 0.0


@dataclass(frozen=True, eq=False)
class _Trained:
    """Parameters (Q,) of `shared`, the last pass over each log, the steps, and how they ended."""

    shared: Shared
    beta: FloatArray
    outcomes: list[Outcome]
    steps: int
    end: End


def _train(
    shared: Shared,
    logs: Sequence[LogEvidence],
    beta: FloatArray,
    prior: Prior | None,
    progress: Progress | None,
) -> _Trained:
    """The alternation from the parameters `beta` on."""
    total = sum(log.trained for log in logs)
    many = len(logs) > _MOST_SCORED
    before = np.zeros_like(beta)
    end: End = "unsettled"
    for steps in range(1, _STEPS + 1):
        outcomes: list[Outcome] = []
        done = 0
        free = steps <= _NOISE_STEPS
        for log in logs:
            outcomes.append(log.train(shared, beta, free=free))
            done += log.trained
            if progress is not None:
                progress(f"fitting, step {steps}", done, total)
        better, S, _ = combine(shared, [outcome.information for outcome in outcomes], beta, prior)
        step = better - beta
        earlier, moved = _distance(before, S), _distance(step, S)
        # Accelerations of trajectories keep noise, which makes columns look more informed than
        # they are: what only such columns tell apart is chased to and fro, and further back.
        driven = moved > _DRIVEN and -float(step @ S @ before) > earlier**2 > 0
        if driven or not free:
            for log in logs:
                log.smooth = True
        before, beta = step, better
        if not np.all(np.isfinite(beta)):
            raise np.linalg.LinAlgError("the estimates run away")
        if many and free and steps > 1:
            for log, outcome in zip(logs, outcomes, strict=True):
                log.sure = outcome.noise_change < _NOISE_SETTLED
        if max(outcome.noise_change for outcome in outcomes) >= _NOISE_SETTLED:
            continue
        # on the way to its level noise may be larger
        if misfit(logs, [log.noise.tau for log in logs]) < level("REFUTED"):
            end = "refuted"
            break
        # Steps that shrink do so in the same ratio: what is left of the geometric series.
        if steps > 1 and (
            moved < SETTLED or (moved < earlier and moved**2 / (earlier - moved) < _REST)
        ):
            end = "settled"
            break
    # steps within what a torque's error that matters would leave, where there is next to none
    error = max(log.relative_error for log in logs)
    if end == "unsettled" and moved * min(1.0, error) < _CLOSE:
        end = "settled"
    return _Trained(shared, beta, outcomes, steps, end)


def _settled_widths(
    trained: _Trained,
    logs: list[LogEvidence],
    prior: Prior | None,
    progress: Progress | None,
) -> tuple[_Trained, FloatArray]:
    """What was `trained`, at the likeliest widths of friction, and what these add (Q, Q).

    The weak form sees friction through a differentiator whose noise blurs the step: what it takes
    for a width may be several times the true one. The likelihood may be refuted by that alone.
    The `logs` are those of these widths then.
    """
    names = widths_in(trained.shared.model.terms)
    added: FloatArray = np.zeros((trained.beta.size,) * 2)
    if not names:
        return trained, added

    def shared_at(widths: FloatArray) -> Shared:
        shared = trained.shared
        held: dict[str, Any] = named_values(names, widths)
        return replace(shared, model=replace(shared.model, **held))

    def profile(widths: FloatArray) -> tuple[float, FloatArray]:
        other, beta = shared_at(widths), trained.beta
        try:
            seen = [log.held(other, beta) for log in logs]
        except np.linalg.LinAlgError:  # so narrow a step does not go with the trajectories
            return np.inf, beta
        better, _, value = combine(other, [outcome.information for outcome in seen], beta, prior)
        return sum(outcome.deviance for outcome in seen) - 2 * value, better

    ends = np.array([(_NARROWER * min(TRIED[name]), _WIDER * max(TRIED[name])) for name in names])
    for _ in range(_WIDTHS):
        now = np.array([getattr(trained.shared.model, name) for name in names])
        widths, added = likeliest_widths(profile, now, ends)
        moved = float(np.abs(np.log(widths / now)).max())
        if moved < _WIDTH_SETTLED or (trained.end != "settled" and moved < _WIDTH_FAR):
            break
        anew = [log.afresh() for log in logs]
        again = _train(shared_at(widths), anew, trained.beta, prior, progress)
        if again.end == "unsettled" and trained.end == "settled":
            break  # too narrow a step for the motion
        trained, logs[:] = again, anew
        if trained.end != "settled":
            break
    return trained, added


def _finish(trained: _Trained, logs: Sequence[LogEvidence], prior: Prior | None) -> _Trained:
    """Passes over whole logs until the step is one that a single Gauss-Newton step can make."""
    for _ in range(_PASSES):
        shared, beta = trained.shared, trained.beta
        outcomes = [log.run(shared, beta) for log in logs]
        better, S, _ = combine(shared, [outcome.information for outcome in outcomes], beta, prior)
        share = sum(log.trained for log in logs)
        far = _distance(better - beta, S) * np.sqrt(share / max(share, _count(outcomes)))
        trained = replace(trained, beta=better, outcomes=outcomes)
        if far < _FAR * np.sqrt(beta.size):
            break
    return trained


def _distance(step: FloatArray, S: FloatArray) -> float:
    """Length of a step in standard deviations."""
    return float(np.sqrt(np.maximum(step @ S @ step, 0.0)))


def _count(outcomes: Sequence[Outcome]) -> float:
    return float(sum(outcome.residual.counts[0] for outcome in outcomes))


Profile = Callable[[FloatArray], tuple[float, FloatArray]]
"""By widths (W,) in rad/s the deviance, and the best parameters (Q,)."""
_NARROWER, _WIDER = 0.4, 3.125
"""How far widths may lie beyond those that logs are tried with: no joint's friction turns in less
than 0.004 rad/s, and none in more than 1."""
_HALF_OCTAVE = 0.5 * np.log(2.0)


def likeliest_widths(
    profile: Profile, start: FloatArray, ends: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The widths (W,) in rad/s at which the deviance is least, walking from `start`.

    With them what not knowing them adds to the parameters' covariance (Q, Q).

    Parameters
    ----------
    profile : callable
    start : (W,), rad/s
    ends : (W, 2), the narrowest and the widest, rad/s
    """
    low, high = np.log(ends).T
    first, h = np.clip(np.log(start), low, high), _HALF_OCTAVE
    along = np.eye(start.size, dtype=np.int64)

    @cache
    def seen(*steps: int) -> FloatArray:
        x = first + h * np.array(steps)
        if np.any((x < low) | (high < x)):
            return np.array([np.inf])
        value, beta = profile(np.exp(x))
        return np.append(value if np.isfinite(value) else np.inf, beta)

    def at(place: NDArray[np.int64]) -> FloatArray:
        """The deviance and the best parameters so many half octaves from the first widths."""
        return seen(*place.tolist())

    def deviance(place: NDArray[np.int64]) -> float:
        return float(at(place)[0])

    place = 0 * along[0]
    for step in (2, 1):
        while True:
            around = (place + side * step * one for one in along for side in (-1, 1))
            best = min(around, key=deviance)
            if deviance(best) >= deviance(place):
                break
            place = best
    x, here = first + h * place, at(place)
    # a width at an end of its range is taken for known
    free = [one for one in along if np.isfinite(deviance(place + one) + deviance(place - one))]
    if not (free and np.isfinite(here[0])):
        return np.exp(x), np.zeros((here.size - 1,) * 2)
    below, above = np.array([[at(place + side * one) for one in free] for side in (-1, 1)])
    slope = 0.5 * (above - below)
    H = np.diag((below - 2 * here + above)[:, 0])
    for i, j in combinations(range(len(free)), 2):
        mixed = sum(
            a * b * deviance(place + a * free[i] + b * free[j]) for a in (-1, 1) for b in (-1, 1)
        )
        H[i, j] = H[j, i] = 0.25 * mixed if np.isfinite(mixed) else 0.0
    # in shares of what lies between the ends, of which no width is known worse than if all of it
    # were as likely
    span = np.array(free) @ ((high - low) / h)
    curvature, axes = np.linalg.eigh(H * np.outer(span, span))
    curvature, to = np.maximum(curvature, 1e-300), axes * span[:, None]
    offset = np.transpose(free) @ (to @ (to.T @ -slope[:, 0] / curvature))
    moved = to.T @ slope[:, 1:]
    variance = np.minimum(2.0 / curvature, 1 / 12)
    return np.exp(x + h * np.clip(offset, -1, 1)), (moved.T * variance) @ moved
