"""What is loaded past SciPy's packages is SciPy's, and the quantiles are those of
`scipy.special`.
"""

import json
import subprocess
import sys

import numpy as np
import pytest
from scipy import special
from scipy.linalg import lapack as theirs

from algid.base.compiled import (
    chi2_exceeded,
    chi2_tail,
    lapack,
    normal_exceeded,
    student_quantile,
)

FREEDOM = np.array([1.0, 2.0, 2.5, 7.0, 30.3, 400.0, 1e5])


def test_the_routines_solve_as_scipys_do() -> None:
    rng = np.random.default_rng(0)
    band = np.concatenate([5 + rng.random((1, 40)), rng.random((2, 40))])
    ours, info = lapack.dpbtrf(band, lower=1)
    expected, _ = theirs.dpbtrf(band, lower=1)
    assert info == 0
    np.testing.assert_array_equal(ours, expected)
    rhs = rng.random((40, 3))
    for own, other in zip(
        lapack.dtbtrs(ours, rhs, uplo="L"), theirs.dtbtrs(ours, rhs, uplo="L"), strict=True
    ):
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("tail", [0.975, 0.5, 0.025, 1e-6])
def test_chi_squared_is_scipys(tail: float) -> None:
    expected = special.chdtri(FREEDOM, tail)
    np.testing.assert_allclose(chi2_exceeded(FREEDOM, tail), expected, rtol=1e-9)
    np.testing.assert_allclose(chi2_tail(FREEDOM, expected), tail, rtol=1e-8)
    assert float(chi2_tail(3, 0.0)) == 1.0


@pytest.mark.parametrize("tail", [1e-300, 1e-12, 0.025, 0.5, 0.9, 1.0 - 1e-9])
def test_normal_is_scipys(tail: float) -> None:
    assert normal_exceeded(tail) == pytest.approx(-special.ndtri(tail), rel=1e-9, abs=1e-12)


def test_what_is_beyond_every_tail_is_infinite() -> None:
    assert normal_exceeded(0.0) == np.inf


@pytest.mark.parametrize("freedom", [1.0, 2.0, 2.3, 5.0, 17.5, 300.0, 999.0, 1001.0, 1e4, 1e7])
@pytest.mark.parametrize("probability", [0.5, 0.75, 0.975, 0.9995])
def test_student_is_scipys(freedom: float, probability: float) -> None:
    expected = float(special.stdtrit(freedom, probability))
    # what rounding of the probability leaves of a quantile in the tail
    assert student_quantile(freedom, probability) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_student_of_infinite_freedom_is_normal() -> None:
    assert student_quantile(np.inf) == pytest.approx(1.959963984540054, rel=1e-12)


ALONE = """
import json, sys
if {broken}:
    import importlib.machinery
    importlib.machinery.PathFinder.find_spec = staticmethod(
        lambda name, path=None, target=None, real=importlib.machinery.PathFinder.find_spec:
        None if "._flapack" in name and "scipy.linalg" not in sys.modules else real(name, path)
    )
from algid.base import compiled
packages = [name for name in ("scipy.linalg", "scipy.special") if name in sys.modules]
found = [float(compiled.chi2_tail(4, 3.0)), compiled.student_quantile(5.0)]
if not {broken}:
    assert "scipy.special" not in sys.modules
import scipy.linalg, scipy.special, scipy.stats, scipy.optimize, scipy.signal
theirs = [float(scipy.special.chdtrc(4, 3.0)), float(scipy.special.stdtrit(5.0, 0.975))]
solved = scipy.linalg.cholesky_banded([[4.0, 4.0]], lower=True).tolist()
print(json.dumps([packages, found == theirs, compiled.lapack is not None, solved]))
"""


@pytest.mark.parametrize("broken", [False, True])
def test_packages_are_imported_where_modules_do_not_load_alone(broken: bool) -> None:
    script = ALONE.format(broken=broken)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    packages, same, loaded, solved = json.loads(done.stdout)
    assert ("scipy.linalg" in packages) is broken
    assert (same, loaded, solved) == (True, True, [[2.0, 2.0]])
