"""What each contender reproduces before it takes part: an example of its own kind whose answer is
known.

Regressions, output error and algid recover the constants of the paper's first case from a log
without noise; PySINDy's weak form finds Lorenz' equations, as in its own examples; MuJoCo's sysid
finds an arm that MuJoCo has simulated; pinocchio's regressor times an arm's parameters is
pinocchio's own inverse dynamics; the paper's method gives the paper's Table 4. `tests/test_race.py`
runs them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from algid.arm import FloatArray
from pipelines.race_peers import L1_OF_EXAMPLE, PEERS, as_log, mujoco_log


@dataclass(frozen=True)
class Example:
    """How far an answer may be off (a share), and how far it is."""

    limit: float
    run: Callable[[], float]


def _constants(peer: str) -> float:
    """The largest relative error of k1 … k7 of case 1 on a log without noise, at 500 Hz."""
    import algid
    from algid.synth.cases import load_case

    log, _ = algid.synthesise("case1", duration=10.0, rate=500.0, torque="wide")
    found = PEERS[peer][0]([log], L1_OF_EXAMPLE)
    return float(np.max(np.abs(found.values / load_case("case1").arm.constants() - 1)))


def _lorenz() -> float:
    """PySINDy's weak form on Lorenz' equations: the largest error of the seven coefficients over
    the largest.
    """
    from pysindy import STLSQ, SINDy, WeakPDELibrary
    from pysindy.feature_library import PolynomialLibrary
    from scipy.integrate import solve_ivp

    def rate(_t: float, x: FloatArray) -> list[float]:
        return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]

    t = np.linspace(0, 10, 2001)
    x = solve_ivp(rate, (0, 10), [-8.0, 8.0, 27.0], t_eval=t, rtol=1e-10, atol=1e-10).y.T
    np.random.seed(0)  # noqa: NPY002 (the library draws its windows from there)
    library = WeakPDELibrary(
        PolynomialLibrary(degree=2, include_bias=False), spatiotemporal_grid=t, K=500, H_xt=0.1
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of its own labels of axes
        model = SINDy(feature_library=library, optimizer=STLSQ(threshold=0.5))
        model.fit([x], t=t)
    found = np.asarray(model.coefficients())
    expected = np.zeros_like(found)
    expected[0, :2] = -10, 10
    expected[1, [0, 1, 5]] = 28, -1, -1
    expected[2, [2, 4]] = -8 / 3, 1
    return float(np.max(np.abs(found - expected)) / 28)


def _own_arm() -> float:
    """MuJoCo's sysid on an arm that MuJoCo simulates."""
    k, log, l1 = mujoco_log()
    found = PEERS["MuJoCo sysid"][0]([as_log(log)], l1)
    return float(np.max(np.abs(found.values / k - 1)))


def _inverse_dynamics() -> float:
    """Pinocchio's regressor times an arm's dynamic parameters, to its inverse dynamics."""
    import pinocchio as pin

    model = pin.buildSampleModelManipulator()
    data = model.createData()
    parameters = np.concatenate([body.toDynamicParameters() for body in model.inertias[1:]])
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(20):
        q = pin.randomConfiguration(model)
        v, a = rng.standard_normal((2, model.nv))
        torque = pin.rnea(model, data, q, v, a)
        product = pin.computeJointTorqueRegressor(model, data, q, v, a) @ parameters
        worst = max(worst, float(np.max(np.abs(product - torque)) / np.max(np.abs(torque))))
    return worst


def _table4() -> float:
    """The paper's method on case 1: the worst row's share of the paper's error, less one, where it
    is above.
    """
    import algid

    unloaded, loaded = algid.synthesise("case1", torque="case", duration=1.0)
    result = algid.identify(unloaded, loaded, estimator="paper", report=False)
    rows = [row for row in result.table4 if row.paper_error_percent]
    shares = [
        abs(row.error_percent or np.inf) / (row.paper_error_percent or np.nan) for row in rows
    ]
    return max(0.0, max(shares) - 1)


_REGRESSIONS = ("least squares", "least squares, every term", "IDIM-IV", "output error, every term")
"""Two take a minute each with, or without, every term, by the same code: their kin stand here."""

EXAMPLES = {
    "algid": Example(1e-5, lambda: _constants("algid")),
    "algid weak": Example(1e-3, lambda: _constants("algid weak")),
    **{peer: Example(0.02, partial(_constants, peer)) for peer in _REGRESSIONS},
    "pinocchio regressors": Example(1e-9, _inverse_dynamics),
    "PySINDy weak form": Example(0.01, _lorenz),
    "MuJoCo sysid": Example(0.02, _own_arm),
    "the paper's method": Example(0.0, _table4),
}
