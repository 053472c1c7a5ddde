"""`algid inspect`, `convert` and `profile new` as commands."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from pydantic import BaseModel

import algid
from algid.base.errors import SettingError
from algid.inspection.checks import inspect_log
from algid.profile import Angle, Profile, Torque, Velocity, load_profile
from algid.readers import read_log
from algid.readers.table import JOINT_CHANNELS
from algid.writers import FORMATS, write_log
from tests.cli.commands import call
from tests.inspection.test_checks import moving_log
from tests.readers.large import WRITERS
from tests.readers.logs import TRUTH, noise_log, same
from tests.readers.ways import States, sent, written


def run(*arguments: str | Path, code: int = 0) -> str:
    """What a command prints, and why it fails."""
    done = call(*arguments)
    assert done.code == code, done
    return done.out + (done.err if code == 2 else "")


@pytest.mark.parametrize("kind", FORMATS)
def test_inspect_tells_what_a_log_is(kind: str, tmp_path: Path) -> None:
    write_log(tmp_path / f"arm.{kind}", moving_log())
    text = run("inspect", tmp_path / f"arm.{kind}")
    assert "condition number" in text
    found = json.loads(run("inspect", tmp_path / f"arm.{kind}", "--format", "json"))
    kinds = {(one["type"], one["count"]) for one in found["entries"]}
    known = {"csv": {("double", None)}, "parquet": {("double", 6000), ("int64", 6000)}}
    assert kinds == known.get(kind, {("sensor_msgs/msg/JointState, cdr", 6000)})
    assert found["refused"] is None
    assert found["clock"]["rows"] == 6000
    assert found["clock"]["rate"] == pytest.approx(1000)
    assert set(found["signals"]) == {
        f"{name}{joint}" for name in ("theta", "tau", "omega") for joint in (1, 2)
    }


def test_inspect_and_convert_of_a_cut_file_exit_with_4(tmp_path: Path) -> None:
    write_log(tmp_path / "arm.mcap", moving_log(60_000))
    content = (tmp_path / "arm.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 3 // 4])
    assert "CUT_OFF" in run("inspect", tmp_path / "cut.mcap", code=4)
    run("convert", tmp_path / "cut.mcap", "-o", tmp_path / "rest.csv", code=4)


@pytest.mark.parametrize("source", FORMATS)
@pytest.mark.parametrize("target", FORMATS)
def test_convert_keeps_every_bit_and_the_truth(source: str, target: str, tmp_path: Path) -> None:
    log = noise_log()
    write_log(tmp_path / f"in.{source}", replace(log, origin=replace(log.origin, truth=TRUTH)))
    run("convert", tmp_path / f"in.{source}", "-o", tmp_path / f"out.{target}")
    found = read_log(tmp_path / f"out.{target}")
    assert same(found, log)
    assert found.origin.truth == TRUTH
    again = run("convert", tmp_path / f"in.{source}", "-o", tmp_path / f"out.{target}", code=2)
    assert "--force" in again


def test_a_log_is_written_to_a_path_that_is_named_first(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"^write_log: expected a path, then a log; found Log"):
        algid.write_log(noise_log(), tmp_path / "in.csv")  # type: ignore[arg-type]


def test_convert_refuses_unknown_formats_and_settings(tmp_path: Path) -> None:
    write_log(tmp_path / "in.csv", noise_log())
    convert = ("convert", tmp_path / "in.csv", "-o")
    assert "found 'txt'" in run(*convert, tmp_path / "out.txt", code=2)
    assert "zero" in run(*convert, tmp_path / "out.csv", "--zero", "sideways", code=2)
    assert not (tmp_path / "out.csv").exists()


def test_inspect_of_a_refused_mcap_shows_joints_and_fields(tmp_path: Path) -> None:
    names = ["shoulder", "elbow"]
    states = [replace(one, effort=()) for one in sent(noise_log(10), name=names)]
    path = written("cdr", tmp_path, States(states))
    text = " ".join(run("inspect", path, code=2).split())
    assert "/joint_states: joints shoulder, elbow; fields" in text
    assert "position[shoulder], position[elbow]" in text
    assert "effort (empty)" in text
    assert "no topic holds theta1, theta2, tau1, tau2 of two joints; found '/joint_states'" in text
    found = json.loads(run("inspect", path, "--format", "json", code=2))
    assert found["entries"][0]["joints"] == names


def test_what_inspect_prints_is_what_a_profile_takes(tmp_path: Path) -> None:
    path = written("cdr", tmp_path, States(sent(noise_log(10, velocity=False), topic="/one")))
    first = read_log(path)
    sources = {name: {"source": first.origin.mapping[name]} for name in JOINT_CHANNELS}
    assert sources["theta1"] == {"source": "/one: position[j1]"}
    assert same(read_log(path, Profile.model_validate(sources)), first)


def keys(model: type[BaseModel]) -> set[str]:
    return {
        name
        for name, field in model.model_fields.items()
        if field.annotation not in (Angle, Velocity, Torque)
    }


@pytest.mark.parametrize("kind", FORMATS)
def test_a_new_profile_writes_all_that_can_be_set(kind: str, tmp_path: Path) -> None:
    log = noise_log()
    path, drafted = tmp_path / f"arm.{kind}", tmp_path / "algid.toml"
    write_log(path, log)
    run("inspect", path, "--write-profile", drafted)
    assert "--force" in run("inspect", path, "--write-profile", drafted, code=2)
    profile = load_profile(drafted)
    assert same(read_log(path, profile), log)
    assert read_log(path).origin.mapping["tau2"].endswith(profile.tau2.source or "?")
    text = drafted.read_text()
    head, *tables = re.split(r"^\[", text, flags=re.MULTILINE)
    assert keys(Profile) - set(re.findall(r"^(?:# )?(\w+) = ", head, re.MULTILINE)) == set()
    for table in tables:
        models: dict[str, type[BaseModel]] = {"theta": Angle, "q_des": Angle, "omega": Velocity}
        model = models.get(table[:5], Torque)
        assert keys(model) - set(re.findall(r"^(?:# )?(\w+) = ", table, re.MULTILINE)) == set()
    plain = re.sub(r"^# (?=\w+ = )", "", text, flags=re.MULTILINE)
    lines = [line for line in plain.splitlines() if not line.startswith("#")]
    (tmp_path / "all.toml").write_text("\n".join(lines))
    load_profile(tmp_path / "all.toml")  # every line is valid once it is no comment


def test_topics_of_bags_are_listed_as_of_mcap(tmp_path: Path) -> None:
    """Names, types, counts, rates, joints and fields, whatever holds the messages."""
    types = set()
    for form, write in WRITERS.items():
        write(tmp_path / f"log.{form}", 2001)
        found = inspect_log(tmp_path / f"log.{form}")
        (entry,) = found.entries
        assert (found.format, entry.name, entry.count) == (form, "/joint_states", 2001)
        assert entry.joints == ("joint1", "joint2")
        assert entry.rate == pytest.approx(1000)
        assert {"position[joint1]", "velocity[joint2]", "effort[joint2]"} <= set(entry.fields)
        types.add(entry.type)
    assert types == {"sensor_msgs/msg/JointState, cdr", "sensor_msgs/JointState, ros1"}
