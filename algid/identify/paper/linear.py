"""Many small linear systems at once, scaled, each with its condition number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray

# A relative change of 1e-12, the rounding of nested sums, then moves the estimate by less than one percent.
LARGEST_CONDITION = 1e10


@dataclass(frozen=True, eq=False)
class Solutions:
    """Solutions (u, ...) of systems of u unknowns, NaN where singular, and their condition numbers (...)."""

    x: FloatArray
    condition: FloatArray


def solve_scaled(matrix: FloatArray, rhs: FloatArray) -> Solutions:
    """Solve P x = q at every sample.

    Parameters
    ----------
    matrix : (u, u, ...) float64
        P, rows first. The rows and then the columns are scaled to a largest entry of one.
    rhs : (u, ...) float64
        q.

    Returns
    -------
    Solutions
        The condition number is that of the scaled matrix in the 1-norm; past `LARGEST_CONDITION` the system
        counts as singular and its solution is NaN.
    """
    p = np.moveaxis(matrix, (0, 1), (-2, -1))
    q = np.moveaxis(rhs, 0, -1)[..., None]
    row = _scale(np.abs(p).max(axis=-1, keepdims=True))
    p = p * row
    column = _scale(np.abs(p).max(axis=-2, keepdims=True))
    p = p * column
    inverse, regular = _inverse(p)
    with np.errstate(over="ignore", invalid="ignore"):  # next to singular: caught by the condition number
        scaled = inverse @ (q * row)
        scaled += inverse @ (q * row - p @ scaled)
        condition = np.where(regular, _norm1(p) * _norm1(inverse), np.inf)
    x = np.where((condition <= LARGEST_CONDITION)[..., None, None], scaled * column.mT, np.nan)
    return Solutions(x=np.moveaxis(x[..., 0], -1, 0), condition=condition)


def _scale(largest: FloatArray) -> FloatArray:
    return 1 / np.where(largest > 0, largest, 1.0)


def _norm1(matrix: FloatArray) -> FloatArray:
    norms: FloatArray = np.abs(matrix).sum(axis=-2).max(axis=-1)
    return norms


def _inverse(p: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Inverses (..., u, u) and where they exist; LAPACK refuses a whole batch for one singular matrix."""
    regular = np.asarray((p != 0).any(axis=-1).all(axis=-1))  # windows start with rows of zeros
    try:
        return _inverse_where(p, regular), regular
    except np.linalg.LinAlgError:
        regular = np.asarray(np.linalg.slogdet(p).sign != 0)  # the same factors, the same zero pivots
        return _inverse_where(p, regular), regular


def _inverse_where(p: FloatArray, regular: NDArray[np.bool_]) -> FloatArray:
    return np.linalg.inv(p if regular.all() else np.where(regular[..., None, None], p, np.eye(p.shape[-1])))
