"""Every flag of every command with what it cannot take: the exact line, exit code 2, nothing
written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest

from tests.cli.commands import call
from tests.cli.test_completion import FREE, commands

CALLS: dict[str, tuple[str, ...]] = {
    "inspect": ("log.csv",),
    "design": ("case1", "--range", "1.2", "--speed", "3", "--torque", "1.5"),
    "identify": ("log.csv",),
    "validate": ("arm.algid", "log.csv"),
    "export": ("arm.algid", "--to", "urdf"),
    "batch": ("log.csv", "-o", "out"),
    "track": ("log.csv", "--parameters", "arm.algid"),
    "report": ("arm.algid",),
    "compare": ("a.algid", "b.algid"),
    "synth": ("case1",),
    "convert": ("log.csv", "-o", "out.csv"),
    "guide": (),
}
"""A call of each command without a file: a wrong flag is reported before a file is opened."""
READERS = ("inspect", "convert", "identify", "batch", "validate", "track")
"""Commands that take what a log means."""


@pytest.fixture(autouse=True)
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder of its own, in which nothing may be left."""
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("t,theta1\n")
    yield
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def refused(command: str, *flags: str) -> str:
    """The one line that a wrong flag gets."""
    done = call(*command.split(), *CALLS[command], *flags)
    assert (done.code, done.out) == (2, ""), (command, flags, done)
    assert done.err.count("\n") == 1, done.err
    return done.err.removeprefix("algid: ").rstrip("\n")


def options(*kinds: Any) -> Iterator[Any]:
    """Every command's options of these types."""
    for name, command in commands():
        for option in command.params:
            kind = option.type_descriptor.annotation
            if option.param_type_name == "option" and (kind in kinds or get_origin(kind) in kinds):
                yield pytest.param(name, option, id=f"{name} {option.opts[-1]}")


@pytest.mark.parametrize(("command", "option"), [*options(float)])
def test_a_number_is_finite_and_within_its_bounds(command: str, option: Any) -> None:
    flag, info = option.opts[-1], option.type_descriptor.parameter_info
    assert "valid number" in refused(command, f"{flag}=much") or "valid float" in refused(
        command, f"{flag}=much"
    )
    for text in ("nan", "inf", "-inf"):
        told = refused(command, f"{flag}={text}")
        if told.startswith("Invalid value"):  # a bound is told before
            assert told.startswith(f"Invalid value for '{flag}': ")
            assert info.min is not None or info.max is not None
        else:
            assert told == f"{flag}: expected a finite number, found {text}"
    if info.min is not None:
        least = f"{info.min:.12f}".rstrip("0").rstrip(".")
        assert f"greater than or equal to {least}" in refused(
            command, f"{flag}={info.min - 1e-3:.17g}"
        )
    if info.max is not None:
        assert f"less than or equal to {info.max:.15g}" in refused(
            command, f"{flag}={1.001 * info.max:.17g}"
        )


@pytest.mark.parametrize(("command", "option"), [*options(int)])
def test_a_count_is_whole_and_within_its_bounds(command: str, option: Any) -> None:
    flag, info = option.opts[-1], option.type_descriptor.parameter_info
    for text in ("some", "1.5", "", "nan"):
        assert refused(command, f"{flag}={text}").startswith(f"Invalid value for '{flag}': ")
    assert info.min is not None
    assert f"greater than or equal to {info.min}" in refused(command, f"{flag}={info.min - 1}")
    if info.max is not None:
        assert f"less than or equal to {info.max}" in refused(command, f"{flag}={info.max + 1}")


def choices() -> Iterator[Any]:
    for name, command in commands():
        for option in command.params:
            kind = option.type_descriptor.annotation
            if get_origin(kind) is Literal:
                yield pytest.param(name, option, list(get_args(kind)), id=f"{name} {option.name}")
            elif isinstance(kind, type) and issubclass(kind, Enum):
                yield pytest.param(
                    name, option, [one.value for one in kind], id=f"{name} {option.name}"
                )


@pytest.mark.parametrize(("command", "option", "known"), [*choices()])
def test_a_choice_that_there_is_not_is_told_with_those_that_there_are(
    command: str, option: Any, known: list[str]
) -> None:
    given = ["nothing"] if option.param_type_name == "argument" else [f"{option.opts[-1]}=nothing"]
    told = refused(command, *given).partition(";")[0]
    assert told.startswith("Invalid value for ")
    assert "nothing" in told
    assert re.findall(r"'([^' ]+)'", told)[-len(known) :] == known


@pytest.mark.parametrize("text", ["soon", "2026-02-30", "12:00"])
def test_a_date_that_is_none_is_told_with_its_form(text: str) -> None:
    told = refused("synth", "--set", f"start_time={text}")
    assert told.startswith("--set start_time: expected a date like 2026-01-31T12:00:00, found ")


ANGLES = "'rad', 'mrad', 'deg', 'rev' or 'counts'"
TORQUES = (
    "'N m', 'mN m', 'N cm', 'kN m', 'kgf m', 'kgf cm', 'lbf ft', 'lbf in', 'ozf in', 'A' or 'mA'"
)
OF_A_LOG = [
    ("--joints", "one", "--joints: expected two names like shoulder,elbow, found 'one'"),
    ("--joints", "a,b,c", "--joints: expected two names like shoulder,elbow, found 'a,b,c'"),
    ("--joints", "a,", "--joints: expected two names like shoulder,elbow, found 'a,'"),
    (
        "--angle-unit",
        "mile",
        f"--angle-unit (profile: theta1.unit): expected {ANGLES}, found 'mile' (and 3 more)",
    ),
    (
        "--torque-unit",
        "N",
        f"--torque-unit (profile: tau1.unit): expected {TORQUES}, found 'N' (and 1 more)",
    ),
    (
        "--zero",
        "sideways",
        "--zero (profile: zero): expected 'horizontal', 'hanging' or 'upright', found 'sideways'",
    ),
    (
        "--zero",
        "",
        "--zero (profile: zero): expected 'horizontal', 'hanging' or 'upright', found ''",
    ),
    (
        "--second-angle",
        "x",
        "--second-angle (profile: second_angle): expected 'relative' or 'absolute', found 'x'",
    ),
    ("--set", "drive=x", "--set (profile: drive): expected 'joint' or 'base', found 'x'"),
    ("--set", "passive=3", "--set (profile: passive): expected 1 or 2, found 3"),
    ("--set", "clock=x", "--set (profile: clock): expected 'header' or 'log', found 'x'"),
    ("--start", "x", "--start (profile: start): expected a valid number, found 'x'"),
    ("--start", "-1", "--start (profile: start): expected greater than or equal to 0, found '-1'"),
    ("--start", "nan", "--start (profile: start): expected a finite number, found 'nan'"),
    (
        "--set",
        "segment=0",
        "--set (profile: segment): expected greater than or equal to 1, found 0",
    ),
    (
        "--set",
        "segment=x",
        "--set (profile: segment): expected a valid integer, found 'x'",
    ),
    ("--rate", "0", "--rate (profile: rate): expected greater than or equal to 0.001, found '0'"),
    ("--end", "0", "--end (profile: end): expected greater than 0, found '0'"),
    ("--end", "1e400", "--end (profile: end): expected a finite number, found '1e400'"),
    ("--set", "zero", "--set zero: expected KEY=VALUE like tau1.sign=-1"),
    ("--set", "=1", "--set =1: expected KEY=VALUE like tau1.sign=-1"),
    ("--set", "tau1.sign=2", "--set (profile: tau1.sign): expected 1 or -1, found 2"),
    (
        "--set",
        "tau1.colour=red",
        "--set (profile: tau1.colour): extra inputs are not permitted, found 'red'",
    ),
    (
        "--profile",
        "absent.toml",
        "absent.toml: cannot read it (No such file or directory); check the name",
    ),
]
UNCHECKED = {
    "part",
    "flange",
    "effort",
    "gravity",
    "topic",
    "accept",
    "name",
    "scheduler",
    "out",
} | {"max_error"}
"""Text that means what it says: names, which a log or a folder has or has not."""


@pytest.mark.parametrize(("flag", "text", "line"), OF_A_LOG)
def test_what_a_log_cannot_mean_is_told_alike_by_every_command(
    flag: str, text: str, line: str
) -> None:
    for command in READERS:
        assert refused(command, f"{flag}={text}") == line, command


TERMS = "coulomb, offset, rotor, stribeck, asymmetry, load, gain, phases, lag, delay"
OF_SETTINGS = [
    ("--model", "magic", f"--model: expected auto, plain or some of {TERMS}; found 'magic'"),
    ("--model", "stribeck", ("--model: stribeck has no meaning without coulomb; add coulomb to the "
                            "list")),
    ("--set", "delay=inf", "--set delay: expected a number from -10 to 10, found inf"),
    ("--set", "poles=a,b", ("--set poles a,b: expected numbers between commas; give six like "
                       "-80,-390,-391,-392,-393,-394")),
    ("--set", "window=0", "--set window: expected a number from 0.001 to 3600, found 0"),
    ("--set", "window=x", "--set window: expected a number from 0.001 to 3600, found 'x'"),
    ("--set", "bandwidth=-1", "--set bandwidth: expected a number from 0.01 to 100000, found -1"),
    ("--gravity", "-9.81", "--gravity: expected a number from 0 to 1000, found -9.81"),
    ("--l1", "0", "--l1: expected a number from 0.0001 to 1000, found 0.0"),
    ("--l2", "-1", "--l2: expected a number from 0.0001 to 1000, found -1.0"),
    ("--payload-mass", "0", "--payload-mass: expected a number from 1e-09 to 1e+06, found 0.0"),
]  # fmt: skip


@pytest.mark.parametrize(("flag", "text", "line"), OF_SETTINGS)
def test_a_setting_without_a_meaning_is_told_alike_by_identify_and_batch(
    flag: str, text: str, line: str
) -> None:
    for command in ("identify", "batch"):
        assert refused(command, f"{flag}={text}") == line, command


SCHEDULE = (
    "--payload-schedule: expected increasing times and payloads of 0 or more like "
    "2=0.05,4=0, found "
)
STATE = "--set initial: expected four numbers like -1.57,0,0,0, found "
RANGE = (
    "--range: expected rad like 1.2 (to both sides of hanging), 1.2,1.0, or "
    "-2.7:-0.4,-1.2:1.2, found "
)
RUNS = "--runs: expected numbers of runs without and with the payload like 2,1, found "
NAME = "--name: expected a name for the result folder, found ''; leave it out for the log's own"
PLAIN = "--name: expected a name without slashes, found {!r}; -o names the folder around it"
NOISE = ("--position-noise", "1e-3", "--torque-noise", "1e-2")
BESIDE = ": a motion starts where it was planned and carries one payload; leave it out"
OWN = [
    *(("synth", ("--payload-schedule", text), f"{SCHEDULE}{text!r}") for text in (
        "", "2", "what", "a=1", "1=x", "1=2=3", "1=0.1,", "1=0.1,1=0", "2=0.1,1=0", "1=-0.1",
        "-1=0.1", "nan=1", "1=nan", "1=inf", "inf=1", "1;2",
    )),
    *(("synth", ("--set", f"initial={text}"), f"{STATE}{text!r}") for text in (
        "", "0,0,0", "0,0,0,0,0", "a,0,0,0", "0,0,0,nan", "inf,0,0,0", "inf,-inf,0,0",
        "0;0;0;0",
    )),
    ("synth", ("--torque", "loud"), ("--torque loud: expected case, wide, none or a log, found "
                                    "neither")),
    ("synth", ("--torque", ""), "--torque : expected case, wide, none or a log, found neither"),
    ("synth", ("--motion", "x", "--torque", "wide"), f"--torque wide{BESIDE}"),
    ("synth", ("--motion", "x", "--set", "initial=0,0,0,0"), f"--set initial 0,0,0,0{BESIDE}"),
    ("synth", ("--motion", "x", "--payload-schedule", "1=1"), f"--payload-schedule 1=1{BESIDE}"),
    (
        "synth",
        ("--rate", "2", "--duration", "0.1"),
        "--duration: expected at least 0.5 s, two samples at --rate 2, found 0.1",
    ),
    ("design", ("--range", "near"), f"{RANGE}'near'"),
    ("design", (*NOISE, "--range", "1:0,0:1"), ("--range: expected LOW:HIGH with LOW below HIGH "
                                               "for joint 1, found 1:0")),
    ("design", ("--speed", "0"), "--speed: expected rad/s like 3 or 3,4, found '0'"),
    ("design", ("--speed", "1,2,3"), "--speed: expected rad/s like 3 or 3,4, found '1,2,3'"),
    ("design", ("--set", "acceleration=1:2"), ("--set acceleration: expected rad/s² like 30 or "
                                          "30,60, found '1:2'")),
    ("design", ("--torque", "-1"), "--torque: expected N m like 5 or 5,2, found '-1'"),
    ("design", ("--runs", "2"), f"{RUNS}'2'"),
    ("design", ("--runs", "0,0"), f"{RUNS}'0,0'"),
    ("design", ("--joints", "a,"), "--joints: expected two names like shoulder,elbow, found 'a,'"),
    ("design", ("--joints", "a"), "--joints: expected two names like shoulder,elbow, found 'a'"),
    ("design", (), ("--position-noise: case1 does not tell how noisy the sensors are; give it, or "
                   "--set noise_from=LOG")),
    (
        "design",
        ("--position-noise", "1e-3"),
        ("--torque-noise: case1 does not tell how noisy the sensors are; give it, or --set "
        "noise_from=LOG"),
    ),
    (
        "design",
        (*NOISE, "--for", "k9"),
        ("--for k9: expected some of k1, k2, k3, k4, k5, k6, k7, m_p, l1, l2, found 'k9'; leave it "
        "out"),
    ),
    (
        "design",
        (*NOISE, "--set", "tip_height=1"),
        "--set tip_height: expected less than the arm's reach, 0.2858 m, found 1 m",
    ),
    ("design", ("--limits", "absent.toml"), ("absent.toml: cannot read it (No such file or "
                                            "directory); check the name")),
    ("batch", ("--memory-limit", "1"), ("--memory-limit: expected at least 512MiB, like 2GB, found "
                                       "'1'")),
    (
        "batch",
        ("--scheduler", "tcp://h:1", "--workers", "2"),
        "--scheduler: workers and their memory are the cluster's; set them where it is started",
    ),
    ("batch", ("-o", ""), "-o: expected a folder or a URL, found none; name where results go"),
    ("identify", ("--name", ""), NAME),
    *(("identify", ("--name", text), PLAIN.format(text)) for text in ("../../evil", "..")),
    (
        "export",
        ("--flange", "0.1,0"),
        "--flange: urdf holds no flange; leave it out",
    ),
    (
        "identify",
        ("--export", "mcap", "--no-report"),
        "--export: the log is made from the time series; leave --no-report out",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("command", "flags", "line"), OWN)
def test_what_a_command_cannot_do_is_one_line(
    command: str, flags: tuple[str, ...], line: str
) -> None:
    assert refused(command, *flags) == line


def test_no_option_of_text_is_left_untried() -> None:
    tried = {flag for flag, *_ in (*OF_A_LOG, *OF_SETTINGS)} | {
        flag for _, flags, _ in OWN for flag in flags[::2]
    }
    for param in options(str, list):
        _, option = param.values
        assert option.opts[-1] in tried or option.name in UNCHECKED | {"loaded"}, param.id
    assert {option.values[1].name for option in options(str)} >= FREE - {"sources", "end"}


@pytest.mark.parametrize("command", [*CALLS])
def test_a_flag_that_there_is_not_and_a_call_without_its_arguments(command: str) -> None:
    assert refused(command, "--no-such-flag").startswith("No such option: --no-such-flag")
    if CALLS[command]:
        done = call(*command.split())
        assert done.code == 2
        assert done.err.startswith(("algid: Missing argument", "algid: Missing option")), done.err


def test_every_command_is_called() -> None:
    assert {name for name, _ in commands()} == set(CALLS)
