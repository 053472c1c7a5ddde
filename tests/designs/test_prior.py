"""Priors out of results: error bars, what is missing, and what contradicts itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import algid
from algid.base.errors import ResultError, SettingError
from algid.base.significance import SURE
from algid.designs.belief import Belief, objective_of
from algid.designs.prior import PriorKnowledge, prior_of
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


def test_a_result_is_believed_as_far_as_its_error_bars_go(result: Result, tmp_path: Path) -> None:
    prior = prior_of(saved(result, tmp_path), None, PriorKnowledge())
    assert prior.belief.shared.payload
    assert prior.noise is not None
    assert result.fit is not None
    for name, std in zip(prior.belief.shared.names, prior.belief.std, strict=True):
        assert std == pytest.approx(result.estimates[name].std, rel=1e-6)
    # the largest torque told is that of arms SURE standard deviations away, in the direction that
    # matters
    load = prior.belief.load(False)
    Y = np.zeros((2, load.c.size, 1))
    Y[0, prior.belief.shared.names.index("k4")] = 1.0
    _, more, _ = load.largest(Y)
    assert more[0, 0] == pytest.approx(
        SURE * prior.belief.std[prior.belief.shared.names.index("k4")], rel=1e-4
    )


def test_a_result_without_error_bars_needs_to_be_told_how_wrong_it_is(
    result: Result, tmp_path: Path
) -> None:
    file = saved(result, tmp_path, fit=None)
    with pytest.raises(ResultError, match=r"no error bars; .*--set prior_error"):
        prior_of(file, None, PriorKnowledge())
    belief = prior_of(file, None, PriorKnowledge(error=0.2)).belief
    np.testing.assert_allclose(SURE * belief.std, 0.2 * np.abs(belief.mean), rtol=1e-6)


def test_a_length_far_from_the_results_is_a_warning(result: Result, tmp_path: Path) -> None:
    file = saved(result, tmp_path)
    (doubt,) = prior_of(file, None, PriorKnowledge(l2=0.2)).doubts
    assert doubt.code == "LENGTH_CONTRADICTED"
    assert (doubt.numbers["name"], doubt.numbers["given"]) == ("l2", 0.2)
    assert prior_of(file, None, PriorKnowledge(l2=result.payload["l2"].estimate)).doubts == ()


def test_an_impossible_arm_is_refused(result: Result, tmp_path: Path) -> None:
    k1 = result.parameters["k1"].model_copy(update={"estimate": 0.1})
    with pytest.raises(SettingError, match="not positive definite"):
        prior_of(
            saved(result, tmp_path, parameters={**result.parameters, "k1": k1}),
            None,
            PriorKnowledge(),
        )


def test_friction_of_a_real_arm_is_planned_for_and_what_cannot_be_is_said(tmp_path: Path) -> None:
    logs = algid.synthesise(
        "case1", duration=2.0, rate=500.0, torque="wide", sensors=Sensors(1e-3, 1e-2)
    )
    settings = Settings(model="coulomb,offset")
    belief = prior_of(
        saved(algid.identify(*logs, settings), tmp_path), None, PriorKnowledge()
    ).belief
    assert {"f1", "f2", "o1", "o2"} <= set(belief.shared.names)
    asked = objective_of(belief, None, "it")
    places = [belief.shared.names.index(name) for name in ("o1", "o2")]
    assert not asked.wanted[
        places
    ].all()  # the arm has no offsets: no error is large or small beside them


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
