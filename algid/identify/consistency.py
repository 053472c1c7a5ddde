"""What physics demands of the estimates: a positive definite mass matrix, no negative friction, mass or length.

M(θ) is positive definite for every θ2 where M22 > 0 and det M > 0; the determinant is concave in cos θ2, so its
least value lies at θ2 = 0 or θ2 = π. Eq. (2), with the rotor inertia j2 in M22.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from algid.arm import FloatArray
from algid.identify.fit import Fit
from algid.identify.identifiability import sizes
from algid.identify.information import likelihood
from algid.identify.shared import Shared

_NOT_NEGATIVE = ("k6", "k7", "f1", "f2", "j2", "m_p", "l1", "l2")
_NUDGE = 1e-6  # of a parameter's size: step of the differences, and distance kept from a bound


@dataclass(frozen=True)
class BrokenBound:
    """A bound that the estimates break: its name, the value found, and how many standard deviations beyond.

    `distance` is None where the standard deviation is unknown.
    """

    bound: str
    value: float
    distance: float | None


def bounds(shared: Shared) -> dict[str, Callable[[FloatArray], float]]:
    """Functions of the shared parameters (Q,) that must not be negative, by name."""
    found: dict[str, Callable[[FloatArray], float]] = {
        "M22 > 0": lambda beta: _mass(shared, beta)[0],
        "det M > 0 at theta2 = 0": lambda beta: _mass(shared, beta)[1],
        "det M > 0 at theta2 = pi": lambda beta: _mass(shared, beta)[2],
    }
    for place, name in enumerate(shared.names):
        if name in _NOT_NEGATIVE:
            found[f"{name} >= 0"] = lambda beta, place=place: float(beta[place])  # type: ignore[misc]
    return found


def _mass(shared: Shared, beta: FloatArray) -> tuple[float, float, float]:
    """M22 and the determinant of M at θ2 = 0 and π."""
    full = shared.model.expand(beta[: len(shared.model.names)])
    k1, k3, k5, j2 = full[0], full[2], full[4], full[11]
    det = [(k5 + k3 + 2 * k1 * c) * (k3 + j2) - (k3 + k1 * c) ** 2 for c in (1.0, -1.0)]
    return float(k3 + j2), float(det[0]), float(det[1])


def broken_bounds(fit: Fit) -> list[BrokenBound]:
    """Bounds that the estimates break; a parameter that the logs leave open breaks none."""
    size = sizes(fit.names, fit.values)
    open_ones = {f"{name} >= 0" for name, std in zip(fit.names, fit.std, strict=True) if np.isinf(std)}
    broken = []
    for name, bound in bounds(fit.shared).items():
        value = bound(fit.values)
        if value >= 0 or name in open_ones:
            continue
        slope = _slope(bound, fit.values, size)
        deviation = float(np.sqrt(max(0.0, float(slope @ fit.covariance @ slope))))
        broken.append(BrokenBound(name, value, -value / deviation if deviation > 0 else None))
    return broken


def _slope(bound: Callable[[FloatArray], float], beta: FloatArray, size: FloatArray) -> FloatArray:
    steps = _NUDGE * np.diag(size)
    return np.array([(bound(beta + step) - bound(beta - step)) / (2 * step.max()) for step in steps])


def constrained(fit: Fit) -> Fit:
    """The most likely parameters within the bounds; the fit itself where it breaks none.

    Standard deviations stay those of the free fit: a bound that holds says nothing about the other parameters'
    noise. Status NOT_CONVERGED where no point within the bounds was found.
    """
    if not broken_bounds(fit):
        return fit
    from scipy.optimize import minimize

    size = sizes(fit.names, fit.values)
    S = likelihood(fit.shared, fit.logs, fit.values, fit.prior)[2]
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1 / size**2))

    def cost(x: FloatArray) -> tuple[float, FloatArray]:
        value, gradient, _ = likelihood(fit.shared, fit.logs, fit.values + scale * x, fit.prior)
        return -value, -gradient * scale

    demands = [
        {"type": "ineq", "fun": _demand(bound, fit.values, scale, size)} for bound in bounds(fit.shared).values()
    ]
    solution = minimize(
        cost, np.zeros(scale.size), jac=True, method="SLSQP", constraints=demands, options={"maxiter": 500}
    )
    values = fit.values + scale * solution.x
    moved = replace(fit, values=values)
    if broken_bounds(moved):
        return replace(fit, converged=False, status=_failed(fit.status))
    return moved


def _demand(
    bound: Callable[[FloatArray], float], start: FloatArray, scale: FloatArray, size: FloatArray
) -> Callable[[FloatArray], float]:
    """The bound in the solver's coordinates, in units of its own slope, a hair inside."""
    slope = float(np.linalg.norm(_slope(bound, start, size) * size)) or 1.0

    def demand(x: FloatArray) -> float:
        return bound(start + scale * x) / slope - _NUDGE

    return demand


def _failed(status: Sequence[str]) -> tuple[Literal["OK", "NOT_IDENTIFIABLE", "NOT_CONVERGED"], ...]:
    return tuple("NOT_CONVERGED" if word == "OK" else "NOT_IDENTIFIABLE" for word in status)
