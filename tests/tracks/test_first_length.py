"""Link 1's length for a track and a model of links: what the result knows best."""

from __future__ import annotations

import pytest

import algid
from algid.exports.description import describe
from algid.identification.known import by_constants, payload_length
from algid.results import Result
from algid.signals.segments import Segment
from algid.synth.sensors import Sensors
from algid.tracks.arm import arm_of


@pytest.fixture(scope="module")
def weighed() -> Result:
    logs = algid.synthesise(
        "case1", duration=3.0, rate=500.0, torque="wide", sensors=Sensors(1e-3, 1e-2)
    )
    return algid.identify(*logs, model="plain")


def with_payload_std(result: Result, std: float) -> Result:
    l1 = result.payload["l1"]
    assert l1.estimate is not None
    better = l1.model_copy(update={"std": std})
    return result.model_copy(update={"payload": {**result.payload, "l1": better}})


def segment() -> Segment:
    log, _ = algid.synthesise("case1", duration=0.2)
    return Segment(0.0, 1e-3, log.theta, log.tau, None)


def test_the_better_of_constants_and_payload_is_taken(weighed: Result) -> None:
    first = by_constants(weighed)
    told = weighed.payload["l1"].estimate
    sure = with_payload_std(weighed, first[1] / 2)
    unsure = with_payload_std(weighed, first[1] * 2)
    assert payload_length(sure) == (told, first[1] / 2)
    assert payload_length(unsure) is None
    assert arm_of(sure, segment())[0].value("l1") == told
    assert arm_of(unsure, segment())[0].value("l1") == pytest.approx(first[0])
    lengths = [
        found.links[0].length
        for found in (describe(one, "arm", {}, links=True) for one in (sure, unsure))
        if found.links
    ]
    assert lengths == [told, pytest.approx(first[0])]
    assert arm_of(unsure, segment(), l1=0.3)[0].value("l1") == 0.3
