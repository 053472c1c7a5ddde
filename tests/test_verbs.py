"""The verbs: each command is a thin skin over one, with its settings as keywords, and each example
runs.
"""

from __future__ import annotations

import ast
import doctest
import inspect
import os
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import algid
from algid.api.options import LogOptions, Options
from algid.api.signature import keywords
from algid.base.errors import ResultError, SettingError
from algid.cli.derive import COMMANDS, listed
from algid.options import flag
from algid.profile import CHANNELS_OF, Profile
from algid.settings import Settings
from algid.synth.sensors import Sensors
from tests.cli.commands import call
from tests.test_layers import sources


def verb_of(command: str) -> Callable[..., Any]:
    """The function behind a command."""
    found: Callable[..., Any] = getattr(import_module(f"algid.api.{command}"), COMMANDS[command])
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_every_keyword_of_a_verb_is_told_and_typed(command: str) -> None:
    for name, one in keywords(verb_of(command)).items():
        assert one.help.endswith((".", "…")), (command, name)
        assert one.kind is not Any
    shown = call(command, "--help").out
    for name, one in keywords(verb_of(command)).items():
        if one.place is inspect.Parameter.KEYWORD_ONLY:
            typed = flag(name, off=True) if one.default is True else flag(name)
            assert (one.option.flags or (typed,))[-1].removeprefix("--set ") in shown
    assert listed(command) in " ".join(shown.split())


def test_a_type_checker_knows_every_setting() -> None:
    known = set(Profile.model_fields) | set(CHANNELS_OF)
    assert set(LogOptions.__annotations__) == known
    assert set(Options.__annotations__) == known | set(Settings.model_fields)


def test_identify_shows_ten_everyday_options_and_a_line_each() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "algid", "identify", "--help"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"COLUMNS": "80"},
    )
    lines = done.stdout.splitlines()
    assert len(lines) <= 90
    assert max(map(len, lines)) <= 80
    everyday = lines[lines.index("Options:") + 1 : lines.index("Advanced:") - 1]
    assert len(everyday) == 10
    assert lines.index("Advanced:") <= 40
    advanced = lines[lines.index("Advanced:") + 1 :]
    advanced = advanced[: advanced.index("")]
    assert all(re.match(r"  -", line) for line in everyday + advanced)


COMPUTING = {"numpy", "polars", "scipy", "pyarrow", "pydantic"}
"""Packages that work with numbers."""


def test_no_command_computes() -> None:
    for module, text in sources().items():
        if module.startswith("algid.cli."):
            tree = ast.parse(text)
            names = {
                alias.name.partition(".")[0]
                for node in ast.walk(tree)
                if isinstance(node, ast.Import)
                for alias in node.names
            }
            assert names.isdisjoint(COMPUTING), module


EXAMPLES = sorted({home.partition(":")[0] for home in algid._HOMES.values()})


@pytest.mark.parametrize("home", EXAMPLES)
def test_examples_run_and_give_what_they_say(home: str) -> None:
    module = import_module(home)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        found = doctest.testmod(module)
    assert found.failed == 0


def test_every_public_function_has_an_example() -> None:
    functions = [name for name in algid.__all__ if inspect.isfunction(getattr(algid, name))]
    methods = [algid.Result.predict, algid.Result.plot, algid.Log.from_arrays]
    for thing in (*(getattr(algid, name) for name in functions), *methods):
        assert "\n>>> " in (inspect.getdoc(thing) or ""), thing


@pytest.fixture(scope="module")
def logs() -> tuple[algid.Log, algid.Log]:
    return algid.synthesise(
        "case1", duration=6.0, rate=500.0, excitation="wide", sensors=Sensors(1e-4, 1e-2)
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
    assert seen.signals is not None
    assert plain is not None
    assert seen.signals["tau1"].high == pytest.approx(plain["tau1"].high)
    assert [one.name for one in seen.entries] == ["t", "q[0]", "q[1]", "tau[0]", "tau[1]"]
    judged = algid.validate(weighed, frame, **units).total
    own = algid.validate(weighed, log).total
    assert judged is not None
    assert own is not None
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
    assert low is not None
    assert high is not None
    half = 50 * (high - low) / abs(weighed.parameters["k1"].estimate or 1.0)
    assert bars.error_x.array[bars.y.index("k1")] == pytest.approx(half)


def test_what_is_written_is_what_the_command_writes(
    logs: tuple[algid.Log, algid.Log], weighed: algid.Result, tmp_path: Path
) -> None:
    page = tmp_path / "compare.html"
    algid.compare([weighed, weighed], labels=["a", "b"], out=tmp_path)
    assert page.is_file()
    with pytest.raises(algid.AlgidError, match=r"compare\.html"):
        algid.compare([weighed, weighed], out=tmp_path)
    made = algid.export(weighed, "c", l1=0.2, out=tmp_path / "arm.c")
    assert (tmp_path / "arm.c").read_text(encoding="utf-8") == made.text
    algid.track(logs[1], weighed, out=tmp_path)
    assert (tmp_path / "case1-loaded.track" / "track.json").is_file()


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: algid.inspect({}, estimator="weak"), "^estimator: no setting has this name"),  # type: ignore[call-arg]
        (
            lambda: algid.inspect({}, zero="down"),  # type: ignore[arg-type]
            r"^--zero \(profile: zero\): expected 'horizontal', 'hanging' or 'upright'",
        ),
        (lambda: algid.inspect({}, joints="one"), "^--joints: expected two names"),
        (lambda: algid.track({}, "none", l1=0.0), "^--l1: expected a number from 0.001 to 1000"),
        (lambda: algid.validate("none", {}, max_nrmse=-1), "^--max-nrmse: expected a number"),
        (
            lambda: algid.export("none", "step"),  # type: ignore[arg-type]
            "^--to: expected one of urdf, ",
        ),
        (lambda: algid.export("none", "c", m1=float("nan")), "^--set m1: expected a number from"),
        (lambda: algid.compare("none"), "^compare: expected two results or more, found 1"),
        (
            lambda: algid.design("case1", margin=0.9),
            "^--set margin: expected a number from 0 to 0.5",
        ),
        (
            lambda: algid.design("case1", speed=(1, 2, 3)),  # type: ignore[arg-type]
            "^--speed: expected rad/s like 3 or 3,4",
        ),
        (
            lambda: algid.synthesise("case1", drop=2.0),
            "^--set drop: expected a number from 0 to 0.9",
        ),
        (lambda: algid.synthesise("case1", excitation="x"), "^--torque x: expected case, wide"),
        (
            lambda: algid.synthesise("case1", kind="txt"),  # type: ignore[call-overload]
            "^--format: expected one of mcap,",
        ),
        (lambda: algid.batch("x", "y", timeout=0), "^--timeout: expected a number from 0.001"),
        (
            lambda: algid.batch("x", "y", estimator="best"),  # type: ignore[arg-type]
            "^--estimator: expected 'refined'",
        ),
    ],
)
def test_a_keyword_is_refused_as_its_flag_is(call: Callable[[], object], expected: str) -> None:
    with pytest.raises(SettingError, match=expected):
        call()
