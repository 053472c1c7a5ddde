"""Priors out of results: error bars, what is missing, and what contradicts itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import algid
from algid.designs.belief import Belief, objective_of
from algid.designs.prior import PriorKnowledge, noise_for, prior_of
from algid.results import Result, write_result
from algid.settings import Settings
from algid.synth.sensors import Sensors


@pytest.fixture(scope="module")
def result() -> Result:
    logs = algid.synthesise(
        "case1", duration=2.0, rate=500.0, torque="wide", sensors=Sensors(1e-3, 1e-2)
    )
    return algid.identify(*logs)


def saved(result: Result, folder: Path, **changes: object) -> str:
    path = folder / "result.json"
    write_result(result.model_copy(update=changes), path)
    return str(path)


def test_a_length_far_from_the_results_is_a_warning(result: Result, tmp_path: Path) -> None:
    file = saved(result, tmp_path)
    (doubt,) = prior_of(file, None, PriorKnowledge(l2=0.2)).doubts
    assert doubt.code == "LENGTH_CONTRADICTED"
    assert (doubt.numbers["name"], doubt.numbers["given"]) == ("l2", 0.2)
    assert prior_of(file, None, PriorKnowledge(l2=result.payload["l2"].estimate)).doubts == ()


def test_a_delay_that_was_estimated_is_planned_for_and_no_aim(tmp_path: Path) -> None:
    """It takes of the others' precision; nobody moves an arm to learn it unless it is asked for."""
    logs = algid.synthesise(
        "case1", duration=2.0, rate=500.0, torque="wide", sensors=Sensors(1e-3, 1e-2)
    )
    found = algid.identify(*logs, Settings(model="delay"))
    belief = prior_of(saved(found, tmp_path), None, PriorKnowledge()).belief
    assert belief.shared.delay
    place = belief.shared.names.index("delay")
    sure = Belief(
        belief.shared, belief.mean + 1e-3 * np.eye(belief.mean.size)[place], belief.spread, False
    )
    assert not objective_of(sure, None, "it").wanted[place]
    assert objective_of(sure, ["delay"], "it").wanted[place]
    assert belief.load(False).c.size == len(belief.shared.model.names)


def test_noise_is_what_is_given_else_of_a_log_else_of_the_results_logs(
    result: Result, tmp_path: Path
) -> None:
    prior = prior_of(saved(result, tmp_path), None, PriorKnowledge())
    log, _ = algid.synthesise(
        "case1", duration=2.0, rate=500.0, torque="wide", sensors=Sensors(3e-3, 3e-2)
    )
    for one, theta, tau in ((None, 1e-3, 1e-2), (log, 3e-3, 3e-2)):
        found = noise_for(prior, None, None, one)
        np.testing.assert_allclose(found.theta, theta, rtol=0.2)
        np.testing.assert_allclose(found.tau, tau, rtol=0.2)
        assert noise_for(prior, 7.0, None, one).theta.tolist() == [7.0, 7.0]
