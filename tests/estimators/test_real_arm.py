"""A real double pendulum predicts its own runs, each left out in turn."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import CubicSpline

from algid.estimators import refined, weak
from algid.estimators.excitation import contradicted
from algid.estimators.prediction import cross_validate
from algid.estimators.problem import Problem, Source, WeakSettings
from algid.model import Model
from algid.signals.segments import Segment
from tests.estimators.conftest import problem_of

RUNS = Path(__file__).parents[3] / "shared" / "data" / "dfki" / "C1_sysid"
PUBLISHED = (0.159, 0.114)  # N m, of the parameters published with the data

pytestmark = pytest.mark.skipif(
    not RUNS.is_dir(), reason="the recorded runs are not beside this repository"
)


@pytest.fixture(scope="module")
def sources() -> Sequence[Source]:
    return problem_of(*map(_run, sorted(RUNS.glob("*.csv")))).unloaded


def _run(path: Path) -> Segment:
    table = pl.read_csv(path)
    t = table["time"].to_numpy()
    keep = np.append(True, np.diff(t) > 0)
    signals = np.stack(
        [table[name].to_numpy() for name in ("pos_meas1", "pos_meas2", "tau_meas1", "tau_meas2")]
    )
    signals[0] -= np.pi / 2
    dt = float(np.median(np.diff(t[keep])))
    even = CubicSpline(t[keep], signals[:, keep], axis=1)(np.arange(t[0], t[-1], dt))
    return Segment(0.0, dt, even[:2], even[2:])


def test_prediction_beats_the_published_parameters(sources: Sequence[Source]) -> None:
    fit = refined.fit(Problem(sources, settings=WeakSettings(Model(("coulomb", "rotor")))))
    assert fit.refuted  # an arm's torque error is no white noise
    assert fit.unidentifiable == ()
    found = cross_validate(fit, sources)
    assert np.all(found.rmse < PUBLISHED)


def test_runs_in_which_a_joint_is_hardly_driven_are_not_ok_alone() -> None:
    """Joint 1 of the first coasts (0.02 N m), joint 2 of the others (0.01 N m, and 2 mrad of
    travel in the second).
    """
    settings = WeakSettings(Model(("coulomb",), coulomb_speed=0.05), bandwidth=60.0)
    in_doubt = {}
    for name in ("143747", "143906", "144115", "143524", "154220"):
        log = _run(RUNS / f"20230629-{name}.csv")
        problem = problem_of(log, settings=settings)
        in_doubt[name] = contradicted(weak.fit(problem), problem) is not None
    assert in_doubt == {
        "143747": True,
        "143906": True,
        "144115": True,
        "143524": False,
        "154220": False,
    }
