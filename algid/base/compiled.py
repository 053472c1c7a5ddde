"""LAPACK's banded routines and four distributions, from SciPy's compiled modules alone.

Importing `scipy.linalg` and `scipy.special` takes 0.2 s, a third of what a short log takes as a
whole, nearly all of it for a layer over other array libraries. Both packages are thin here: what
is wanted are routines of one extension module each. They are loaded by themselves, under their own
names, so that a later import of the package finds them. Where that fails, the packages are
imported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from statistics import NormalDist
from sys import modules
from types import ModuleType
from typing import Any

import numpy as np
import scipy


@contextmanager
def _alone(package: str) -> Iterator[None]:
    """Let modules of a package be imported within the block without the package itself."""
    if package in modules:
        yield
        return
    bare = modules[package] = ModuleType(package)
    bare.__path__ = [f"{scipy.__path__[0]}/{package.partition('.')[2]}"]
    try:
        yield
    finally:
        del modules[package]


try:
    with _alone("scipy.linalg"):
        from scipy.linalg import _flapack as routines
except ImportError:
    from scipy.linalg import lapack as routines
lapack: Any = routines
"""LAPACK's routines by name, as `scipy.linalg.lapack` has them."""


@cache
def _special() -> Any:
    """The functions of `scipy.special` that are compiled."""
    try:
        with _alone("scipy.special"):
            from scipy.special import _ufuncs

        return _ufuncs
    except ImportError:
        from scipy import special

        return special


def chi2_tail(freedom: Any, x: Any) -> Any:
    """Probability that χ² of `freedom` degrees exceeds x; any shapes that broadcast."""
    return _special().gammaincc(np.multiply(0.5, freedom), np.multiply(0.5, x))


def chi2_exceeded(freedom: Any, tail: Any) -> Any:
    """What χ² of `freedom` degrees exceeds with the probability `tail`.

    Any shapes that broadcast.
    """
    return 2 * _special().gammainccinv(np.multiply(0.5, freedom), tail)


def normal_exceeded(tail: float) -> float:
    """What a standard normal variable exceeds with the probability `tail`; ∞ for 0."""
    if tail >= 1:
        return -math.inf
    return math.inf if tail <= 0 else -NormalDist().inv_cdf(tail)


def student_quantile(freedom: float, probability: float = 0.975) -> float:
    """Quantile of Student's t for `freedom` of 1 or more, or of the normal for infinite freedom."""
    return float(_special().stdtrit(freedom, probability))
