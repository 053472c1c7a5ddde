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
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from statistics import NormalDist
from sys import modules
from typing import Any

import numpy as np

from algid.arm import FloatArray


def _extension(package: str, name: str) -> Any:
    """The compiled module `name` of SciPy's `package`; None where it cannot be had by itself."""
    full = f"scipy.{package}.{name}"
    if full in modules:
        return modules[full]
    scipy = find_spec("scipy")
    for folder in (scipy.submodule_search_locations or []) if scipy else []:
        for suffix in EXTENSION_SUFFIXES:
            path = Path(folder) / package / f"{name}{suffix}"
            spec = spec_from_file_location(full, path, loader=ExtensionFileLoader(full, str(path)))
            if spec is None or spec.loader is None or not path.is_file():
                continue
            try:
                module = module_from_spec(spec)
                spec.loader.exec_module(module)
            except ImportError:
                return None
            modules[full] = module
            return module
    return None


def _lapack() -> Any:
    module = _extension("linalg", "_flapack")
    if all(hasattr(module, name) for name in ("dpbtrf", "dtbtrs")):
        return module
    from scipy.linalg import lapack as packaged

    return packaged


lapack = _lapack()
"""LAPACK's routines by name, as `scipy.linalg.lapack` has them."""


@cache
def _gamma() -> tuple[Any, Any]:
    """The regularised upper incomplete gamma function Q(a, x), and its inverse in x."""
    module = _extension("special", "_special_ufuncs")
    if all(hasattr(module, name) for name in ("gammaincc", "gammainccinv")):
        return module.gammaincc, module.gammainccinv
    from scipy.special import gammaincc, gammainccinv

    return gammaincc, gammainccinv


def chi2_tail(freedom: Any, x: Any) -> Any:
    """Probability that χ² of `freedom` degrees exceeds x; any shapes that broadcast."""
    return _gamma()[0](np.multiply(0.5, freedom), np.multiply(0.5, x))


def chi2_exceeded(freedom: Any, tail: Any) -> Any:
    """What χ² of `freedom` degrees exceeds with the probability `tail`.

    Any shapes that broadcast.
    """
    return 2 * _gamma()[1](np.multiply(0.5, freedom), tail)


def normal_exceeded(tail: float) -> float:
    """What a standard normal variable exceeds with the probability `tail`; ∞ for 0."""
    if tail >= 1:
        return -math.inf
    return math.inf if tail <= 0 else -NormalDist().inv_cdf(tail)


def _gamma_ratio(freedom: float) -> float:
    """Γ((ν + 1) / 2) / Γ(ν / 2); by its series for large ν, where logarithms would cancel."""
    if freedom < 1000.0:
        return math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2))
    small = 1 / freedom
    return math.sqrt(freedom / 2) * (1 - small / 4 + small**2 / 32 + 5 * small**3 / 128)


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_STEPS = 60


@cache
def student_quantile(freedom: float, probability: float = 0.975) -> float:
    """Quantile of Student's t for `freedom` of 2 or more and `probability` from 0.5 to 0.9999.

    Newton's method on P = 1/2 + ∫ density, from the normal quantile. With t = √ν tan φ the
    integrand is cos^(ν−1) φ, which Gauss and Legendre's rule integrates to rounding; P is concave,
    so that the steps ascend. A power of the rounded cosine would be wrong by ν roundings.
    """
    if math.isinf(freedom):
        return NormalDist().inv_cdf(probability)
    size = _gamma_ratio(freedom) / math.sqrt(math.pi)
    root, t = math.sqrt(freedom), NormalDist().inv_cdf(probability)
    for _ in range(_STEPS):
        angle = math.atan(t / root)
        nodes: FloatArray = 0.5 * angle * (_NODES + 1)
        powers = np.exp(0.5 * (freedom - 1) * np.log1p(-(np.sin(nodes) ** 2)))
        area = 0.5 * angle * float(_WEIGHTS @ powers) * size
        density = size / root * math.exp(-(freedom + 1) / 2 * math.log1p(t * t / freedom))
        step = (probability - 0.5 - area) / density
        t += step
        if abs(step) < 1e-14 * max(1.0, abs(t)):
            break
    return t
