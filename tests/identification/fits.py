"""Fits made by hand, so that what a result says of one can be checked against numbers written
down.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation
from algid.estimators.fit import Fit
from algid.estimators.parametrisation import Shared
from algid.identification.recordings import Recording, open_source
from algid.log import Log
from algid.model import Model
from algid.synth.cases import load_case

CASE = load_case("case1")
K = CASE.arm.constants()
QUANTILE = 2.5


def information(
    size: int, *, loaded: bool = False, c0: FloatArray | None = None, stretches: int = 6
) -> LogInformation:
    """A log that tells each coefficient alike and well, at `c0` the most likely ones."""
    S = np.tile(1e9 * np.eye(size), (stretches, 1, 1))
    return LogInformation(
        loaded, np.zeros(size) if c0 is None else c0, S, np.zeros((stretches, size))
    )


def fit_of(
    *,
    terms: tuple[str, ...] = (),
    lengths: dict[str, float] | None = None,
    payload: bool = True,
    gravity: float = 9.81,
    **changes: Any,
) -> Fit:
    """The first case's arm with its payload, each standard deviation a hundredth of its value."""
    shared = Shared(Model(terms, gravity), payload=payload, lengths=lengths or {})
    known = dict(zip((f"k{n}" for n in range(1, 8)), K.tolist(), strict=True))
    known |= {"m_p": CASE.payload, "l1": CASE.arm.l1, "l2": CASE.arm.l2}
    values = np.array([known.get(name, 0.1) for name in shared.names])
    size = len(shared.log_names)
    logs = [information(size, c0=values[:size])]
    if payload:
        logs.append(information(size, loaded=True, c0=shared.coefficients(values, True)))
    made = Fit(
        estimator="refined",
        shared=shared,
        values=values,
        covariance=np.diag((1e-2 * values) ** 2),
        intervals="likelihood",
        quantile=QUANTILE,
        status=tuple("OK" for _ in values),
        unidentifiable=(),
        logs=tuple(logs),
    )
    return replace(made, **changes)


def in_blocks(log: Log, cuts: Iterable[int]) -> Recording:
    """The log as a recording whose blocks begin at these samples."""
    blocks = [log.part(first, last) for first, last in pairwise([0, *cuts, len(log)])]
    return replace(open_source(log, "unloaded"), blocks=lambda: iter(blocks), promised=0)


def with_values(fit: Fit, **values: float) -> Fit:
    """The fit with other values of some parameters."""
    changed = fit.values.copy()
    for name, value in values.items():
        changed[fit.names.index(name)] = value
    return replace(fit, values=changed)


def with_stds(fit: Fit, **stds: float) -> Fit:
    """The fit with other standard deviations of some parameters.

    An infinite one is not identifiable.
    """
    variance, status = np.diag(fit.covariance).copy(), list(fit.status)
    for name, std in stds.items():
        place = fit.names.index(name)
        variance[place] = min(std, 1e3) ** 2
        if np.isinf(std):
            status[place] = "NOT_IDENTIFIABLE"
    return replace(fit, covariance=np.diag(variance), status=tuple(status))
