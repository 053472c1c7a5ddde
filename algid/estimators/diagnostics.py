"""Signs of wrong estimates: bounds of physics, terms without worth, logs of another arm.

Physics demands a positive definite mass matrix, no negative friction, mass, inertia k5 or length.
M(θ) is positive definite for every θ2 where M22 > 0 and det M > 0; the determinant is concave in
cos θ2, so its least value lies at θ2 = 0 or θ2 = π. Eq. (2), with the rotor inertia j2 in M22.

A term's worth is the fall of the likelihood when its coefficients are set to zero, which near the
estimate is the Wald statistic. It is formed with the covariance that the error bars rest on, so
that coloured residuals do not make every term look significant; the Bayesian criterion (Schwarz
1978) counts as samples what is independent.

k1 … k5 get no error bar where a joint stood still or was hardly driven, or the joints disagree.
Where a likelihood is refuted and there are few logs, what differs from run to run does not show by
itself. What is alike in every run, a wrong torque constant say, shows in no number of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from algid.arm import FloatArray
from algid.base.compiled import chi2_exceeded, chi2_tail, normal_exceeded
from algid.base.criteria import STILL
from algid.base.names import named_values, outside, within
from algid.base.significance import sigmas
from algid.estimators import weak
from algid.estimators.combine import (
    FEWEST_LOGS,
    RANK_TOLERANCE,
    LogInformation,
    Prior,
    combine,
    likelihood,
    of_kind,
    scaled_pinv,
)
from algid.estimators.fit import Fit, alone
from algid.estimators.identifiability import sizes
from algid.estimators.modulating_functions import MOTORLESS
from algid.estimators.parametrisation import Shared
from algid.estimators.problem import Problem
from algid.estimators.weak import Normal
from algid.model import (
    K1,
    K2,
    K3,
    K5,
    PARAMETERS,
    SINES,
    Model,
    inertia,
    length_by_coupling,
    phasor,
)
from algid.notices import Notice
from algid.physics.terms import OPTIONAL

_NUDGE = 1e-6  # of a parameter's size: step of the differences
FAR_BEYOND = sigmas(sides=1)
"""Standard deviations past a bound of physics beyond which chance is no explanation; one-sided."""
# of a parameter's size: distance kept from a bound, until the solver keeps it
_INSIDE = (1e-6, 1e-5, 1e-4, 1e-3)


@dataclass(frozen=True)
class BrokenBound:
    """A bound that the estimates violate: its name, the value found, and its distance.

    `distance` counts standard deviations; it is None where the standard deviation is unknown.
    """

    bound: str
    value: float
    distance: float | None


def bounds(shared: Shared, beta: FloatArray) -> dict[str, float]:
    """What must not be negative at the shared parameters `beta` (Q,), by name.

    Each is in its own unit: kg m², its square, the parameter's, or k1 k2's.
    """
    model = shared.model
    k1 = phasor(model, beta, K1)
    bent = -np.angle(k1)
    if abs(bent) > np.pi / 2:
        bent += np.pi  # k1 itself may be negative: a convention of θ2
    poses = np.array([[0.0, 0.0], [bent, bent + np.pi]])
    (m11, m12), (m21, m22) = inertia(model, beta[: len(model.names)], poses)
    at_0, at_pi = (m11 * m22 - m12 * m21).tolist()
    values = {
        "M22 > 0": float(m22[0]),
        "det M > 0 at theta2 = 0": at_0,
        "det M > 0 at theta2 = pi": at_pi,
    }
    if model.gravity > 0:
        # Table 1: k1 k2 = m2² g l1 lc2²; as phasors, θ1's zero lies between them
        values["k1 k2 >= 0"] = (k1 * phasor(model, beta, K2).conjugate()).real
    for name, value in named_values(shared.names, beta).items():
        if PARAMETERS[name].sign == "+":
            values[f"{name} >= 0"] = value
    return values


def broken_bounds(fit: Fit) -> list[BrokenBound]:
    """Bounds that the estimates break.

    A parameter that the logs leave open breaks none, nor does a term that is shrunk: it takes up
    what the model lacks.
    """
    known = fit.determined.difference(fit.shrunk)
    open_ones = {f"{name} >= 0" for name in outside(fit.names, known)}
    if {K1, K2} & set(fit.absent):
        open_ones.add("k1 k2 >= 0")
    if {K1, K3, K5} & set(fit.absent):
        open_ones |= {"M22 > 0", "det M > 0 at theta2 = 0", "det M > 0 at theta2 = pi"}
    broken = []

    def value_of(name: str, beta: FloatArray) -> float:
        return bounds(fit.shared, beta)[name]

    for name, value in bounds(fit.shared, fit.values).items():
        if value < 0 and name not in open_ones:
            _, deviation = measured(fit, partial(value_of, name))
            distance = -value / deviation if deviation > 0 else None
            broken.append(BrokenBound(name, value, distance))
    return broken


def length_by_constants(fit: Fit) -> tuple[float, float] | None:
    """l1 = g k1 / k2 (Table 1) and its standard deviation, in m.

    None where the logs leave k1 or k2 open.

    No gain of both torques changes it: where it is not the length that is known, gravity is
    compensated in part, or the zeros or the terms of the torque are wrong.
    """
    if not {K1, K2} <= fit.determined:
        return None

    def length(beta: FloatArray) -> float:
        values = named_values(fit.names, beta)
        return length_by_coupling(values, fit.shared.model.gravity) or 0.0

    return measured(fit, length) if length(fit.values) else None


def measured(fit: Fit, function: Callable[[FloatArray], float]) -> tuple[float, float]:
    """A function of the parameters (Q,) at their values, and its standard deviation."""
    slope = _slope(function, fit.values, sizes(fit.names, fit.values))
    variance = float(slope @ fit.covariance @ slope)
    return function(fit.values), float(np.sqrt(max(variance, 0.0)))


def _slope(
    function: Callable[[FloatArray], FloatArray | float], beta: FloatArray, size: FloatArray
) -> FloatArray:
    """Derivatives (Q, ...) by the parameters `beta` (Q,), by differences of a share of `size`."""
    steps = _NUDGE * np.diag(size)
    return np.array(
        [(function(beta + step) - function(beta - step)) / (2 * step.max()) for step in steps]
    )


def constrained(fit: Fit) -> Fit:
    """The most likely parameters within the bounds.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    Fit
        `fit` itself where it breaks no bound. Else the note names the bounds that had to be
        enforced; or those that no point was found within: then the free estimates stand, with
        status NOT_CONVERGED. Standard deviations stay those of the free fit: a bound that holds
        says nothing about the other parameters' noise.
    """
    enforced = broken_bounds(fit)
    if not enforced:
        return fit
    from scipy.optimize import minimize

    size = sizes(fit.names, fit.values)
    S = likelihood(fit.shared, fit.logs, fit.values, fit.prior)[2]
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1 / size**2))

    def cost(x: FloatArray, unit: float) -> tuple[float, FloatArray]:
        value, gradient, _ = likelihood(fit.shared, fit.logs, fit.values + scale * x, fit.prior)
        return -value / unit, -gradient * scale / unit

    def margins(beta: FloatArray) -> FloatArray:
        return np.array(list(bounds(fit.shared, beta).values()))

    steepness = np.linalg.norm(_slope(margins, fit.values, size) * size[:, None], axis=0)
    steepness[steepness == 0] = 1.0

    def within_bounds(x: FloatArray, inside: float) -> FloatArray:
        return margins(fit.values + scale * x) / steepness - inside

    x, disobeyed = np.zeros(scale.size), enforced
    options = {"maxiter": 500, "ftol": 1e-12}
    for inside in _INSIDE:
        unit = 1 + abs(cost(x, 1.0)[0])  # the solver's tolerances are absolute
        solution = minimize(
            partial(cost, unit=unit),
            x,
            jac=True,
            method="SLSQP",
            constraints={"type": "ineq", "fun": partial(within_bounds, inside=inside)},
            options=options,
        )
        if not np.all(np.isfinite(solution.x)):
            break
        x = solution.x
        moved = replace(fit, values=fit.values + scale * x)
        disobeyed = broken_bounds(moved)
        if not disobeyed:
            return moved.noted(
                Notice("BROKEN_BOUND", numbers={"case": "active", "bounds": _named(enforced)})
            )
    note = Notice("BROKEN_BOUND", numbers={"case": "infeasible", "bounds": _named(disobeyed)})
    return replace(fit.marked("NOT_CONVERGED"), converged=False).noted(note)


def _named(bounds: Sequence[BrokenBound]) -> list[str]:
    names = []
    for one in bounds:
        name = one.bound
        if one.distance is not None:
            name += f" ({one.distance:.2g} standard deviations beyond)"
        names.append(name)
    return names


_RATIOS = np.geomspace(1e-3, 1e3, 1001)
"""Between the constants of two joints' equations: steps of 1.4 %."""


def ratio_of_joints(normals: Sequence[Normal], model: Model, unlike: float) -> float | None:
    """By what the k1, k2 and k3 of joint 1's equation are multiplied to give those of joint 2's.

    Parameters
    ----------
    normals : normal equations of logs of one kind, without a delay's column
    model : Model
        Of their columns.
    unlike : float
        Share of the larger value: what a model lacks makes smaller differences.

    Returns
    -------
    float or None
        The ratio ρ, where it differs from one by more than `unlike` and by `FAR_BEYOND` standard
        deviations at least; negative where the signs differ.

    Notes
    -----
    With f and s the constants by joint 1's and by joint 2's equation alone and F and S their
    sandwich covariances, ρ is where

        χ²(ρ) = (s − ρ f)ᵀ (S + ρ² F)⁻¹ (s − ρ f)

    is least, and (χ²(1) − χ²(ρ))^½ its distance from one. All constants decide together: a torque
    constant that is wrong multiplies every one of them.

    Where one joint is hardly driven, what moves it is friction and play that the model lacks, and
    its equation is solved by constants near nothing. Its residual is small then, so that it
    outweighs the joint that is driven.
    """
    shared = Shared(model)
    if not np.all([normal.power for normal in normals]):
        return None  # without a motor a joint's equation is solved by nothing
    both = np.flatnonzero(np.isin(model.names, (K1, K2, K3)))

    # as one log: how runs differ does not tell what is alike in all of them
    grams, nothing = np.concatenate([one.gram for one in normals]), np.zeros(len(model.names))

    def of_joint(gram: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What one joint's equation gives for the constants of both, and their covariance."""
        own = alone(shared, [LogInformation(False, nothing, gram[:, :-1, :-1], gram[:, :-1, -1])])
        return own.values[both], own.covariance[np.ix_(both, both)]

    (f, F), (s, S) = map(of_joint, grams.swapaxes(0, 1))
    ratios = np.concatenate([[1.0], _RATIOS, -_RATIOS])
    size = np.sqrt(np.maximum(np.diag(S) + np.diag(F), 1e-300))
    apart = (s - ratios[:, None] * f) / size
    V = (S + ratios[:, None, None] ** 2 * F) / np.outer(size, size)
    chi2 = np.einsum("ri,rij,rj->r", apart, np.linalg.pinv(V, RANK_TOLERANCE, True), apart)
    best = np.argmin(chi2)
    ratio = ratios[best]
    differs = min(ratio, 1 / ratio) < 1 - unlike
    if not differs or chi2[0] - chi2[best] < FAR_BEYOND**2:
        return None
    return float(ratio)


def term_worths(fit: Fit) -> Iterator[tuple[str, float]]:
    """ΔBIC of each optional term: n log N − W, Schwarz 1978, W the Wald statistic of n values.

    It is the BIC with the term less that without it: negative if the term earns its place.
    """
    for term in OPTIONAL:
        own = within(term.names, fit.names)
        if own:
            yield term.name, len(own) * float(np.log(max(2, fit.freedom))) - fit.wald(own)


def bent(fit: Fit) -> bool:
    """Whether the moments' sine parts are together more than chance makes one time in twenty."""
    own = within(SINES, fit.names)
    return bool(own) and float(chi2_tail(len(own), fit.wald(own))) < 0.05


_LEAST_TAIL = float(np.finfo(float).tiny)
"""Probability: smaller ones are zero, and infinitely far."""


def payload_distance(fit: Fit) -> float:
    """How far the loaded logs are from the unloaded arm with any payload.

    Returns
    -------
    float
        In standard deviations of a normal variable as unlikely; 0 where the logs of either kind
        do not determine their own constants, or have fewer stretches than constants: directions
        without a variance are rounding's.

    Notes
    -----
    The statistic compares the arm's constants with the loaded arm's, less the payload that fits
    best. Where they agree it is χ² with as many degrees of freedom as constants less those of the
    payload.
    """
    kinds = [of_kind(fit.logs, loaded) for loaded in (False, True)]
    if not (fit.shared.payload and all(kinds)):
        return 0.0
    bare, burdened = (alone(fit.shared, own) for own in kinds)
    constants = len(fit.shared.log_names)
    fewest = min(sum(len(log.S) for log in own) for own in kinds)
    if bare.unidentifiable or burdened.unidentifiable or fewest <= constants:
        return 0.0
    freedom = 2 * constants - len(fit.shared.names)
    arm = Prior.of(bare.names, bare.values, bare.covariance)
    S = scaled_pinv(burdened.covariance)
    nothing = np.zeros_like(burdened.values)
    information = LogInformation(True, burdened.values, S[None], nothing[None])
    _, _, value = combine(fit.shared, [information], fit.values, arm)
    tail = max(float(chi2_tail(freedom, max(0.0, -2 * value))), _LEAST_TAIL)
    return max(0.0, normal_exceeded(tail))


def repeatability(fit: Fit) -> tuple[FloatArray, float, tuple[float, float]] | None:
    """How far the payload differs from run to run.

    Payload mass (n,) in kg of each of n loaded logs by itself, and its standard deviation with the
    95 % interval of that. None with fewer than two loaded logs, or if one does not determine it.

    Each loaded log is fitted for m_p, the arm and the lengths held as all logs have them. The
    interval is that of the standard deviation of normal numbers, by χ² of n − 1: wide where there
    are few runs.
    """
    loaded = of_kind(fit.logs, True)
    if "m_p" not in fit.names or len(loaded) < 2:
        return None
    place = fit.names.index("m_p")
    masses = []
    for log in loaded:
        _, score, S = likelihood(fit.shared, [log], fit.values, None)
        if S[place, place] <= 0:
            return None
        masses.append(fit.values[place] + score[place] / S[place, place])
    freedom = len(masses) - 1
    std = float(np.std(masses, ddof=1))
    low, high = (
        std * float(np.sqrt(freedom / chi2_exceeded(freedom, tail))) for tail in (0.025, 0.975)
    )
    return np.array(masses), std, (low, high)


UNLIKE, UNLIKE_IN_MANY = 0.5, 0.2
"""Share of the larger of two values: more than what a model lacks makes in one run, and in many."""
UNEXPLAINED = 0.1
"""Share of a torque's power: constants that leave more of it do not explain that joint."""
OF_LINK_2 = (K1, K2, K3)
LEAST_ACTING = 0.02
"""Share of the other joint's torque: less at a joint without a motor is bearing or cable."""


def undriven(fit: Fit, problem: Problem) -> Notice | None:
    """Why k1 … k5 are doubtful where they do not explain a joint without a motor.

    Inertia, weight and friction, which cancel there, are then of no size beside the other joint's
    torque: constants near nothing solve that equation too, and least squares ends there where
    friction and cables pull as hard as the arm's own load.
    """
    for c, gram in _at_fit(fit, problem).values():
        power = gram[:, -1, -1]
        for joint in range(2):
            acting = np.diag(gram[joint])[:-1] @ c**2
            if power[joint] == 0 and acting < LEAST_ACTING**2 * power[1 - joint]:
                return Notice("HARDLY_DRIVEN", numbers={"case": "passive", "joint": joint + 1})
    return None


def _at_fit(fit: Fit, problem: Problem) -> dict[bool, tuple[FloatArray, FloatArray]]:
    """Coefficients (q,) of each kind of logs, and sums (2, q + 1, q + 1) of their windows there."""
    shared, columns = fit.shared, len(fit.shared.model.names)
    at = {kind: shared.coefficients(fit.values, kind)[:columns] for kind, _ in problem.kinds()}
    normals = weak.normals_of(problem.at(shared.model, fit.delay), at)
    nothing = np.zeros((2, columns + 1, columns + 1))
    return {
        kind: (c, sum((normal.total for normal in of_kind(normals, kind)), nothing))
        for kind, c in at.items()
    }


def contradicted(fit: Fit, problem: Problem) -> Notice | None:
    """Why k1 … k5 are doubtful in a fit whose likelihood is refuted; None where nothing says so.

    Parameters
    ----------
    fit : Fit
        With `FEWEST_LOGS` logs or more it is the joints' contradiction alone that is asked for, a
        smaller one: see `ratio_of_joints`.
    problem : Problem
        With a model that is linear.
    """
    few = len(fit.logs) < FEWEST_LOGS
    still = [f"joint {joint + 1}" for joint in range(2) if fit.moved[joint] < STILL]
    if few and still:
        return Notice("HARDLY_DRIVEN", numbers={"case": "still", "joints": still})
    model = problem.settings.model
    every = weak.normals_of(problem.at(model, fit.delay))
    for kind in (False, True):
        normals = of_kind(every, kind)
        if not normals:
            continue
        ratio = ratio_of_joints(normals, model, UNLIKE if few else UNLIKE_IN_MANY)
        if ratio is not None:
            return Notice("JOINTS_CONTRADICT", numbers={"ratio": ratio})
        torques = np.max([normal.power / normal.rows for normal in normals], axis=0)
        # a joint without a torque has no motor: see `undriven`
        hardly = (torques > 0) & (torques < MOTORLESS**2 * torques[::-1])
        if not few or not hardly.any():
            continue
        joint = int(np.argmax(hardly)) + 1
        c, gram = _at_fit(fit, problem)[kind]
        if not _confirmed(fit.shared.model.names, joint, c, gram):
            return Notice(
                "HARDLY_DRIVEN",
                numbers={"case": "torque", "joint": joint, "percent": 100 * MOTORLESS},
            )
    return None


def _confirmed(names: Sequence[str], joint: int, c: FloatArray, gram: FloatArray) -> bool:
    """True if both joints confirm the constants of one that is hardly driven, 1 or 2.

    A light second link needs little torque. Its constants stand where they explain that torque,
    and their part of the other joint's torque is larger than what the fit leaves there. What
    bearings and cables make of a joint that no motor moves is confirmed by nothing.
    """
    of_link = np.append(np.where(np.isin(names, OF_LINK_2), c, 0.0), 0.0)
    residual = np.append(-c, 1.0)
    left, part = (gram @ residual) @ residual, (gram @ of_link) @ of_link
    own, other = joint - 1, 2 - joint
    return bool(left[own] < UNEXPLAINED * gram[own, -1, -1] and left[other] < part[other])
