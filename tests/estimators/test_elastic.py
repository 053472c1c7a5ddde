"""Elastic joints from log to export: chosen where they are, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators.elastic import flexed, turns
from algid.exports.formats import exported
from algid.identification.identify import identify
from algid.log import Log
from algid.model import RIGID, Model, Motion, link_motion, load, sensitivity, torque
from algid.results import Result
from algid.signals.segments import Segment
from pipelines import conventions
from pipelines.bench_logs import blocks
from tests.estimators.conftest import DT, Bench
from tests.estimators.test_terms import term_log, term_values
from tests.intervals import distances

ELASTIC = Model(("elastic",))


def identified(segment: Segment) -> Result:
    return identify(Log.from_arrays(segment.t, segment.theta, segment.tau), report=False)


def test_elastic_joints_are_chosen_and_their_stiffness_told(bench: Bench) -> None:
    values = term_values(bench, ELASTIC.terms)
    result = identified(term_log(bench, ELASTIC, values))
    assert "elastic" in result.fit.model.terms
    for name, compliance in (("k_e1", "h1"), ("k_e2", "h2")):
        low, high = result.fit.stiffness[name].ci95 or (None, None)
        assert low < 1 / values[compliance] < high
    assert np.abs(distances(result, [values[name] for name in RIGID], RIGID)).max() < 5
    for to in ("c", "python", "mjcf"):
        text, _ = exported(result, "arm.algid", to, {})
        assert "lacks elastic joints" in text
        assert "rad/(N m)" in text


@pytest.fixture
def swinging(bench: Bench) -> tuple[np.ndarray, Motion, np.ndarray]:
    """Coefficients, the motors' motion between its ends, and the torque."""
    values = term_values(bench, ELASTIC.terms)
    log = term_log(bench, ELASTIC, values, noise=0.0)
    c = np.array([values[name] for name in ELASTIC.names])
    theta = log.theta
    omega = np.gradient(theta, DT, axis=1)
    return c, Motion(theta, omega, np.gradient(omega, DT, axis=1)), log.tau


def test_the_load_is_what_moves_the_links_behind_their_springs(
    bench: Bench, swinging: tuple[np.ndarray, Motion, np.ndarray]
) -> None:
    c, motion, tau = swinging
    inner = slice(200, -200)
    by_torque = flexed(ELASTIC, c, motion, DT, tau)
    links = link_motion(ELASTIC, c, by_torque)
    assert np.abs(links.theta - bench.bare.theta)[:, inner].max() < 1e-4  # rad
    assert np.abs(by_torque.theta - links.theta)[:, inner].max() > 1e-3
    size = np.abs(tau).max(axis=1, keepdims=True)
    missed = torque(ELASTIC, c, by_torque) - tau
    assert np.abs(missed / size)[:, inner].max() < 0.01
    # without the torque, from the links' own motion
    by_motion = flexed(ELASTIC, c, motion, DT)
    through = load(ELASTIC, c, link_motion(ELASTIC, c, by_motion))
    assert np.abs((by_motion.load[0] - through) / size)[:, inner].max() < 0.05


def test_what_a_coefficient_turns_the_links_by_is_a_difference(
    swinging: tuple[np.ndarray, Motion, np.ndarray],
) -> None:
    c, motion, tau = swinging
    bent = flexed(ELASTIC, c, motion, DT, tau)
    J = sensitivity(ELASTIC, c, bent)
    for place, turn in turns(ELASTIC, c, bent, J, DT):
        step = 1e-3 * abs(c[place])
        further = c.copy()
        further[place] += step
        moved = link_motion(ELASTIC, further, flexed(ELASTIC, further, motion, DT, tau))
        found = (moved.theta - link_motion(ELASTIC, c, bent).theta) / step
        np.testing.assert_allclose(found, turn[0], atol=0.01 * np.abs(turn[0]).max())


def test_a_lag_that_the_last_round_would_find_leaves_the_choice_whole() -> None:
    _, motion = conventions.motion_of("arm22")
    swapped = conventions.log_of(motion, "joints swapped", friction=1)
    result = identify(swapped, report=False)
    assert result.verdict.failed
    assert "WRONG_CONVENTION" in {one.code for one in result.notices}


def test_precise_angles_make_no_joint_elastic() -> None:
    """A load that is read from the torque carries the torque's noise into its column."""
    result = identify(next(iter(blocks(10_000))), report=False)
    assert result.fit.intervals == "likelihood"
    assert not result.fit.stiffness
    assert result.verdict.grade == "good"
