"""Numbers, dates and names that no arm, log or folder has: refused at once, in one line, with
nothing written.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from algid.identification.summary import CONTRADICTED
from algid.inspection.findings import REFUSED
from tests.cli.commands import call

NOISE = ("--position-noise", "1e-3", "--torque-noise", "1e-2")
SYNTH = ("synth", "case1", "-o", "out")


@pytest.fixture(autouse=True)
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder of its own, in which and beside which nothing may be left."""
    inner = tmp_path / "inner"
    inner.mkdir()
    monkeypatch.chdir(inner)
    (inner / "log.csv").write_text("t,theta1\n")
    yield
    assert [path.name for path in tmp_path.iterdir()] == ["inner"]
    assert {path.name for path in inner.iterdir()} <= {"log.csv", "arm.toml", "limits.toml", "out"}
    assert not (inner / "out").exists() or not any((inner / "out").iterdir())


def refused(*arguments: str) -> str:
    done = call(*arguments)
    assert done.code == 2, done
    return done.err.rstrip("\n")


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        (("--rate", "1e12"), "less than or equal to 1000000"),
        (("--duration", "1e9"), "less than or equal to 1000000"),
        (
            ("--duration", "1e6", "--rate", "1e6"),
            "1e+06 s at --rate 1e+06 Hz are 1e+12 samples; expected at most",
        ),
        (
            ("--set", "start_time=0001-01-01"),
            "--set start_time: expected a date from 1970 to 2037, found 0001-01-01T00:00:00",
        ),
        (("--set", "start_time=1600-01-01"), "expected a date from 1970 to 2037"),
        (("--set", "start_time=2300-01-01"), "expected a date from 1970 to 2037"),
        (
            ("--set", "initial=1e9,0,0,0"),
            "--set initial: expected angles within 1e+06 rad and 10000 rad/s, found '1e9,0,0,0'",
        ),
        (
            ("--set", "initial=0,0,0,1e5"),
            "--set initial: expected angles within 1e+06 rad and 10000 rad/s, found '0,0,0,1e5'",
        ),
        (("--payload-schedule", "1=1e300"), "expected increasing times and payloads of 0 or more"),
        (("--position-noise", "1e308"), "less than or equal to 1000"),
    ],
)
def test_no_log_is_made_of_what_no_arm_does(flags: tuple[str, ...], told: str) -> None:
    assert told in refused(*SYNTH, *flags)


@pytest.mark.parametrize("year", ["1970", "2026", "2037"])
def test_dates_that_stamps_can_hold_are_taken(year: str, tmp_path: Path) -> None:
    out = tmp_path / "inner" / "out"
    done = call(
        "synth", "case1", "-o", out, "--duration", "0.1", "--set", f"start_time={year}-01-02"
    )
    assert done.code == 0, done.err
    for path in out.iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("m1 = 1e300", "arm.m1: expected less than or equal to 1000000, found 1e+300"),
        ("l2 = 1e-300", "arm.l2: expected greater than or equal to 0.0001, found 1e-300"),
        ("g = 1e9", "arm.g: expected less than or equal to 1000, found"),
        ("b1 = inf", "arm.b1: expected a finite number, found inf"),
    ],
)
def test_an_arm_that_none_is_like_is_refused_with_its_line(line: str, told: str) -> None:
    name = line.split()[0]
    values = {"m1": "1", "m2": "1", "l1": "0.3", "l2": "0.3"} | {name: line.split()[2]}
    Path("arm.toml").write_text(
        "[arm]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())
    )
    for command in (
        ("synth", "arm.toml"),
        ("design", "arm.toml", "--range", "1", "--speed", "3", "--torque", "2"),
    ):
        assert told in refused(*command, "-o", "out")


@pytest.mark.parametrize(
    "line",
    ["duration = 2e-30", "rate = 1e9", "runs = [9999, 1]", "speed = 1e300", "torque = 1e-200"],
)
def test_a_limit_that_none_is_like_is_refused_in_a_file_as_in_a_flag(line: str) -> None:
    limits = {"range": "1.2", "speed": "3", "torque": "1.5"} | dict([line.split(" = ")])
    Path("limits.toml").write_text("".join(f"{key} = {value}\n" for key, value in limits.items()))
    assert line.split()[0] in refused(
        "design", "case1", "--limits", "limits.toml", "-o", "out", *NOISE
    )


def test_a_name_that_is_too_long_is_called_that(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is computed: a search of minutes would be lost."""
    monkeypatch.setattr("algid.designs.campaign.plan", lambda *_: pytest.fail("planned in vain"))
    name = "x" * 300
    long = "cannot write there (File name too long); give a shorter name"
    assert long in refused("synth", "case1", "-o", name, "--duration", "0.1")
    assert long in refused(
        "design", "case1", "--range", "1", "--speed", "3", "--torque", "2", *NOISE, "-o", name
    )


def test_a_code_that_there_is_not_is_refused_and_all_that_there_are_are_taken() -> None:
    told = refused("inspect", "log.csv", "--accept", "FOO")
    assert told.startswith("algid: --accept (profile: accept.0): expected 'EFFORT_ZERO', ")
    assert told.endswith("found 'FOO'")
    for code in (*REFUSED, *CONTRADICTED, "NOT_FINITE"):
        assert "--accept" not in refused("inspect", "log.csv", "--accept", code)
