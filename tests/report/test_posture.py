"""The arm that a page draws: to scale, in the posture of the log."""

from __future__ import annotations

import numpy as np
import pytest

from algid.report.figures import arm_of
from algid.report.plot import ArmDrawing
from algid.report.series import Drawn
from algid.results import Estimate, Result


def arm(result: Result, raw: Drawn) -> ArmDrawing:
    found = arm_of(result, raw)
    assert found is not None
    return found


def test_links_are_as_long_as_the_payload_or_the_constants_have_it(
    result: Result, raw: Drawn
) -> None:
    known = {name: Estimate(estimate=value, unit="m") for name, value in (("l1", 0.3), ("l2", 0.2))}
    long = arm(result.model_copy(update={"payload": known}), raw)
    assert (long.l1, long.l2, long.payload, long.aside) == (0.3, 0.2, "", 0.0)
    k1, k2 = (Estimate(estimate=value, unit="") for value in (0.2, 9.81 * 0.2 / 0.25))
    bare = {
        "payload": {},
        "settings": {"gravity": 9.81},
        "parameters": {**result.parameters, "k1": k1, "k2": k2},
    }
    drawing = arm(result.model_copy(update=bare), raw)
    assert drawing.l1 == drawing.l2 == pytest.approx(0.25)  # l1 = g k1 / k2
    assert "Link 2's length is not known" in drawing.reading
    bare["settings"] = {"gravity": 9.81, "l2": 0.7}
    assert arm(result.model_copy(update=bare), raw).l2 == 0.7
    upside_down = k2.model_copy(update={"estimate": -7.0})
    bare["parameters"] = {**result.parameters, "k1": k1, "k2": upside_down}
    assert arm_of(result.model_copy(update=bare), raw) is None
    assert arm_of(result, None) is None


def test_the_arm_stands_as_the_log_begins_and_moves_as_it_does(result: Result, raw: Drawn) -> None:
    drawing = arm(result, raw)
    assert drawing.theta[0, 0] == raw.samples["theta1"][0]
    t = drawing.frames["t"]
    assert len(t) == 122
    assert (t[0], t[-1]) == pytest.approx((0.0, 4.0), abs=2e-3)
    end = raw.samples["theta2"][raw.samples["log"] == 0][-1]
    assert drawing.frames["theta2"][-1] == pytest.approx(end, abs=5e-4)
    assert drawing.payload.startswith("payload of 0.35")
    long = ArmDrawing(1, 1, np.linspace(0, 1e4, 10_000), np.zeros((2, 10_000)), "")
    assert len(long.frames["t"]) == 6002
