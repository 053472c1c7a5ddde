"""What hostile calls stand on: logs, results, a track, a design, a batch, and TOML files of every
kind, all sound.
"""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from algid.cli import run

ARM = {
    "arm": {
        "m1": 1.2,
        "m2": 0.8,
        "lc1": 0.15,
        "lc2": 0.12,
        "l1": 0.3,
        "l2": 0.25,
        "I1": 0.01,
        "I2": 0.006,
        "b1": 0.5,
        "b2": 0.4,
        "g": 9.81,
    },
    "payload": {"m_p": 0.5},
    "paper_error_percent": {"k1": 0.2},
    "torque": {
        "joint1": {"amplitude": [0.5, 0.2], "frequency": [0.5, 0.3], "phase": [1.0, 2.0]},
        "joint2": {"amplitude": [0.5, 0.2], "frequency": [0.5, 0.3], "phase": [1.0, 2.0]},
    },
}
PROFILE = {
    "joints": ["theta1", "theta2"],
    "time": "t",
    "time_unit": "s",
    "zero": "horizontal",
    "drive": "joint",
    "second_angle": "relative",
    "gravity": 9.81,
    "velocity": True,
    "signs": [1, 1],
    "offsets": [0.0, 0.0],
    "start": 0.0,
    "end": 10.0,
    "accept": ["DEGREES"],
    "theta1": {
        "source": "theta1",
        "unit": "rad",
        "sign": 1,
        "offset": 0.0,
        "gear_ratio": 1.0,
        "unwrap": False,
    },
    "tau2": {"source": "tau2", "unit": "N m", "sign": 1, "torque_constant": 1.0, "gear_ratio": 1.0},
}
LIMITS = {
    "range": 1.2,
    "speed": 3.0,
    "acceleration": 30.0,
    "torque": [1.5, 1.0],
    "tip_height": -1.0,
    "duration": 2.0,
    "rate": 100.0,
    "runs": [1, 1],
}
TOLERANCES = {"max_error_percent": {"k1": 50.0, "k4": 50.0}}
MANIFEST = {
    "defaults": {"robot": "r1"},
    "jobs": [
        {
            "name": "a",
            "logs": ["case1-unloaded.csv"],
            "loaded": ["case1-loaded.csv"],
            "payload": 0.3515,
        }
    ],
}
_SHORT = (
    "--duration",
    "3",
    "--rate",
    "100",
    "--torque",
    "wide",
    "--position-noise",
    "1e-4",
    "--torque-noise",
    "1e-2",
)


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
    at = str(place)
    log, loaded = (str(place / f"case1-{role}.csv") for role in ("unloaded", "loaded"))
    weak = ("--estimator", "weak", "--model", "plain", "-q")
    calls: tuple[tuple[str, ...], ...] = (
        ("synth", "case1", "-o", at, "--format", "csv", *_SHORT),
        ("synth", "case1", "-o", at, "--format", "mcap", *_SHORT),
        ("identify", log, "--loaded", loaded, "-o", at, "--name", "full", "-q"),
        ("identify", log, "-o", at, "--name", "weak", "--no-report", *weak),
        (
            "identify",
            log,
            "--loaded",
            loaded,
            "-o",
            at,
            "--name",
            "paper",
            "--estimator",
            "paper",
            "-q",
            "--no-report",
        ),
        (
            "track",
            loaded,
            "--parameters",
            str(place / "full.algid"),
            "-o",
            at,
            "--l1",
            "0.1626",
            "--l2",
            "0.1232",
            "-q",
        ),
        (
            *(
                "design",
                "case1",
                "-o",
                at,
                "--range",
                "1.2",
                "--speed",
                "3",
                "--torque",
                "1.5",
                "--duration",
                "2",
            ),
            *("--rate", "50", "--position-noise", "1e-3", "--torque-noise", "1e-2", "-q"),
        ),
        ("batch", log, "-o", str(place / "results"), "--workers", "1", "--no-report", *weak),
    )
    for arguments in calls:
        code, _, said = called(*arguments)
        if code not in (0, 3, 4):
            raise RuntimeError(f"{arguments}: {code}: {said}")
