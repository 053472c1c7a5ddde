"""What a short log does not need is not imported: it takes longer than all that is computed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import algid
from algid.writers import write_log

CHANNELS = ("theta1", "theta2", "tau1", "tau2")
HEAVY = ("pandas", "polars", "scipy.linalg", "scipy.special", "scipy.signal", "pyarrow.dataset")
SCRIPT = """
import json, sys, algid
algid.identify(sys.argv[1], out=sys.argv[2], report=json.loads(sys.argv[3]))
print(json.dumps(sorted(sys.modules)))
"""


@pytest.mark.parametrize("report", [False, True])
def test_a_short_parquet_log_needs_no_heavy_package(tmp_path: Path, report: bool) -> None:
    log, _ = algid.synthesise("case1", duration=2.0, torque="wide")
    path = tmp_path / "log.parquet"
    write_log(path, log)
    command = [sys.executable, "-c", SCRIPT, str(path), str(tmp_path / "out"), json.dumps(report)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = json.loads(done.stdout.splitlines()[-1])
    heavy = HEAVY if report else (*HEAVY, "pyarrow.compute", "numpy.ma")
    assert [name for name in heavy if name in loaded] == []


COMMAND = """
import gc, sys
from algid.cli import main
sys.argv = ["algid", "identify", "--help"]
usual = gc.get_threshold()
try:
    main()
finally:
    plugins = "pydantic.plugin._loader" in sys.modules
    found = sys.modules["pydantic.plugin._loader"]._plugins if plugins else None
    seldom, spared = gc.get_threshold()[0] >= 10 * usual[0], gc.get_freeze_count() > 0
    print(seldom, spared, found, "numpy" in sys.modules, file=sys.stderr)
"""


def test_help_loads_no_numbers_and_hardly_searches_for_cycles_or_plugins() -> None:
    done = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # of the command, then of the process that guards it
    assert done.stderr.splitlines() == ["True True None False", "False False None False"]


@pytest.mark.parametrize("name", ["log.csv", "log.feather", "log.npz"])
def test_no_log_needs_pandas(tmp_path: Path, name: str) -> None:
    t = np.arange(2000) / 100
    columns = {channel: np.sin(t + place) for place, channel in enumerate(CHANNELS)} | {"t": t}
    path, frame = tmp_path / name, pl.DataFrame(columns)
    if name == "log.csv":
        frame.write_csv(path)
    elif name == "log.feather":
        frame.write_ipc(path)
    else:
        np.savez(path, **columns)  # type: ignore[arg-type]
    code = (
        "import json, sys, algid; algid.read_log(sys.argv[1]); print(json.dumps(list(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    assert "pandas" not in json.loads(done.stdout)
