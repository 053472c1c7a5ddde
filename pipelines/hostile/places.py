"""What hostile calls stand on: logs, results, a track, a design, a batch, and TOML files of every
kind, all sound.
"""

from __future__ import annotations

import io
import sys
import tomllib
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from algid.cli.app import run

CASE = Path(__file__).parents[2] / "data" / "cases" / "case1.toml"
_TEXTS = {
    "arm": CASE.read_text(encoding="utf-8"),
    "profile": """
joints = ["theta1", "theta2"]
time = "t"
time_unit = "s"
zero = "horizontal"
drive = "joint"
second_angle = "relative"
gravity = 9.81
velocity = "measured"
signs = [1, 1]
offsets = [0.0, 0.0]
start = 0.0
end = 10.0
accept = ["DEGREES"]
theta1 = {source = "theta1", unit = "rad", sign = 1, offset = 0.0, gear_ratio = 1.0, unwrap = false}
tau2 = {source = "tau2", unit = "N m", sign = 1, torque_constant = 1.0, gear_ratio = 1.0}
""",
    "limits": """
range = 1.2
speed = 3.0
acceleration = 30.0
torque = [1.5, 1.0]
tip_height = -1.0
duration = 2.0
rate = 100.0
runs = [1, 1]
""",
    "tolerances": "max_error_percent = {k1 = 50.0, k4 = 50.0}",
    "manifest": """
[defaults]
robot = "r1"
[[jobs]]
name = "a"
logs = ["case1-unloaded.csv"]
loaded = ["case1-loaded.csv"]
payload = 0.3515
""",
}
SOUND: dict[str, dict[str, Any]] = {kind: tomllib.loads(text) for kind, text in _TEXTS.items()}
"""A document of each kind."""


def called(*arguments: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command that runs in this process."""
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["algid", *arguments]
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = run(arguments)
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    return code, out.getvalue(), err.getvalue()


def furnish(place: Path) -> None:
    """Make everything in the folder `place`."""
    log, loaded, weak = (
        "case1-unloaded.csv",
        "case1-loaded.csv",
        "--estimator weak --model plain -q",
    )
    noise = "--position-noise 1e-4 --torque-noise 1e-2"
    motion = f"--duration 3 --rate 100 --torque wide {noise}"
    for call in (
        f"synth case1 -o . --format csv {motion}",
        f"synth case1 -o . --format mcap {motion}",
        f"identify {log} --loaded {loaded} -o . --name full -q",
        f"identify {log} -o . --name weak --no-report {weak}",
        f"identify {log} --loaded {loaded} -o . --name paper --estimator paper -q --no-report",
        f"track {loaded} --parameters full.algid -o . --l1 0.1626 --l2 0.1232 -q",
        f"design case1 -o . --range 1.2 --speed 3 --torque 1.5 --duration 2 --rate 50 {noise} -q",
        f"batch {log} -o results --workers 1 --no-report {weak}",
    ):
        with chdir(place):
            code, _, said = called(*call.split())
        if code not in (0, 3, 4):
            raise RuntimeError(f"{call}: {code}: {said}")
