"""Entries added and left out in a copy of the package: everything that names them follows by
itself.

A term, a unit, a format, a check with its notice, and an estimator are added, three terms left out.
Options of how to identify and of a log's meaning are added: an entry, and the field that holds its
type and default.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import algid

TOY = '''"""Cogging of joint 2: a torque that repeats six times a turn."""

import numpy as np

from algid.physics.parameters import MOMENT, Parameter
from algid.physics.signals import NOTHING, Q2, function
from algid.physics.terms.base import Term, TorqueColumn

SINE = function("toy_s", np.sin, 6 * Q2, lambda: COSINE)
COSINE = function("toy_c", np.cos, 6 * Q2, lambda: -SINE)
TOY = Term(
    name="toy",
    title="cogging of joint 2",
    equation="g6 sin(6 θ_2) (joint 2)",
    parameters=(Parameter("g6", "g6", "N m", "cogging moment of joint 2", MOMENT),),
    columns=(TorqueColumn("g6", f=(NOTHING, SINE)),),
)
'''
READER = '''"""Logs that begin with a line TOYLOG: a table of text."""

from dataclasses import replace

import polars as pl

from algid.readers.memory import open_columns


def opened(path):
    table = open_columns(pl.read_csv(path, skip_rows=1))
    return replace(table, kind="toy")
'''
FORMAT = """    FileFormat("toy", "Toy log", (".toy",), b"TOYLOG"),
"""
OPENED = """        case "toy":
            from algid.readers.toy import opened

            return opened(path)
"""
CHECK = '''"""A check that always finds something."""

from algid.notices import Notice, Remedy


def toys(log):
    yield Notice(
        "TOY_SEEN", numbers={"count": len(log)}, remedies=(Remedy({"zero": "hanging"}),)
    )
'''
ESTIMATOR = '''"""The weak form under another name."""

from dataclasses import replace

from algid.estimators import weak


def fit(problem):
    return replace(weak.fit(problem), estimator="toy")
'''
ENTRY = """    Estimator(
        "toy",
        "the toy's form",
        "what the weak form does",
        "in tests",
        lambda problem: import_module("algid.estimators.toy").fit(problem),
    ),
"""
TRIAL = """
import numpy as np
from click.testing import CliRunner
import algid
from algid.model import CHOICES
from algid.api.guide import text_of
from algid.base.errors import SettingError
from algid.exports.formats import exported
from algid.identification.identify import identify
from algid.model import Model, Motion, torque
from algid.profile import Profile
from algid.settings import Settings

here = algid.__file__
listed = CHOICES
assert "toy" in listed and not {"stribeck", "gain", "asymmetry"} & set(listed), listed
guide = text_of("estimators")
assert "| `toy` |" in guide and "cogging" in guide, guide
for left_out in ("stribeck", "gain", "asymmetry"):
    assert f"| `{left_out}` |" not in guide
try:
    Settings(model="stribeck,coulomb")
except SettingError as error:
    assert "toy" in str(error) and "gain" not in str(error), error
else:
    raise AssertionError("stribeck was taken")

from dataclasses import replace
from algid.synth.cases import load_case
case = load_case("case1")
unloaded, _ = algid.synthesise("case1", duration=4.0, rate=500.0, torque="wide")
rng = np.random.default_rng(0)
tau = unloaded.tau + rng.normal(0, 1e-3, unloaded.tau.shape)
tau[1] += 0.05 * np.sin(6 * unloaded.theta[1])
log = replace(unloaded, tau=tau, theta=unloaded.theta + rng.normal(0, 1e-5, tau.shape), omega=None)
log = replace(log, origin=replace(log.origin, truth=None))
result = identify(log)
kept = [one.term for one in result.fit.terms if one.kept]
assert "toy" in kept, result.fit.terms
assert not {"stribeck", "gain", "asymmetry"} & {one.term for one in result.fit.terms}
assert abs(result.parameters["g6"].estimate - 0.05) < 5 * result.parameters["g6"].std < 0.005
for to in ("python", "c"):
    text, _ = exported(result, "toy.algid", to, {})
    assert "G6 * toy_s" in text and "sin(6 * q2)" in text, text
module = {}
exec(compile(exported(result, "toy.algid", "python", {})[0], "arm.py", "exec"), module)
speed = result.fit.model.coulomb_speed
model = Model(tuple(result.fit.model.terms), 9.81, coulomb_speed=speed)
c = np.array([result.parameters[name].estimate for name in model.names])
one = np.array([[0.3], [0.4]])
ours = torque(model, c, Motion(one, one, one))[:, 0]
written = module["inverse_dynamics"]([0.3, 0.4], [0.3, 0.4], [0.3, 0.4])
np.testing.assert_allclose(written, ours, rtol=1e-12)

# the command line
from pathlib import Path
from algid.cli.app import app
def called(*words):
    return CliRunner().invoke(app, [*map(str, words)])
shown = " ".join(called("identify", "--help").stdout.replace("│", " ").split())
assert "toy" in shown.split("--estimator")[1][:60], shown
for page, row in (
    ("logs", "| Toy log | `.toy` |"),
    ("logs", "| `N mm` | torque |"),
    ("estimators", "| `toy` | what the weak form does | in tests |"),
):
    assert row in text_of(page), row

# a log in the added format, its torques in the added unit, identified by the added estimator
table = np.column_stack([log.t, *log.theta, *(1e3 * log.tau)])[::4]
head = "t,theta1,theta2,tau1 [N mm],tau2 [N mm]"
toy = Path("arm.toy")
rows = [",".join(map(repr, map(float, row))) for row in table]
toy.write_text("\\n".join(["TOYLOG", head, *rows, ""]))
from algid.batches.discover import jobs_of
assert [job.name for job in jobs_of([str(toy.parent.absolute())], "results")] == ["arm"]
from algid.cli.app import command
unit = next(one for one in command("inspect").params if one.name == "torque_unit")
assert [one.value for one in unit.shell_complete(None, "N m")] == ["N m", "N mm"]
assert called("convert", toy, "-o", "arm.csv").exit_code == 0
assert abs(np.loadtxt("arm.csv", delimiter=",", skiprows=1)[0, 3] - log.tau[0, 0]) < 1e-12
seen = called("inspect", toy, "--set", 'tau1.unit="N mm"').stdout
assert "toy" in seen and f"{len(table):d} toys" in seen and "--zero hanging" in seen, seen
done = called("identify", toy, "--estimator", "toy", "--model", "plain", "--no-report")
assert done.exit_code == 0, done.output
found = algid.read_result("arm.algid")
codes = [notice.code for notice in found.notices]
assert found.estimator == "toy" and codes.count("TOY_SEEN") == 1, found.notices
print("all follow", here)
"""


OPTION_TRIAL = """
import json
from pathlib import Path
from click.testing import CliRunner
import algid
from algid.api.guide import text_of
from algid.cli.app import app
from algid.cli.app import command as derived
from algid.notices import Remedy

def called(*words):
    done = CliRunner().invoke(app, [*map(str, words)])
    return done.exit_code, " ".join(done.stdout.replace("│", " ").split()), done.exception
def option(command, name):
    return next(one for one in derived(command).params if one.name == name)

# help, and completion, of every verb that takes it
for command in ("identify", "batch"):
    shown = called(command, "--help")[1]
    assert "--toy-level" in shown and "How much the toy plays." in shown, shown
for command in ("identify", "batch", "inspect", "convert", "validate", "track"):
    shown = called(command, "--help")[1]
    assert "--toy-side" in shown and "Where the toy stands." in shown, shown
    side = option(command, "toy_side")
    assert [word.value for word in side.shell_complete(None, "r")] == ["right"]
others = {one.name for one in derived("compare").params}
assert others and not {"toy_level", "toy_side"} & others
# guide
assert "| `--toy-level` | How much the toy plays. |" in text_of("python")
assert "| `--toy-side` | Where the toy stands. |" in text_of("python")
# messages and remedies
assert Remedy({"toy_side": "right"}).flags == ("--toy-side", "right")
assert Remedy({"toy_level": 2.0}).flags == ("--toy-level", "2.0")
# Python: keywords, and what is refused
log = algid.synthesise("case1", duration=2.0, rate=500.0, torque="wide")[0]
algid.write_log(Path("arm.csv"), log)
done = algid.identify(
    "arm.csv", estimator="weak", model="plain", toy_level=2.0, toy_side="right"
)
assert done.settings["toy_level"] == 2.0 and done.profile == {"toy_side": "right"}
for wrong, message in (
    ({"toy_level": 9.0}, "--toy-level: expected less than or equal to 5, found 9.0"),
    ({"toy_side": "up"}, "--toy-side: expected 'left' or 'right', found 'up'"),
    ({"toy_sidee": "up"}, "no setting has this name; expected toy_side"),
):
    try:
        algid.identify("arm.csv", **wrong)
    except algid.AlgidError as error:
        assert message in str(error), error
    else:
        raise AssertionError(wrong)
# a file of a profile, the command line, and the flag over the file
Path("algid.toml").write_text('toy_side = "right"\\n')
plain = ("identify", "arm.csv", "--estimator", "weak", "--model", "plain", "--no-report", "--force")
plain += ("--profile", "algid.toml")
for words, level, side in (
    ((), 1.0, "right"),
    (("--toy-level", "0.5", "--toy-side", "left"), 0.5, "left"),
):
    status, _, error = called(*plain, *words)
    assert status in (0, 3), error
    made = json.loads(Path("arm.algid/result.json").read_text())
    assert made["settings"]["toy_level"] == level and made["profile"]["toy_side"] == side
status, _, error = called(*plain, "--toy-side", "up")
assert status and "--toy-side: " in str(error), (status, error)
print("all follow", algid.__file__)
"""


def inserted(path: Path, before: str, text: str) -> None:
    """Put `text` before the one place where `before` stands."""
    content = path.read_text(encoding="utf-8")
    assert content.count(before) == 1, (path, before)
    path.write_text(content.replace(before, text + before), encoding="utf-8")


def add_toys(package: Path) -> None:
    """An entry in each registry but that of terms: a module, and a line or an entry."""
    inserted(
        package / "base" / "units.py",
        '    Unit("N cm"',
        '    Unit("N mm", ("torque",), 1e-3, "nmm n-mm"),\n',
    )
    (package / "readers" / "toy.py").write_text(READER)
    formats = package / "readers" / "formats.py"
    inserted(formats, '    FileFormat("rosbag2"', FORMAT)
    inserted(formats, '        case "mcap" | "rosbag2" | "db3" | "bag":', OPENED)
    (package / "inspection" / "toy.py").write_text(CHECK)
    checks = package / "inspection" / "checks.py"
    inserted(checks, "        *rests(log, whole),\n", "        *toys(log),\n")
    inserted(checks, "from algid.log import", "from algid.inspection.toy import toys\n")
    inserted(
        package / "messages.toml",
        "[DATA_LOST]\n",
        '[TOY_SEEN]\ncause = "A toy."\ntext = "{count:# toy|# toys} seen"\n\n',
    )
    (package / "estimators" / "toy.py").write_text(ESTIMATOR)
    methods = package / "methods.py"
    inserted(methods, '    Estimator(\n        "paper"', ENTRY)
    inserted(methods, "from typing import TYPE", "from importlib import import_module\n")


def add_options(package: Path) -> None:
    """A field of how to identify and one of what a log means, with the types of their keywords."""
    options = package / "api" / "options.py"
    inserted(options, "    passive: Literal[1, 2]", '    toy_side: Literal["left", "right"]\n')
    inserted(options, "    cross_validate: bool", "    toy_level: float\n")
    inserted(
        package / "settings.py",
        "    constrain: bool = False",
        "    toy_level: float = within((0.0, 5.0), 1.0)\n",
    )
    inserted(
        package / "settings.py",
        "    constrain : bool\n",
        "    toy_level : float\n        How much the toy plays.\n",
    )
    inserted(
        package / "profile.py",
        '    drive: Literal["joint", "base"]',
        '    toy_side: Literal["left", "right"] = "left"\n',
    )
    inserted(
        package / "profile.py",
        "    drive : str\n",
        "    toy_side : str\n        Where the toy stands.\n",
    )


def copied(folder: Path) -> Path:
    """A copy of the package in `folder`."""
    return Path(
        shutil.copytree(
            Path(algid.__file__).parent,
            folder / "algid",
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    )


def all_follow(package: Path, trial: str) -> None:
    """Run `trial` against a copy of the package, whose warnings are errors."""
    place = package.parent
    environment = {**os.environ, "PYTHONPATH": str(place), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", trial],
        env=environment,
        cwd=place,
        capture_output=True,
        text=True,
    )
    assert f"all follow {package}" in done.stdout, done.stdout + done.stderr


@pytest.mark.slow
def test_an_option_added_shows_wherever_options_are_named(tmp_path: Path) -> None:
    package = copied(tmp_path)
    add_options(package)
    all_follow(package, OPTION_TRIAL)


@pytest.mark.slow
def test_entries_added_and_left_out_need_nothing_else_touched(tmp_path: Path) -> None:
    package = copied(tmp_path)
    folder = package / "physics" / "terms"
    (folder / "toy.py").write_text(TOY)
    registry = folder / "__init__.py"
    text = registry.read_text()
    for name in ("stribeck", "gain", "asymmetry"):
        (folder / f"{name}.py").unlink()
        text = text.replace(f"from algid.physics.terms.{name} import {name.upper()}\n", "")
        assert f"    {name.upper()},\n" in text
        text = text.replace(f"    {name.upper()},\n", "")
    text = text.replace(
        "from algid.physics.terms.viscous",
        "from algid.physics.terms.toy import TOY\nfrom algid.physics.terms.viscous",
    )
    registry.write_text(text.replace("    COULOMB,\n", "    COULOMB,\n    TOY,\n"))
    add_toys(package)
    all_follow(package, TRIAL)
