"""The coefficients that an export rests on: a result's own, or what they become once l1 is given.

k1 = m2 l1 lc2 and k2 = m2 g lc2 leave l1 = g k1 / k2 to a model made of links. Where l1 is known, the estimates are
conditioned on it: with their covariance C and a the gradient of g k1 - l1 k2,

    c' = c - C a (g k1 - l1 k2) / (aᵀ C a),   C' = C - C a aᵀ C / (aᵀ C a)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.identification.by_likelihood import model_of
from algid.identification.lengths import has_error_bar
from algid.identification.validate import torque_constants
from algid.model import Model
from algid.results import Result


@dataclass(frozen=True)
class Coefficients:
    """The torque's model, its coefficients by name, and the standard deviation of each that has one.

    `value` holds a zero for every coefficient that the model lacks; `conditioned` says whether l1 moved them.
    """

    model: Model
    value: Mapping[str, float]
    std: Mapping[str, float]
    conditioned: bool = False


def coefficients_of(result: Result, file: str, l1: float | None = None) -> Coefficients:
    """The coefficients of the result in `file`, conditioned on the length `l1` in m of link 1 where it is given.

    Raises
    ------
    ResultError
        If a coefficient has no estimate, or no arm has such an inertia matrix.
    """
    model = model_of(result)
    c = torque_constants(result, model, "unloaded", file)
    C = _covariance(result, model)
    conditioned = l1 is not None and model.gravity > 0
    if conditioned:
        assert l1 is not None
        c, C = _conditioned(model, c, C, l1)
    value = model.values(c)
    spread = np.sqrt(np.maximum(np.diag(C), 0.0)).tolist()
    std = {name: one for name, one in zip(model.names, spread, strict=True) if has_error_bar(result, name)}
    k1, k3, k5 = value["k1"], value["k3"], value["k5"]
    if min(k3, k5) <= 0 or k3 * k5 <= k1**2:
        raise ResultError(
            f"{file}: its inertia matrix is not positive definite (k1 {k1:.3g}, k3 {k3:.3g}, k5 {k5:.3g} kg m²), so "
            "that masses would come out negative; "
            + ("check --l1" if conditioned else "identify it from logs that tell more")
        )
    return Coefficients(model, value, std, conditioned)


def _covariance(result: Result, model: Model) -> FloatArray:
    """C (q, q) of the model's columns, zero where the result has no error bar."""
    C = np.zeros((len(model.names), len(model.names)))
    known = [name for name in model.names if has_error_bar(result, name)]
    if known and result.fit is not None:
        places = [result.fit.covariance_names.index(name) for name in known]
        rows = [model.names.index(name) for name in known]
        C[np.ix_(rows, rows)] = np.array(result.fit.covariance, dtype=np.float64)[np.ix_(places, places)]
    return C


def _conditioned(model: Model, c: FloatArray, C: FloatArray, l1: float) -> tuple[FloatArray, FloatArray]:
    first, second = model.names.index("k1"), model.names.index("k2")
    a = np.zeros(c.size)
    a[first], a[second] = model.gravity, -l1
    if a @ C @ a > 0:
        gain = C @ a / (a @ C @ a)
        return c - gain * (a @ c), C - np.outer(gain, a @ C)
    equally = np.zeros(c.size)  # without error bars, k1 and k2 are taken as equally wrong for their size
    equally[[first, second]] = c[[first, second]] ** 2 * a[[first, second]]
    return c - equally * (a @ c) / (a @ equally), C
