"""The arm that a track weighs with: what it takes from a result, from the call, and
from the log.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import algid
from algid.base.errors import ResultError
from algid.exports.description import describe
from algid.identification.known import by_constants, payload_length
from algid.results import Result
from algid.signals.segments import Segment, segments
from algid.synth.sensors import Sensors
from algid.tracks.arm import arm_of
from tests.tracks.folders import CASE, noisy, without_coulomb


@pytest.fixture(scope="module")
def result() -> Result:
    """Of an arm with its payload, which tells the lengths of its links."""
    logs = algid.synthesise("case1", duration=2.0, torque="wide", sensors=Sensors(1e-3, 1e-2))
    return algid.identify(*logs, model="plain")


@pytest.fixture(scope="module")
def first(picking: algid.Log) -> Segment:
    return next(iter(segments(iter([noisy(picking, np.random.default_rng(4))]))))


def _with(result: Result, **settings: Any) -> Result:
    return result.model_copy(update={"settings": {**result.settings, **settings}})


def test_lengths_that_were_estimated_come_with_their_errors(result: Result, first: Segment) -> None:
    arm, covariance = without_coulomb(arm_of(result, first))
    assert arm.value("l1") == result.payload["l1"].estimate == pytest.approx(CASE.arm.l1, rel=0.05)
    assert arm.value("l2") == result.payload["l2"].estimate == pytest.approx(CASE.arm.l2, rel=0.05)
    stds = [
        result.estimates[name].std
        for name in ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "l1", "l2")
    ]
    np.testing.assert_allclose(
        np.sqrt(np.diag(covariance)), np.array(stds, dtype=np.float64), rtol=1e-6
    )
    full, names = np.array(result.fit.covariance), result.fit.covariance_names
    assert covariance[0, 7] == full[names.index("k1"), names.index("l1")]
    assert covariance[8, 7] == full[names.index("l2"), names.index("l1")]


def test_a_length_that_is_given_goes_before_the_results_and_is_exact(
    result: Result, first: Segment
) -> None:
    arm, covariance = without_coulomb(arm_of(result, first, l1=0.4))
    assert (arm.value("l1"), arm.value("l2")) == (0.4, result.payload["l2"].estimate)
    assert not covariance[7].any()
    assert covariance[8, 8] > 0
    told = _with(result, l1=0.5, l2=0.6).model_copy(update={"payload": {}})
    arm, _ = arm_of(told, first, l2=0.3)
    assert (arm.value("l1"), arm.value("l2")) == (0.5, 0.3)


def test_without_a_length_or_error_bars_it_is_refused(result: Result, first: Segment) -> None:
    with pytest.raises(ResultError, match=r"has no l2; give the link's length with --l2"):
        arm_of(result.model_copy(update={"payload": {}}), first)
    with pytest.raises(ResultError, match=r"has no l2; give the link's length with --l2"):
        arm_of(result.model_copy(update={"payload": {}}), first, l1=0.3)
    with pytest.raises(ResultError, match="has no error bars"):
        arm_of(result.model_copy(update={"fit": None}), first)


def test_a_bodys_shape_comes_with_its_error_of_each_kilogram(
    result: Result, first: Segment
) -> None:
    """J_p / m_p by the delta method, written out."""
    m_p = result.payload["m_p"]
    std = 2e-5
    J = m_p.model_copy(update={"estimate": 4e-4, "std": std, "unit": "kg m^2"})
    names = [*result.fit.covariance_names, "J_p"]
    covariance = np.zeros((len(names),) * 2)
    covariance[:-1, :-1] = result.fit.covariance
    covariance[-1, -1] = std**2
    place = names.index("m_p")
    covariance[-1, place] = covariance[place, -1] = 0.5 * std * m_p.std
    fit = result.fit.model_copy(
        update={"covariance_names": names, "covariance": covariance.tolist()}
    )
    bodied = result.model_copy(update={"payload": {**result.payload, "J_p": J}, "fit": fit})
    arm, found = without_coulomb(arm_of(bodied, first))
    assert arm.shared.body == ("J_p",)
    assert arm.value("J_p") == pytest.approx(4e-4 / m_p.estimate)
    assert found.shape == (len(arm.model.names) + 3,) * 2
    # of a ratio whose errors are correlated by a half
    a, b = std / 4e-4, m_p.std / m_p.estimate
    of_shape = arm.value("J_p") * np.sqrt(a**2 + b**2 - a * b)
    assert np.sqrt(found[-1, -1]) == pytest.approx(of_shape, rel=1e-6)


@pytest.mark.parametrize("bent", [False, True])
def test_the_first_length_by_the_constants_comes_with_what_it_shares_with_them(
    result: Result, first: Segment, bent: bool
) -> None:
    """l1 = g |K1| / |K2| and its covariances, against draws from the result's covariance."""
    fit, parameters = result.fit, dict(result.parameters)
    names, full = list(fit.covariance_names), np.array(fit.covariance)
    if bent:
        sines = {"k1s": 0.3, "k2s": 0.4, "k4s": 0.1}
        for name, part in sines.items():
            size = float(parameters[name[:2]].estimate or 0.0)
            parameters[name] = parameters[name[:2]].model_copy(update={"estimate": part * size})
        turn = np.vstack([np.eye(len(names)), np.zeros((len(sines), len(names)))])
        for row, (name, part) in enumerate(sines.items(), start=len(names)):
            turn[row, [names.index(name[:2]), names.index("l2")]] = 2 * part, 1e-3 * part
        names, full = [*names, *sines], turn @ full @ turn.T
        fit = fit.model_copy(update={"model": fit.model.model_copy(update={"terms": ["phases"]})})
    changed = result.model_copy(
        update={
            "parameters": parameters,
            "payload": {name: one for name, one in result.payload.items() if name != "l1"},
            "fit": fit.model_copy(update={"covariance_names": names, "covariance": full.tolist()}),
        }
    )
    arm, found = without_coulomb(arm_of(changed, first))
    order = [*arm.model.names, "l2"]
    places = [names.index(name) for name in order]
    mean = np.array([changed.estimates[name].estimate for name in order], dtype=np.float64)
    small = 1e-4  # so that what is not linear does not show
    draws = mean[:, None] + small * (
        np.random.default_rng(0)
        .multivariate_normal(np.zeros(len(order)), full[np.ix_(places, places)], 40_000)
        .T
    )
    moments = {name: draws[order.index(name)] for name in order if name[:2] in ("k1", "k2")}
    K1, K2 = (moments[name] + 1j * moments.get(f"{name}s", 0.0) for name in ("k1", "k2"))
    l1 = 9.81 * np.abs(K1) / np.abs(K2)
    assert arm.value("l1") == pytest.approx(l1.mean(), rel=1e-5)
    both = np.cov(np.vstack([draws[:-1], l1, draws[-1:]])) / small**2
    scale = np.sqrt(np.diag(both))
    q = len(order) - 1
    np.testing.assert_allclose(
        (found / np.outer(scale, scale))[q], both[q] / scale / scale[q], atol=0.03
    )


def with_payload_std(result: Result, std: float) -> Result:
    l1 = result.payload["l1"]
    better = l1.model_copy(update={"std": std})
    return result.model_copy(update={"payload": {**result.payload, "l1": better}})


def test_the_better_of_constants_and_payload_is_taken(result: Result, first: Segment) -> None:
    known = by_constants(result)
    told = result.payload["l1"].estimate
    sure = with_payload_std(result, known[1] / 2)
    unsure = with_payload_std(result, known[1] * 2)
    assert payload_length(sure) == (told, known[1] / 2)
    assert payload_length(unsure) is None
    assert arm_of(sure, first)[0].value("l1") == told
    assert arm_of(unsure, first)[0].value("l1") == pytest.approx(known[0])
    lengths = [
        found.links[0].length
        for found in (describe(one, "arm", {}, links=True) for one in (sure, unsure))
        if found.links
    ]
    assert lengths == [told, pytest.approx(known[0])]
    assert arm_of(unsure, first, l1=0.3)[0].value("l1") == 0.3
