"""LAPACK's banded routines and four distributions, from SciPy's compiled modules alone.

Importing `scipy.linalg` and `scipy.special` takes 0.2 s, a third of what a short log takes as a
whole, nearly all of it for a layer over other array libraries. Both packages are thin here: what
is wanted are routines of one extension module each. They are loaded by themselves, under their own
names, so that a later import of the package finds them. Where that fails, the packages are
imported.
"""

from __future__ import annotations

import math
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from statistics import NormalDist
from sys import modules
from typing import Any

import numpy as np


def _alone(package: str, *names: str) -> Any:
    """The last of some compiled modules of SciPy; None where it cannot be had by itself.

    Those before it are what it imports: once they are known, it asks for no package.
    """
    home = find_spec("scipy")
    places = [f"{one}/{package}" for one in (home and home.submodule_search_locations) or ()]
    for name in names:
        full = f"scipy.{package}.{name}"
        if full in modules:
            continue
        spec = PathFinder.find_spec(full, places)
        if spec is None or spec.loader is None:
            continue
        try:
            module = module_from_spec(spec)  # it is loaded here
            spec.loader.exec_module(module)
        except ImportError:
            return None
        modules[full] = module
    return modules.get(f"scipy.{package}.{names[-1]}")


def _lapack() -> Any:
    module = _alone("linalg", "_flapack")
    if module is not None:
        return module
    from scipy.linalg import lapack as packaged

    return packaged


lapack = _lapack()
"""LAPACK's routines by name, as `scipy.linalg.lapack` has them."""


@cache
def _special() -> Any:
    """The functions of `scipy.special` that are compiled."""
    before = ("_special_ufuncs", "_ufuncs_cxx", "_ellip_harm_2", "_gufuncs")
    module = _alone("special", *before, "_ufuncs")
    if module is not None:
        return module
    from scipy import special as packaged

    return packaged


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
