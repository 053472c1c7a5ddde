"""The verbs: each example runs, and logs and results in memory are taken as files are."""

from __future__ import annotations

import doctest
import inspect
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import algid
from algid.base.errors import ResultError
from algid.synth.sensors import Sensors


@pytest.mark.parametrize("name", sorted(algid._HOMES))
def test_examples_run_and_give_what_they_say(name: str) -> None:
    thing = inspect.unwrap(getattr(algid, name))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        for one in doctest.DocTestFinder().find(thing, name, globs={}):
            assert doctest.DocTestRunner().run(one).failed == 0


def test_every_public_function_has_an_example() -> None:
    functions = [name for name in algid.__all__ if inspect.isfunction(getattr(algid, name))]
    methods = [algid.Result.predict, algid.Result.plot, algid.Log.from_arrays]
    for thing in (*(getattr(algid, name) for name in functions), *methods):
        assert "\n>>> " in (inspect.getdoc(thing) or ""), thing


@pytest.fixture(scope="module")
def logs() -> tuple[algid.Log, algid.Log]:
    return algid.synthesise(
        "case1", duration=6.0, rate=500.0, torque="wide", sensors=Sensors(1e-4, 1e-2)
    )


@pytest.fixture(scope="module")
def weighed(logs: tuple[algid.Log, algid.Log]) -> algid.Result:
    return algid.identify(*logs, model="plain")


def test_a_frame_is_a_log_to_every_verb(
    logs: tuple[algid.Log, algid.Log], weighed: algid.Result
) -> None:
    log = logs[0]
    frame = {"t": log.t, "q": np.degrees(log.theta), "tau": 1000 * log.tau}
    units: dict[str, Any] = {"angle_unit": "deg", "torque_unit": "mN m"}
    plain = algid.inspect(log).signals
    seen = algid.inspect(frame, **units)
    assert seen.signals["tau1"].high == pytest.approx(plain["tau1"].high)
    assert [one.name for one in seen.entries] == ["t", "q[0]", "q[1]", "tau[0]", "tau[1]"]
    judged = algid.validate(weighed, frame, **units).total
    own = algid.validate(weighed, log).total
    assert judged.rmse == pytest.approx(own.rmse, rel=1e-6)
    found = algid.track(frame, weighed, **units)
    assert found.track.stretches[0].m_p == pytest.approx(0.0, abs=5e-3)


def test_a_prediction_is_the_torque_and_knows_the_payload(
    logs: tuple[algid.Log, algid.Log], weighed: algid.Result
) -> None:
    for loaded in (False, True):
        found = weighed.predict(logs[loaded], loaded=loaded).drop_nans()
        left = found["tau1"] - found["tau1_predicted"]
        assert float(left.std()) < 0.05 * float(found["tau1"].std())  # type: ignore[arg-type]
    wrong = weighed.predict(algid.Log.from_arrays(logs[1].t, logs[1].theta, logs[1].tau))
    left = (wrong["tau1"] - wrong["tau1_predicted"]).drop_nans()
    assert float(left.std()) > 0.2 * float(wrong["tau1"].std())  # type: ignore[arg-type]
    bare = weighed.model_copy(update={"payload": {}})
    with pytest.raises(ResultError, match="the result has no m_p"):
        bare.predict(logs[1], loaded=True)


def test_a_plot_is_the_pages_figure_of_every_interval(weighed: algid.Result) -> None:
    bars = weighed.plot().data[0]
    known = weighed.parameters | weighed.payload
    assert set(bars.y) <= {n for n, one in known.items() if one.estimate is not None}
    low, high = weighed.parameters["k1"].ci95 or (0.0, 0.0)
    half = 50 * (high - low) / abs(weighed.parameters["k1"].estimate or 1.0)
    assert bars.error_x.array[bars.y.index("k1")] == pytest.approx(half)


def test_what_is_written_is_what_the_command_writes(
    logs: tuple[algid.Log, algid.Log], weighed: algid.Result, tmp_path: Path
) -> None:
    made = algid.export(weighed, "c", l1=0.2, out=tmp_path / "arm.c")
    assert (tmp_path / "arm.c").read_text(encoding="utf-8") == made.text
    algid.track(logs[1], weighed, out=tmp_path)
    assert (tmp_path / "case1-loaded.track" / "track.json").is_file()
