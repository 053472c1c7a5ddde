"""Runs tests for `pipelines.mutants` in the copy of the project, each run in a fork of a process
that has what algid imports, but not algid.

Reads lines of JSON: a mutant, a file, its text, the tests, the seconds of processor time that they
may take. Writes a line for each: the mutant, and how the tests ended.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

PYTEST = (
    "--rootdir=.", "-p", "no:xdist", "-p", "no:cacheprovider", "-o", "addopts=-q -m 'not slow'",
    "-o", "filterwarnings=", "--hypothesis-seed=0",
)  # fmt: skip
LOADED = (
    "hypothesis", "numpy", "scipy.integrate", "scipy.interpolate", "scipy.linalg",
    "scipy.optimize", "scipy.stats", "pydantic", "jinja2", "click", "plotly.graph_objects",
    "polars", "pyarrow.csv", "pyarrow.fs", "pyarrow.parquet", "rich.progress",
    # what tests import
    "click.testing", "h5py", "mcap.writer", "pandas", "rosbags.rosbag2", "ruamel.yaml", "sympy",
)  # fmt: skip
SLOWEST = 10  # times the processor time: a mutant that waits longer than that hangs
MEMORY = 8 << 30  # bytes


class Recorder:
    """Which lines each test reaches, and how long it takes."""

    def __init__(self, coverage: Any) -> None:
        self.coverage = coverage
        self.seconds: dict[str, float] = {}
        self.failed: list[str] = []

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """A context a test, its fixtures among it."""
        self.coverage.switch_context(item.nodeid)
        start = sum(os.times()[:4])  # of the processor: the machine may be busy
        done = yield
        self.seconds[item.nodeid] = sum(os.times()[:4]) - start
        return done

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Tests that fail see no mutant."""
        if report.failed:
            self.failed.append(report.nodeid)


def record(tests: list[str], sources: list[str]) -> None:
    """Write ``reached.json``: seconds by test, and tests by line of the sources."""
    from coverage import Coverage

    coverage = Coverage(data_file=None, config_file=False, include=sources)  # not of processes
    recorder = Recorder(coverage)
    coverage.start()
    code = pytest.main([*PYTEST, *tests], plugins=[recorder])
    coverage.stop()
    if code or recorder.failed:
        raise SystemExit(f"tests fail before a mutant is tried: {recorder.failed}")
    data = coverage.get_data()
    lines = {os.path.relpath(path): data.contexts_by_lineno(path) for path in data.measured_files()}
    text = json.dumps({"seconds": recorder.seconds, "lines": lines})
    Path("reached.json").write_text(text, encoding="utf-8")


@contextmanager
def changed(path: Path, text: str) -> Iterator[None]:
    """The file holds the mutant's text."""
    before, times = path.read_bytes(), path.stat()
    path.write_text(text, encoding="utf-8")
    try:
        yield
    finally:
        path.write_bytes(before)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # its bytecode is good again


def tried(tests: list[str], limit: int) -> str:
    """How the tests end in a process of their own: ``survived``, ``killed`` or ``hung``."""
    child = os.fork()
    if child == 0:
        os.setsid()  # what it starts ends with it
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        code = 3
        try:
            code = int(pytest.main([*PYTEST, "-x", *tests]))
        finally:
            os._exit(code)
    end = time.monotonic() + SLOWEST * limit
    while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < end:
        time.sleep(0.02)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    status = ended[1] if ended[0] else os.waitpid(child, 0)[1]
    shutil.rmtree(".hypothesis", ignore_errors=True)  # examples of this mutant are not the next's
    code = os.waitstatus_to_exitcode(status)
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "hung"
    return "killed" if code else "survived"


def main() -> None:
    """Try each mutant of standard input."""
    if sys.argv[1:]:
        record(**json.loads(sys.argv[1]))
        return
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # one of a mutant would outlive it
    sys.dont_write_bytecode = True
    for name in LOADED:
        import_module(name)
    gc.freeze()
    for line in sys.stdin:
        job = json.loads(line)
        with changed(Path(job["path"]), job["text"]):
            end = tried(job["tests"], job["limit"])
        print(job["name"], end, flush=True)


if __name__ == "__main__":
    main()
