"""What was stated of an arm, its logs and its driver, in the calls that use it later."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import algid
from algid.arm import inverse_dynamics
from algid.log import Log
from algid.synth.cases import load_case

ARM = Path(__file__).parents[2] / "data" / "example-arm.toml"
MOON = 1.62


@pytest.fixture(scope="module")
def moon(tmp_path_factory: pytest.TempPathFactory) -> tuple[algid.Result, Log, Log]:
    """An arm under another gravity, of a part of its log; and both logs, without their truth."""
    file = tmp_path_factory.mktemp("moon") / "arm.toml"
    file.write_text(ARM.read_text().replace("g = 9.81 ", f"g = {MOON} "))
    logs = algid.synthesise(
        file, duration=3.0, rate=200, torque="wide", position_noise=1e-4, torque_noise=1e-2
    )
    unloaded, loaded = (replace(log, origin=replace(log.origin, truth=None)) for log in logs)
    result = algid.identify(
        unloaded, model="plain", estimator="weak", gravity=MOON, start=0.2, end=2.5
    )
    return result, unloaded, loaded


def test_gravity_is_known_by_the_result_and_a_cut_is_of_its_log_alone(
    moon: tuple[algid.Result, Log, Log],
) -> None:
    arm, unloaded, loaded = moon
    later = algid.identify(None, loaded, parameters=arm, estimator="weak")
    assert later.settings["gravity"] == MOON
    assert later.payload["l1"].estimate == pytest.approx(0.3, abs=0.01)
    assert later.log.duration == pytest.approx(3.0)
    whole = algid.track(loaded, arm, l2=0.25)
    assert whole.track.stretches[-1].end > 2.9
    assert whole.track.stretches[0].m_p == pytest.approx(0.5, abs=0.01)
    calls: list[Callable[..., Any]] = [
        lambda **more: algid.identify(None, loaded, parameters=arm, **more),
        lambda **more: algid.track(loaded, arm, l2=0.25, **more),
        lambda **more: algid.validate(arm, unloaded, **more),
        lambda **more: arm.predict(unloaded, **more),
    ]
    for call in calls:
        with pytest.raises(algid.AlgidError, match=r"^--gravity: .* under 1.62 m/s², found 9.81;"):
            call(gravity=9.81)


def test_another_effort_of_later_logs_is_predicted_without_what_it_lacks(
    moon: tuple[algid.Result, Log, Log], tmp_path: Path
) -> None:
    arm, unloaded, _ = moon
    still = np.zeros_like(unloaded.theta)
    constants = load_case(str(ARM)).arm.constants()
    constants[[1, 3]] *= MOON / 9.81
    weight = inverse_dynamics(constants, unloaded.theta, still, still)
    floating = replace(unloaded, tau=unloaded.tau - weight)
    compensated = algid.validate(arm, floating, effort="gravity-compensated")
    assert max(compensated.total.nrmse) < 0.01
    assert compensated.warnings == ()
    light = algid.identify(
        floating, effort="gravity-compensated", gravity=MOON, estimator="weak", model="plain"
    )
    held = algid.export(light, "urdf", l1=0.3)
    assert "This file lacks what the driver takes off the torque" in held.text
    (tmp_path / "light.urdf").write_text(held.text)
    total = algid.validate(tmp_path / "light.urdf", floating, gravity=0.0).total
    assert total is not None
    assert max(total.nrmse) < 0.01
    file = tmp_path / "arm.urdf"
    algid.export(arm, "urdf", out=file)
    for log, effort in ((unloaded, None), (floating, "gravity-compensated")):
        said: dict[str, Any] = {"effort": effort}
        total = algid.validate(file, log, gravity=MOON, **said).total
        assert max(total.nrmse) < 0.01


def test_what_is_wrong_with_a_log_is_told_beside_its_prediction(
    moon: tuple[algid.Result, Log, Log],
) -> None:
    arm, unloaded, _ = moon
    q, tau = unloaded.theta + [[np.pi / 2], [0.0]], unloaded.tau.copy()
    assert algid.validate(arm, unloaded).warnings == ()
    (told,) = algid.validate(arm, Log.from_arrays(unloaded.t, q, tau, name="hung")).warnings
    assert told.startswith("hung: wrong by the equations of motion: zero ")
    assert told.endswith("--zero hanging")
    masked = np.ma.masked_array(tau, np.arange(tau.size).reshape(tau.shape) % 3 == 0)
    lossy = {"t": unloaded.t, "q": unloaded.theta, "tau": masked}
    assert any("dropped for want of a value" in one for one in algid.validate(arm, lossy).warnings)


def test_logs_in_memory_of_one_name_are_predicted_one_by_one(
    moon: tuple[algid.Result, Log, Log],
) -> None:
    arm, unloaded, _ = moon
    frames = [
        {"t": one.t, "q": one.theta, "tau": one.tau}
        for one in (unloaded.part(0, 300), unloaded.part(300, 601))
    ]
    assert [*algid.validate(arm, frames).logs] == ["log", "log (2)"]


def test_what_no_log_holds_is_told_by_convert(tmp_path: Path) -> None:
    algid.synthesise("case1", out=tmp_path, format="csv")
    source, out = tmp_path / "case1-unloaded.csv", tmp_path / "new.csv"
    (told,) = algid.convert(source, out, gravity=MOON, effort="gravity-compensated")
    assert told.code == "STATED_UNUSED"
    assert told.remedies[0].words == f"--gravity {MOON} --effort gravity-compensated"
    assert algid.convert(source, out, force=True, gravity=9.81, effort="raw") == []
