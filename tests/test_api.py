"""What a notebook sees of algid."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import algid
from algid.base.errors import LogError, OutputError, SettingError
from algid.log import ChannelReading, Reading
from algid.profile import Torque
from algid.results import Result, write_result
from tests.report.folders import build


def test_dir_shows_the_public_names_and_each_is_there() -> None:
    assert dir(algid) == sorted(algid.__all__)
    assert all(getattr(algid, name) is not None for name in algid.__all__)


CALLED = [name for name in algid.__all__ if name not in ("AlgidError", "Result", "__version__")]


@pytest.mark.parametrize("name", CALLED)
def test_what_notebooks_call_says_all_that_it_takes_and_gives(name: str) -> None:
    thing = getattr(algid, name)
    said = _sections(thing)
    assert said["Parameters"] == set(inspect.signature(thing).parameters)
    if inspect.isfunction(thing):
        assert ("Returns" in said) == (inspect.signature(thing).return_annotation != "None")
        assert said["Raises"]


def test_a_result_says_what_each_of_its_fields_is() -> None:
    assert _sections(Result)["Attributes"] == set(Result.model_fields) | set(
        Result.model_computed_fields
    )


def _sections(thing: object) -> dict[str, set[str]]:
    """By numpydoc's heading the names that its lines explain: before a colon, with commas between
    them.
    """
    parts = re.split(r"^(\w+)\n-+\n", inspect.getdoc(thing) or "", flags=re.MULTILINE)[1:]
    return {
        heading: {
            name
            for line in text.splitlines()
            if line[:1].strip()
            for name in line.split(" :")[0].lstrip("*").split(", ")
        }
        for heading, text in zip(parts[::2], parts[1::2], strict=True)
    }


def test_a_result_is_read_by_a_string_and_shows_itself_as_a_short_table(tmp_path: Path) -> None:
    made = build(tmp_path / "a.algid", duration=1.0)
    found = algid.read_result(str(tmp_path / "a.algid"))
    assert found == made
    assert found != made.model_copy(update={"estimator": "weak"})
    lines = str(found).splitlines()
    assert lines == repr(found).splitlines()
    assert lines[0].startswith("refined estimate from")
    assert lines[1].startswith("Good: ")
    assert {"k1", "m_p"} <= {line.split()[0] for line in lines if line}
    hostile = found.model_copy(
        update={"log": found.log.model_copy(update={"path": "<b>\x1b[31m\n.csv"})}
    )
    assert "\x1b" not in str(hostile)
    assert len(str(hostile).splitlines()) == len(lines)


def test_a_result_of_schema_3_is_still_read(tmp_path: Path) -> None:
    """Its notices have the codes of now, with the texts that they had."""
    build(tmp_path / "a.algid", duration=1.0)
    file = tmp_path / "a.algid" / "result.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    content["schema_version"] = 3
    one = {"text": "stamps jitter", "lossy": False, "note": False, "refuse": False}
    rest: dict[str, Any] = {"numbers": {}, "remedies": [], "logs": ["arm.csv"]}
    content["notices"] = [{"code": "UNEVEN_STAMPS"} | one | rest]
    file.write_text(json.dumps(content), encoding="utf-8")
    old: Result = algid.read_result(file)
    assert [(notice.key, notice.text) for notice in old.notices] == [
        ("UNEVEN_STAMPS:", "stamps jitter")
    ]


READING = Reading(
    channels={"tau1": ChannelReading("effort", "mN m", "flag", -1e-3, 0.25)},
    joints=("shoulder", "elbow"),
    joints_told="order",
    topics=("/one", "/two"),
    clock="log",
    time_unit="ns",
    zero="hanging",
    second_angle="absolute",
    drive="base",
    passive=2,
    signs=(1, -1),
    offsets=(0.5, -0.125),
    unwrap=(False, True),
    start=0.5,
    end=2.0,
    torque_file="torques.csv",
    segment=2,
    accepted=("LOST_SAMPLES",),
)


def test_a_result_keeps_all_that_a_reader_decided(tmp_path: Path) -> None:
    assert all(
        getattr(READING, field.name) != getattr(Reading(), field.name) for field in fields(Reading)
    )
    made = build(tmp_path / "a.algid", duration=1.0)
    made = made.model_copy(update={"log": made.log.model_copy(update={"reading": READING})})
    write_result(made, tmp_path / "result.json")
    assert algid.read_result(tmp_path / "result.json").log.reading == READING
    held = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["log"]["reading"]
    assert held["channels"]["tau1"] == {
        "source": "effort",
        "unit": "mN m",
        "told": "flag",
        "factor": -1e-3,
        "offset": 0.25,
    }
    assert list(held) == [field.name for field in fields(Reading)]


def other(**changes: Any) -> list[str]:
    """The clauses that tell `READING` from one with `changes`; those of a channel are its own."""
    channel = {
        name: changes.pop(name) for name in list(changes) if name in ("unit", "factor", "offset")
    }
    channels = {"tau1": replace(READING.channels["tau1"], **channel)}
    return list(READING.differences(replace(READING, channels=channels, **changes)))


def test_readings_differ_by_what_decides_the_estimates() -> None:
    assert other() == []
    assert sorted(other(zero="horizontal", joints=("elbow", "shoulder"))) == [
        "joints shoulder,elbow instead of elbow,shoulder",
        "zero hanging instead of horizontal",
    ]
    assert other(second_angle="relative") == ["second_angle absolute instead of relative"]
    assert other(drive="joint") == ["drive base instead of joint"]
    assert other(unit="N m") == ["tau1.unit mN m instead of N m"]
    assert other(factor=1e-3) == ["tau1.sign -1 instead of 1"]
    assert other(offset=0.5) == ["tau1.offset 0.25 instead of 0.5"]
    assert other(factor=-2e-3) == ["tau1 per mN m 0.001 instead of 0.002"]
    assert other(factor=-1.0, unit="N m") == ["tau1.unit mN m instead of N m"]


def test_a_log_is_made_of_arrays_either_way_round_and_gives_the_same_result() -> None:
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide")
    weak = algid.Settings(estimator="weak")
    told = list[tuple[str, int, int]]()
    given = algid.Log.from_arrays(log.t, log.theta, log.tau)
    one = algid.identify(given, settings=weak, progress=lambda *step: told.append(step))
    ends = {stage: (done, total) for stage, done, total in told}  # of each stage the last
    assert next(iter(ends)) == "reading"
    assert set(ends.values()) == {(2001, 2001)}
    assert all(0 <= done <= total for _, done, total in told)
    other = algid.identify(algid.Log.from_arrays(log.t, log.theta.T, log.tau.T), settings=weak)
    assert one.parameters == other.parameters
    with pytest.raises(LogError, match=r"^log: theta: expected the shape \(2, 2001\)"):
        algid.Log.from_arrays(log.t, log.theta[:, 1:], log.tau)
    with pytest.raises(LogError, match=r"^log: t: expected finite times in s that increase"):
        algid.Log.from_arrays(log.t[::-1], log.theta, log.tau)
    frame = one.to_frame()
    assert frame["parameter"].to_list() == list(one.estimates)
    k1 = one.parameters["k1"]
    assert frame.row(0) == ("k1", k1.estimate, k1.std, *(k1.ci95 or ()), "kg m^2", "OK")
    assert one.covariance.shape == (len(one.fit.covariance_names),) * 2 if one.fit else False
    assert one.verdict.word in repr(one)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"theta": np.full((2, 501), np.nan)}, "theta: expected finite"),
        ({"tau": np.zeros((2, 501), dtype=int)}, "tau: expected finite float64, its type is int64"),
        ({"stamp_ns": np.arange(501.0)}, "stamp_ns: expected increasing integers"),
        ({"stamp_ns": np.zeros(501, dtype=np.int64)}, "stamp_ns: expected increasing integers"),
    ],
    ids=["NaN", "integers", "times in s", "one time"],
)
def test_a_log_whose_arrays_are_not_a_logs_is_refused_in_a_line(
    changes: dict[str, Any], why: str
) -> None:
    log, _ = algid.synthesise("case1", duration=0.5)
    for verb in (algid.identify, algid.inspect, lambda one: algid.identify([log, one])):
        with pytest.raises(LogError, match=f"^case1-unloaded: {why}[^\\n]*$"):
            verb(replace(log, **changes))
    with pytest.raises(LogError, match=r"^case1-unloaded: expected two samples or more, found 1"):
        algid.identify(log.part(0, 1))


@pytest.mark.parametrize(("step", "told"), [(0.199, []), (0.201, ["OTHER_UNIT:slow time"])])
def test_a_clock_too_slow_for_an_arm_is_doubted(step: float, told: list[str]) -> None:
    t = step * np.arange(30)
    rows = np.stack([np.sin(t), np.cos(t)])
    columns = {"t": t} | dict(
        zip(("theta1", "theta2", "tau1", "tau2"), [*rows, *rows], strict=True)
    )
    read = algid.read_log(columns)
    for log in (read, algid.Log.from_arrays(t, rows, rows)):
        assert [one.key for one in log.notices] == told
    assert [one.remedies[0].settings for one in read.notices] == [{"time_unit": "ms"} for _ in told]
    assert algid.read_log(columns, time_unit="s").notices == ()


@pytest.mark.parametrize("logs", [None, [], ()])
def test_no_log_at_all_is_a_setting_that_lacks(logs: Any) -> None:
    with pytest.raises(SettingError, match=r"^identify: expected an unloaded log, .* found none$"):
        algid.identify(logs)


def test_settings_of_a_reading_hold_for_arrays_as_for_a_file(tmp_path: Path) -> None:
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide", torque_noise=1e-2)
    hanging = np.array([[np.pi / 2], [0.0]])
    other = algid.Log.from_arrays(log.t, np.degrees(-(log.theta + hanging)), -log.tau)
    said: dict[str, Any] = {
        "zero": "hanging",
        "angle_unit": "degrees",
        "signs": (-1, -1),
        "start": 0.5,
    }
    algid.write_log(tmp_path / "arm.csv", other)
    by_file = algid.identify(tmp_path / "arm.csv", estimator="weak", **said)
    found = algid.identify(other, estimator="weak", **said)
    assert found.log.rows == 1501
    assert found.profile == by_file.profile
    for name, one in found.parameters.items():
        assert one.estimate == pytest.approx(by_file.parameters[name].estimate, rel=1e-9)
    arm = algid.identify(log.part(500, 2001), estimator="weak")
    assert found.parameters["k4"].estimate == pytest.approx(arm.parameters["k4"].estimate, rel=1e-6)
    assert algid.inspect(other, **said).clock == algid.inspect(tmp_path / "arm.csv", **said).clock
    # what only a file has, and what has been said when the log was read
    with pytest.raises(SettingError, match=r"^topic: log is a Log in memory"):
        algid.identify(other, topic="/joint_states")
    with pytest.raises(SettingError, match=r"^theta1\.source: log is a Log in memory"):
        algid.validate(found, [other], theta1={"source": "q1"})
    read = algid.read_log(tmp_path / "arm.csv", **said)
    assert (algid.read_log(tmp_path / "arm.csv", said).theta == read.theta).all()  # a profile
    with pytest.raises(SettingError, match=r"^zero: .*arm\.csv has been read already"):
        algid.track(read, found, zero="hanging")
    assert algid.identify(read, estimator="weak", end=1.0).log.rows == 1001


def test_settings_are_what_their_result_holds_of_them() -> None:
    assert not algid.Settings().constrain
    turning = algid.Settings(estimator="paper", poles="-80+20j,-80-20j,-80,-90,-90,-70")  # type: ignore[arg-type]
    assert algid.Settings.of(turning.as_json()) == turning
    assert algid.Profile(tau1=Torque(kp=0.5, kd=0.0)).tau1.kp == 0.5


def test_what_was_said_of_arrays_holds_of_later_ones() -> None:
    log, loaded = algid.synthesise("case1", duration=2.0, torque="wide", torque_noise=1e-2)
    hanging = np.array([[np.pi / 2], [0.0]])
    one, two = (
        algid.Log.from_arrays(each.t, each.theta - hanging, 1e3 * each.tau)
        for each in (log, loaded)
    )
    arm = algid.identify(one, estimator="weak", model="plain", zero="upright", torque_unit="mN m")
    found = algid.identify(None, [two], parameters=arm, estimator="weak", model="plain")
    assert found.payload["m_p"].estimate == pytest.approx(0.3515, rel=0.05)
    validated = algid.validate(arm, one)
    assert (min(validated.total.r2) > 0.999, validated.warnings) == (True, ())
    assert min(algid.validate(arm, one, start=0.2).total.r2) > 0.999  # beside what is said anew
    left = arm.predict(one).select(pl.col("tau1") - pl.col("tau1_predicted")).to_series()
    assert left.fill_nan(None).std() < 0.02 * np.std(log.tau[0])
    (stretch,) = algid.track(two, arm, l1=0.1626, l2=0.1232).track.stretches
    assert stretch.m_p == pytest.approx(0.3515, rel=0.05)
    # arrays of SI units stay what they are beside a file, or where they were read before
    as_columns = {"t": one.t, "q": one.theta, "tau": one.tau}
    of_dict = algid.identify(as_columns, estimator="weak", zero="upright", torque_unit="mN m")
    plain = algid.Log.from_arrays(log.t, log.theta, log.tau)
    assert min(algid.validate(of_dict, plain).total.r2) > 0.999
    read = algid.read_log(as_columns, zero="upright", torque_unit="mN m")
    assert min(algid.validate(arm, read).total.r2) > 0.999


def test_a_design_and_a_comparison_take_results_in_memory(tmp_path: Path) -> None:
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide", torque_noise=1e-2)
    result = algid.identify(log, model="plain")
    other = algid.identify(log, estimator="weak", model="plain")
    result_file = tmp_path / "result.json"
    write_result(result, result_file)
    asked: dict[str, Any] = {"range": 1.2, "speed": 3, "torque": 1.5, "duration": 1.0, "rate": 100}
    asked |= {"position_noise": 1e-3, "torque_noise": 1e-2}
    shown: list[tuple[str, int, int]] = []
    plan = algid.design(result, **asked, progress=lambda *step: shown.append(step))
    assert plan.bounds == algid.design(result_file, **asked).bounds
    assert shown[0] == ("searching", 0, 0)
    one = algid.compare(result, other, out=tmp_path / "mine.html")
    assert one.as_json() == algid.compare([result, other]).as_json()
    assert "results side by side" in (tmp_path / "mine.html").read_text(encoding="utf-8")
    with pytest.raises(OutputError, match="mine"):
        algid.compare(result, other, out=tmp_path / "mine.html")


WEAK = algid.Settings(estimator="weak")


@pytest.fixture(scope="module")
def columns() -> dict[str, Any]:
    """The columns of a log whose angles are in degrees, one of which is a time."""
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide")
    angles = {f"theta{joint + 1} [deg]": np.degrees(log.theta[joint]) for joint in (0, 1)}
    return {"time": log.t, **angles, "tau1": log.tau[0], "tau2": log.tau[1]}


@pytest.mark.parametrize("given", [42, np.zeros((2, 9)), [np.zeros(9)], [None], b"log.csv"])
@pytest.mark.parametrize("verb", [algid.identify, algid.inspect])
def test_what_is_no_log_is_refused(verb: Callable[[Any], object], given: object) -> None:
    with pytest.raises(
        LogError, match="expected a path, a Log, a frame or a dict of arrays, found"
    ):
        verb(given)
    with pytest.raises(LogError, match=r"^log: 'q' is no array .*; give numbers of one shape$"):
        algid.identify({"t": [0.0, 0.1], "q": [[1.0], [1.0, 2.0]]})


def test_a_profile_is_given_in_any_form_and_its_settings_as_keywords(
    columns: dict[str, Any], tmp_path: Path
) -> None:
    frame, file = pl.DataFrame(columns), tmp_path / "algid.toml"
    file.write_text('zero = "hanging"\ngravity = 9.7\n[tau1]\nsign = -1\n', encoding="utf-8")
    content: dict[str, Any] = {"zero": "hanging", "gravity": 9.7, "tau1": {"sign": -1}}
    ways: list[dict[str, Any]] = [
        {"profile": str(file)},
        {"profile": algid.Profile.model_validate(content)},
        {"profile": {"zero": "horizontal", "gravity": 9.0}} | content,
    ]
    found = [algid.identify(frame, settings=WEAK, **way) for way in ways]
    assert all(one.parameters == found[0].parameters for one in found)
    assert {one.settings["gravity"] for one in found} == {9.7}
    readings = [one.log.reading for one in found]
    assert all(one and one.zero == "hanging" for one in readings)
    assert [one and one.channels["tau1"].sign for one in readings] == [-1] * 3
