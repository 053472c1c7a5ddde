"""Every command as it is derived from its verb: help, completion, one line for a wrong value."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import pytest
from pydantic import TypeAdapter

import algid
from algid.api.guide import TOPICS, text_of
from algid.api.options import LogOptions, Options, options_of
from algid.base.errors import AlgidError, Exit, SettingError, epilog
from algid.cli.app import COMMANDS, Command, command, listed
from algid.methods import ESTIMATORS
from algid.options import BY_SET, MOVED
from algid.profile import Profile
from algid.settings import Settings
from tests.cli.commands import call

ROOT = Path(algid.__file__).parents[1]
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
DERIVED = {name: command(name) for name in COMMANDS}


@pytest.fixture(autouse=True)
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder of its own, in which nothing may be left."""
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("t,theta1\n")
    yield
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def refused(name: str, *flags: str) -> str:
    """The one line that a wrong flag gets."""
    done = call(name, *CALLS[name], *flags)
    assert (done.code, done.out) == (2, ""), (name, flags, done)
    assert done.err.count("\n") == 1, done.err
    return done.err.removeprefix("algid: ").rstrip("\n")


def options() -> Iterator[Any]:
    """Every option that does not take whatever is typed, with values that it does not take."""
    for name, one in DERIVED.items():
        for option in one.params:
            taken = one.taken[option.name or ""]
            wrong: list[str] = []
            if isinstance(option.type, click.types.FloatParamType | click.types.IntParamType):
                wrong = ["much", "", "nan", "-inf"]
                if taken.check is not None:
                    schema = TypeAdapter(taken.check).json_schema()
                    bounds = schema.get("anyOf", [schema])[0]
                    low, high = bounds.get("minimum", 0.0), bounds.get("maximum", math.inf)
                    wrong += [f"{low - 1e-3:.17g}", f"{1.001 * high:.17g}"]
                if isinstance(option.type, click.types.IntParamType):
                    wrong += ["1.5", "-1"]
            elif option.metavar == "WORD":
                wrong = ["nothing", "?"]
            if wrong and isinstance(option, click.Option):
                yield pytest.param(name, option.opts[-1], wrong, id=f"{name} {option.opts[-1]}")


@pytest.mark.parametrize(("name", "flag", "wrong"), [*options()])
def test_a_wrong_value_is_one_line_that_names_its_flag(
    name: str, flag: str, wrong: list[str]
) -> None:
    for text in wrong:
        line = refused(name, f"{flag}={text}")
        assert line.startswith((f"{flag}: ", f"Invalid value for '{flag}'"))


NOISE = ("--position-noise", "1e-3", "--torque-noise", "1e-2")
OF_LOGS = (
    *(f"--joints={text}" for text in ("one", "a,b,c", "a,")),
    *(f"--angle-unit={text}" for text in ("mile", "N m")),
    "--torque-unit=N",
    *(f"--zero={text}" for text in ("sideways", "")),
    "--second-angle=x",
    *(f"--start={text}" for text in ("x", "-1", "nan")),
    *(f"--end={text}" for text in ("0", "1e400")),
    "--rate=0",
    "--accept=FOO",
    *(f"--set={line}" for line in ("zero", "tau1.sign=2", "tau1.colour=red", "drive=x")),
    *(f"--set={line}" for line in ("passive=3", "clock=x", "segment=0", "segment=x")),
)
OF_SETTINGS = (
    *(f"--model={text}" for text in ("magic", "stribeck", "delay,lag", "")),
    *(f"--gravity={text}" for text in ("-9.81", "1e9")),
    *(f"--l1={text}" for text in ("0", "-1")),
    "--payload-mass=0",
    *(f"--set={line}" for line in ("delay=inf", "delay=soon", "poles=a,b", "poles=1,2,3")),
    *(f"--set={line}" for line in ("window=0", "window=x", "bandwidth=-1", "observer=best")),
)
OWN: dict[str, tuple[tuple[str, ...], ...]] = {
    "synth": (
        *((f"--set=start_time={text}",) for text in ("soon", "2026-02-30", "1969-01-01", "2300")),
        ("--payload-schedule=1;2",),
        ("--set=initial=1e9,0,0,0",),
        ("--torque=loud",),
        ("--duration=0.1", "--rate=2"),
        ("--duration=1e6", "--rate=1e6"),
    ),
    "design": (
        ("--range=near", *NOISE),
        ("--joints=a",),
        ("--for=k9", *NOISE),
        ("--set=tip_height=1", *NOISE),
    ),
    "batch": (
        *((f"--memory-limit={text}",) for text in ("", "GB", "2XB", "511MiB", "-2GB", "inf")),
        ("--scheduler=tcp://h:1", "--workers=2"),
        ("--scheduler=tcp://h:1", "--memory-limit=2GB"),
        *((f"--part={text}",) for text in ("0/2", "3/2", "x")),
        ("--part=1/2", "--watch"),
    ),
    "identify": (*((f"--name={text}",) for text in ("", "../../evil", "..")),),
    "export": (("--flange=0.1,0",), ("--flange=0,0,0",), ("--to=csv",)),
}


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        *((name, (flag,)) for name in READERS for flag in OF_LOGS),
        *((name, (flag,)) for name in ("identify", "batch") for flag in OF_SETTINGS),
        *((name, flags) for name, calls in OWN.items() for flags in calls),
    ],
    ids=str,
)
def test_text_that_means_nothing_is_one_line_that_names_its_flag(
    name: str, flags: tuple[str, ...]
) -> None:
    flag, _, text = flags[0].partition("=")
    line = refused(name, *flags)
    named = f"--set {text.partition('=')[0]}" if flag == "--set" else flag
    by_type = f"Invalid value for '{flag}'"
    assert line.startswith((f"{named}:", f"{named} ", by_type)), line


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        ("identify", ("--profile=absent.toml",)),
        ("design", ("--limits=absent.toml",)),
        ("identify", ("--export=mcap", "--no-report")),
        ("identify", ("--effort=external", "--gravity=9.7")),
        ("batch", ("-o", "")),
        ("report", ("-o", "pages")),
        ("design", ()),
    ],
)
def test_a_call_that_contradicts_itself_or_lacks_something_is_one_line(
    name: str, flags: tuple[str, ...]
) -> None:
    assert refused(name, *flags)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_flag_that_there_is_not_and_a_call_without_its_arguments(name: str) -> None:
    assert refused(name, "--no-such-flag").startswith("No such option")
    if CALLS[name]:
        done = call(name)
        assert done.code == 2
        missing = ("algid: Missing argument", "algid: Missing option", "algid: identify: expected")
        assert done.err.startswith(missing), done.err


@pytest.mark.parametrize("old", [*MOVED, *(f"--set {name}" for name in sorted(BY_SET))])
def test_a_name_of_an_earlier_version_is_one_line_that_says_what_to_do(old: str) -> None:
    """A command, a flag, a format, or a keyword of Python."""
    verb, _, keyword = old.partition("(")
    if keyword:
        with pytest.raises(AlgidError) as error:
            getattr(algid, verb)("case1", **{keyword.removesuffix("=…)"): "x"})
        assert str(error.value) == f"{old} is not in this version; instead: {MOVED[old]}"
        return
    now = MOVED.get(old)
    if old.startswith("--set "):
        old, now = f"--{old[6:].replace('_', '-')}", f"{old}=VALUE"
    words = old.removeprefix("algid ").replace("=", " ").split()
    done = call(*(["report", "x.algid", *words] if old.startswith("--") else words))
    assert (done.code, done.out) == (2, "")
    assert done.err == f"algid: {old} is not in this version; instead: {now}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_every_keyword_the_example_and_the_exit_codes(name: str) -> None:
    shown = call(name, "--help").out
    words = " ".join(shown.split())
    verb: Callable[..., Any] = getattr(import_module(f"algid.api.{name}"), COMMANDS[name])
    for one in options_of(verb).values():
        assert re.fullmatch(r".{4,}[.…]", one.help) or "." in one.name, one.name
        assert one.help in words or one.by_set, one.name
        if not (one.by_set and "Any other setting" in shown):
            assert one.name.upper().removesuffix("S") in shown or one.flag[6:] in shown, one.name
    assert max(map(len, shown.splitlines())) <= 80
    assert f"Example: algid {name} " in words
    assert " ".join(epilog(name).split()) in words
    assert listed(name) in words
    assert listed(name) in " ".join(call("--help").out.split())


def test_identify_shows_ten_everyday_options_and_a_line_each() -> None:
    lines = call("identify", "--help").out.splitlines()
    assert lines[0] == "Usage: algid identify [OPTIONS] UNLOADED..."
    assert len(lines) <= 90
    everyday = lines[lines.index("Options:") + 1 : lines.index("Advanced:") - 1]
    advanced = lines[lines.index("Advanced:") + 1 :]
    assert len(everyday) == 10
    assert all(re.match(r"  -", line) for line in everyday + advanced[: advanced.index("")])
    bare = call()
    assert (bare.code, bare.out) == (2, call("--help").out)


def test_a_type_checker_knows_every_setting() -> None:
    known = set(Profile.model_fields)
    assert set(LogOptions.__annotations__) == known - {"prior", "prior_error"}
    assert set(Options.__annotations__) == known | set(Settings.model_fields)


def completed(one: Command, name: str, begun: str) -> list[str]:
    option = next(param for param in one.params if param.name == name)
    context = click.Context(one)
    return [item.value for item in option.shell_complete(context, begun) if item.type != "file"]


@pytest.mark.parametrize(
    ("name", "option", "begun", "expected"),
    [
        ("identify", "angle_unit", "", ["rad", "mrad", "deg", "rev", "counts"]),
        ("inspect", "torque_unit", "m", ["mN m", "mA"]),
        ("batch", "zero", "h", ["horizontal", "hanging"]),
        ("identify", "set", "tau1.s", ["tau1.source=", "tau1.sign=1", "tau1.sign=-1"]),
        ("identify", "set", "velocity=m", ["velocity=measured"]),
        ("identify", "set", "obs", ["observer=luenberger", "observer=zero-phase"]),
        ("synth", "set", "jit", ["jitter="]),
        ("track", "accept", "DEGREES,EFFORT_Z", ["DEGREES,EFFORT_ZERO"]),
        ("identify", "accept", "DEGREES,DEG", []),
        ("identify", "model", "coulomb,ro", ["coulomb,rotor"]),
        ("identify", "estimator", "re", ["refined"]),
        ("export", "to", "m", ["mjcf"]),
        ("validate", "format", "", ["table", "json"]),
        ("synth", "case", "cas", ["case1", "case2"]),
        ("guide", "topic", "pay", ["payload"]),
    ],
)
def test_words_complete(name: str, option: str, begun: str, expected: list[str]) -> None:
    assert completed(DERIVED[name], option, begun) == expected


def test_tables_of_the_guide_and_the_readme_are_those_of_the_code() -> None:
    for code in Exit:
        line = f"| {int(code)} | {code.meaning} | {code.then} |\n"
        assert line in text_of("batch")
        assert line in (ROOT / "README.md").read_text(encoding="utf-8")
    for one in ESTIMATORS:
        assert f"| {one.does} | {one.when} |\n" in text_of("estimators")
    for old, new in MOVED.items():
        assert f"| `{old}` | {new} |" in text_of("start")
    assert call("guide", "estimators").out == text_of("estimators")
    assert "one of start, arm, lab" in call("guide", "nothing").err
    assert call("guide", "uneven_stamps").out.startswith("# UNEVEN_STAMPS\n")
    contents = call("guide").out
    for topic in TOPICS:
        assert f"algid guide {topic}" in contents
        assert text_of(topic).partition("\n")[0].removeprefix("# ") in contents


@pytest.mark.parametrize(
    ("ask", "named"),
    [
        (lambda: algid.inspect({}, estimator="weak"), "estimator"),  # type: ignore[call-arg]
        (
            lambda: algid.identify({}, windows=2.0),  # type: ignore[call-arg]
            "windows: no setting has this name; expected window$",
        ),
        (lambda: algid.validate("none", {}, max_nrmse=-1), "--max-nrmse"),
        (lambda: algid.export("none", "c", m1=float("nan")), "--set m1"),
        (lambda: algid.compare("none"), "compare"),
        (lambda: algid.compare("a", "b", labels=["c"]), "labels: expected 2, found 1"),
        (lambda: algid.inspect({}, write_profile="a.toml"), "--write-profile"),
        (lambda: algid.batch([], "out"), "batch: expected logs"),
        (lambda: algid.synthesise("example", rate=100.0), "--rate: the example is always"),
        (lambda: algid.design("case1", margin=0.9), "--set margin"),
    ],
)
def test_a_keyword_is_refused_as_its_flag_is(ask: Callable[[], object], named: str) -> None:
    with pytest.raises(SettingError, match=f"^{named}"):
        ask()
