"""What an earlier result knows of its arm, against the first case's own numbers and numerical
propagation.
"""

from __future__ import annotations

import pytest

import algid
from algid.base.errors import ResultError
from algid.identification.identify import identify
from algid.identification.known import (
    contradictions,
    model_of,
    prior_of,
    shift_of,
)
from algid.model import Model
from algid.results import Estimate, Result, Status
from algid.settings import Settings
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors


@pytest.fixture(scope="module")
def weighed() -> Result:
    logs = algid.synthesise(
        "case1", duration=2.0, torque="wide", sensors=Sensors(1e-3, 1e-2, seed=1)
    )
    return identify(*logs, Settings(model="coulomb"), report=False)


@pytest.mark.parametrize(("hold", "share"), [("foh", 0.0), ("zoh", 0.5)])
def test_a_torque_acts_after_half_its_hold_and_the_delay_found_or_else_set(
    weighed: Result, hold: str, share: float
) -> None:
    settings = {"torque_hold": hold, "delay": 0.004}
    result = weighed.model_copy(update={"settings": weighed.settings | settings})
    assert shift_of(result).at(2e-3) == pytest.approx(0.004 + share * 2e-3, abs=1e-15)
    found = Estimate(estimate=0.0061, unit="s")
    parameters = {**result.parameters, "delay": found}
    assert shift_of(result.model_copy(update={"parameters": parameters})).at(0.01) == pytest.approx(
        0.0061 + share * 0.01
    )
    lost = {
        **result.parameters,
        "delay": Estimate(estimate=None, unit="s", status=Status.NOT_IDENTIFIABLE),
    }
    assert shift_of(result.model_copy(update={"parameters": lost})).at(0.01) == pytest.approx(
        0.004 + share * 0.01
    )


def test_a_length_that_an_arm_contradicts_is_told_with_what_it_has(weighed: Result) -> None:
    l1 = load_case("case1").arm.l1
    unloaded = weighed.model_copy(update={"payload": {}})
    stated = unloaded.model_copy(update={"settings": weighed.settings | {"l1": l1}})
    for arm, has in ((unloaded, "identified as 0.16"), (stated, "the arm's result was made with")):
        assert contradictions(arm, {"l1": l1}) == ()
        (told,) = contradictions(arm, {"l1": 2 * l1})
        assert told.text.startswith(f"l1 is given as {2 * l1:g} m, but {has}")


def test_a_prior_that_a_result_cannot_give_is_refused_with_what_to_do(weighed: Result) -> None:
    where = weighed.log.path
    with pytest.raises(
        ResultError,
        match=rf"^{where}: the result of --estimator refined has no error bars; identify with",
    ):
        prior_of(weighed.model_copy(update={"fit": None}), Model())
    with pytest.raises(
        ResultError,
        match=r"^arm\.json: the result has no j2, s1, s2; use the flags it was made with$",
    ):
        prior_of(weighed, Model(("coulomb", "rotor", "stribeck")), "arm.json")
    open_one = [
        [None] * len(row) if place == 2 else row for place, row in enumerate(weighed.fit.covariance)
    ]
    lost = weighed.model_copy(
        update={"fit": weighed.fit.model_copy(update={"covariance": open_one})}
    )
    with pytest.raises(
        ResultError, match="leaves constants undetermined; identify from more logs first"
    ):
        prior_of(lost, model_of(weighed))
    k4 = {"k4": Estimate(estimate=None, unit="N m")}
    lost = weighed.model_copy(update={"parameters": weighed.parameters | k4})
    with pytest.raises(ResultError, match="leaves constants undetermined"):
        prior_of(lost, model_of(weighed))
