"""A term added, and terms left out, in a copy of the package: everything that names terms follows by itself."""

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

from algid.physics.expressions import NOTHING, Atom, Expression
from algid.physics.parameters import MOMENT, Parameter
from algid.physics.terms.base import Term, TorqueColumn

SINE = Atom("toy_s", lambda motion, _: np.sin(6 * motion.theta[1]), "sin(6 * q2)",
            lambda: {"theta2": Expression({(COSINE,): 6.0})})
COSINE = Atom("toy_c", lambda motion, _: np.cos(6 * motion.theta[1]), "cos(6 * q2)",
              lambda: {"theta2": Expression({(SINE,): -6.0})})
TOY = Term(
    name="toy",
    title="cogging of joint 2",
    equation="g6 sin(6 θ_2) (joint 2)",
    parameters=(Parameter("g6", "g6", "N m", "cogging moment of joint 2", MOMENT),),
    columns=(TorqueColumn("g6", f=(NOTHING, Expression({(SINE,): 1.0}))),),
)
'''
TRIAL = """
import subprocess, sys
import numpy as np
from typer.testing import CliRunner
import algid
from algid.cli.completion import terms
from algid.cli.guide import text_of
from algid.errors import SettingError
from algid.exports.formats import exported
from algid.exports.links import Knowns
from algid.identification.identify import identify
from algid.model import Model, Motion, torque
from algid.profile import Profile
from algid.settings import Settings

here = algid.__file__
listed = terms()
assert "toy" in listed and not {"stribeck", "gain", "delay"} & set(listed), listed
guide = text_of("estimators")
assert "| `toy` |" in guide and "cogging" in guide, guide
assert "| `stribeck` |" not in guide and "| `gain` |" not in guide and "| `delay` |" not in guide
try:
    Settings(model="stribeck,coulomb")
except SettingError as error:
    assert "toy" in str(error) and "gain" not in str(error), error
else:
    raise AssertionError("stribeck was taken")

from dataclasses import replace
from algid.synth.cases import load_case
case = load_case("case1")
unloaded, _ = algid.synthesise("case1", duration=4.0, rate=500.0, excitation="wide")
rng = np.random.default_rng(0)
tau = unloaded.tau + rng.normal(0, 1e-3, unloaded.tau.shape)
tau[1] += 0.05 * np.sin(6 * unloaded.theta[1])
log = replace(unloaded, tau=tau, theta=unloaded.theta + rng.normal(0, 1e-5, tau.shape), omega=None)
log = replace(log, origin=replace(log.origin, truth=None))
result = identify(log)
kept = [one.term for one in result.fit.terms if one.kept]
assert "toy" in kept, result.fit.terms
assert not {"stribeck", "gain", "delay"} & {one.term for one in result.fit.terms}
assert abs(result.parameters["g6"].estimate - 0.05) < 5 * result.parameters["g6"].std < 0.005
for to in ("python", "c"):
    text, _ = exported(result, "toy.algid", to, Knowns())
    assert "G6 * toy_s" in text and "sin(6 * q2)" in text, text
module = {}
exec(compile(exported(result, "toy.algid", "python", Knowns())[0], "arm.py", "exec"), module)
model = Model(tuple(result.fit.model.terms), 9.81, result.fit.model.coulomb_speed)
c = np.array([result.parameters[name].estimate for name in model.names])
one = np.array([[0.3], [0.4]])
ours = torque(model, c, Motion(one, one, one))[:, 0]
np.testing.assert_allclose(module["inverse_dynamics"]([0.3, 0.4], [0.3, 0.4], [0.3, 0.4]), ours, rtol=1e-12)
print("all follow", here)
"""


@pytest.mark.slow
def test_terms_added_and_left_out_need_nothing_else_touched(tmp_path: Path) -> None:
    package = tmp_path / "algid"
    shutil.copytree(
        Path(algid.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    folder = package / "physics" / "terms"
    (folder / "toy.py").write_text(TOY)
    registry = folder / "__init__.py"
    text = registry.read_text()
    for name in ("stribeck", "gain", "delay"):
        (folder / f"{name}.py").unlink()
        text = text.replace(f"from algid.physics.terms.{name} import {name.upper()}\n", "")
        text = text.replace(f"{name.upper()}, ", "").replace(f", {name.upper()}", "")
    text = text.replace(
        "from algid.physics.terms.viscous",
        "from algid.physics.terms.toy import TOY\nfrom algid.physics.terms.viscous",
    )
    registry.write_text(text.replace("(COULOMB, ", "(COULOMB, TOY, "))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", TRIAL],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert f"all follow {package}" in done.stdout, done.stdout + done.stderr
