"""Priors of cases and of results made up for it: what is believed, how wrong, and what
is refused.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.arm import Arm
from algid.base.errors import AlgidError
from algid.base.significance import SURE
from algid.designs.belief import objective_of
from algid.designs.prior import PriorArm, PriorKnowledge, of_case, prior_of
from algid.model import Model
from algid.results import Result, result_json
from algid.synth.cases import Case
from tests.exports.arms import ODD, result_of, values_of

ARM = Arm(2.0, 1.0, 0.2, 0.15, 0.4, 0.3, 0.03, 0.01, 0.5, 0.25)
CASE = Case("mine", ARM, 0.5, None, {})
PAYLOAD = {"m_p": 0.5, "l1": 0.4, "l2": 0.3}


def believed(result: Result, folder: Path, loaded: bool | None = None, **knowns: Any) -> PriorArm:
    file = folder / "arm.json"
    file.write_text(result_json(result), encoding="utf-8")
    return prior_of(str(file), loaded, PriorKnowledge(**knowns))


def test_the_spread_of_a_case_is_what_each_mass_and_friction_moves() -> None:
    """By Table 1: each column is what the parameters change by if a mass, with its inertia, is 10
    % larger.
    """
    prior = of_case(CASE, "mine", None, PriorKnowledge(error=0.1))
    belief = prior.belief
    assert belief.shared.names == ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "m_p", "l1", "l2")
    g = 9.81
    link1 = [0, 0, 0, 2.0 * g * 0.2, 0.03 + 2.0 * 0.2**2, 0, 0, 0, 0, 0]
    link2 = [0.4 * 0.15, g * 0.15, 0.01 + 0.15**2, g * 0.4, 0.4**2, 0, 0, 0, 0, 0]
    friction1, friction2, payload = 0.5 * np.eye(10)[5], 0.25 * np.eye(10)[6], 0.5 * np.eye(10)[7]
    lengths = 0.4 * np.eye(10)[8] + 0.3 * np.eye(10)[9]
    np.testing.assert_allclose(
        belief.mean, np.sum([link1, link2, friction1, friction2, payload, lengths], axis=0)
    )
    expected = 0.1 * np.array([link1, link2, friction1, friction2, payload]).T
    np.testing.assert_allclose(belief.spread, expected, atol=1e-14)
    assert belief.box
    np.testing.assert_array_equal(prior.lengths, [0.4, 0.3])
    assert (prior.noise, prior.doubts, prior.source) == (None, (), "mine")
    usual = of_case(CASE, "mine", None, PriorKnowledge()).belief.spread
    # a fifth where nothing is told
    np.testing.assert_allclose(usual, 2 * belief.spread, atol=1e-14)


def test_what_the_user_knows_beats_the_case() -> None:
    prior = of_case(CASE, "mine", None, PriorKnowledge(l1=0.5, l2=0.35, payload=0.2))
    names = prior.belief.shared.names
    assert names[-1] == "m_p"  # lengths that are known are not estimated
    value = dict(zip(names, prior.belief.mean, strict=True))
    assert value["m_p"] == 0.2
    assert value["k1"] == pytest.approx(1.0 * 0.5 * 0.15)
    np.testing.assert_array_equal(prior.lengths, [0.5, 0.35])
    assert prior.belief.shared.lengths == {"l1": 0.5, "l2": 0.35}


def test_a_results_covariance_is_believed_whole(tmp_path: Path) -> None:
    result = result_of(values_of(ODD), payload=PAYLOAD, std=0.01)
    C = np.array(result.fit.covariance)
    C[0, 3] = C[3, 0] = 0.8 * np.sqrt(C[0, 0] * C[3, 3])
    result = result.model_copy(
        update={"fit": result.fit.model_copy(update={"covariance": C.tolist()})}
    )
    prior = believed(result, tmp_path)
    np.testing.assert_allclose(
        prior.belief.spread @ prior.belief.spread.T, C, rtol=1e-9, atol=1e-12 * C.max()
    )
    assert not prior.belief.box
    np.testing.assert_allclose(prior.lengths, [0.4, 0.3])
    assert prior.noise is None  # the made-up result tells none


def test_a_payload_that_is_given_is_as_wrong_as_told(tmp_path: Path) -> None:
    prior = believed(result_of(values_of(ODD), payload=PAYLOAD), tmp_path, payload=0.8, error=0.1)
    place = prior.belief.shared.names.index("m_p")
    assert prior.belief.mean[place] == 0.8
    assert prior.belief.std[place] == pytest.approx(0.1 * 0.8 / SURE)
    body = result_of(values_of(ODD), payload=PAYLOAD | {"J_p": 0.002})
    usual = believed(body, tmp_path, payload=0.8)
    assert usual.belief.std[place] == pytest.approx(0.2 * 0.8 / SURE)
    assert usual.belief.mean[-1] == pytest.approx(0.002 * 0.8 / 0.5)


def test_terms_that_no_plan_holds_are_left_out_and_said(tmp_path: Path) -> None:
    value = values_of(ODD, f1=0.4, f2=0.3, gain2=0.05, e1=0.01, e2=0.02)
    prior = believed(result_of(value, Model(("coulomb", "gain", "load"))), tmp_path)
    assert prior.belief.shared.model.terms == ("coulomb",)
    (doubt,) = prior.doubts
    assert doubt.text == (
        "the plan leaves out friction in proportion to the joint's load and torque gain of joint "
        "2 over that of joint 1"
        ", less 1: where they are estimated too, error bars are somewhat larger than predicted"
    )


BARE = result_of(values_of(ODD))
WEAK = BARE.model_copy(update={"fit": None, "estimator": "weak"})
NO_PAYLOAD = "it knows no payload for the loaded runs; give --payload KG, or --runs 1,0"
NO_BARS = (
    "the result of --estimator weak has no error bars; identify from logs that determine them, "
    "or say how wrong it may be: --set prior_error"
)
IMPOSSIBLE = (
    "its inertia matrix is not positive definite (k1 0.5, k3 0.0145, k5 0.196 kg m²); no arm is "
    "like that: identify it anew, or describe the arm in a TOML file"
)


@pytest.mark.parametrize(
    ("result", "loaded", "knowns", "message"),
    [
        (BARE, None, {"payload": 0.5}, "the result has no l1; give --l1"),
        (BARE, None, {"payload": 0.5, "l1": 0.4}, "the result has no l2; give --l2"),
        (BARE, True, {}, NO_PAYLOAD),
        (
            BARE.model_copy(update={"parameters": {}}),
            None,
            {},
            "the result has no k1; identify it from logs that determine it",
        ),
        (WEAK, None, {}, NO_BARS),
        (result_of(values_of(ODD) | {"k1": 0.5}), None, {}, IMPOSSIBLE),
    ],
)
def test_what_a_result_cannot_tell_is_refused(
    result: Result, loaded: bool | None, knowns: dict[str, float], message: str, tmp_path: Path
) -> None:
    with pytest.raises(AlgidError) as refused:
        believed(result, tmp_path, loaded, **knowns)
    assert str(refused.value) == f"{tmp_path / 'arm.json'}: {message}"


BENT = Case(
    "bent", replace(ARM, delta1=0.2, delta2=-0.3), 0.5, None, {}, place=(0.28, 0.04), inertia=0.002
)


def test_a_bent_arm_and_a_body_are_believed_with_their_sine_parts() -> None:
    """Its logs' coefficients are those of the simulator's arm, with the payload and without."""
    belief = of_case(BENT, "bent", None, PriorKnowledge(error=0.1)).belief
    names = belief.shared.names
    assert names[-5:] == ("m_p", "l1", "l2", "y_p", "J_p")
    model = belief.shared.model
    for loaded, mass in ((False, 0.0), (True, 0.5)):
        c = dict(zip(model.names, belief.load(loaded).c.tolist(), strict=True))
        every = [f"k{n}" for n in range(1, 8)] + ["k1s", "k2s", "k4s"]
        np.testing.assert_allclose([c[name] for name in every], BENT.constants(mass), atol=1e-12)
    heavier = dict(zip(names, belief.spread[:, 4].tolist(), strict=True))
    assert (heavier["m_p"], heavier["J_p"]) == pytest.approx((0.05, 0.0002))
    assert heavier["y_p"] == heavier["k1s"] == 0.0
    asked = objective_of(belief, ["y_p", "J_p"], "bent")
    assert [name for name, yes in zip(names, asked.wanted, strict=True) if yes] == ["y_p", "J_p"]
