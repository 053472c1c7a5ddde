"""`algid` as its users start it: a process with its own arguments, folder, environment,
descriptors and exit code.

A fresh interpreter spends most of a second on imports. One server a test process has done them,
computes nothing, and forks for each command. What depends on the interpreter's start or on signals
is tested with processes of its own.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any, NoReturn

import algid
from algid.base.runtime import bound_by_environment

ROOT = Path(__file__).parents[1]
SERVER = "from tests.processes import serve; serve()"
LARGEST = 1 << 20  # bytes of a request
FRESH = "ALGID_TESTS_FRESH"
"""Set where a fork of loaded packages is unsafe: old Arrow and Polars leave locks held in it."""
LOADED = (
    "polars", "pyarrow.csv", "pyarrow.fs", "pyarrow.parquet", "scipy.integrate",
    "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.stats",
    "plotly.graph_objects", "plotly.subplots", "rich.progress",
)  # fmt: skip
"""What commands import where they need it, beside algid's own modules."""


class Outcome:
    """What a command printed and returned."""

    def __init__(
        self, *arguments: str | Path, cwd: Path | None = None, env: Mapping[str, str] | None = None
    ) -> None:
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            self.code = begin(
                *arguments, stdout=out.fileno(), stderr=err.fileno(), cwd=cwd, env=env
            )()
            self.out, self.err = (_text(stream.fileno()) for stream in (out, err))


def _text(descriptor: int) -> str:
    os.lseek(descriptor, 0, os.SEEK_SET)
    with open(descriptor, encoding="utf-8", closefd=False) as stream:
        return stream.read()


def begin(
    *arguments: object,
    stdout: int,
    stderr: int,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
) -> Callable[[], int]:
    """Start `algid` with these descriptors.

    What is returned waits for its end and gives the exit code.
    """
    argv, own_env = ["algid", *map(str, arguments)], dict(env or os.environ)
    if FRESH in os.environ:
        command = [sys.executable, "-m", *argv]
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, cwd=cwd, env=own_env
        ).wait
    request = {"argv": argv, "cwd": str(cwd or Path.cwd()), "env": own_env}
    server = _server()
    socket.send_fds(server, [json.dumps(request).encode()], [stdout, stderr])

    def wait() -> int:
        answer = server.recv(LARGEST)
        assert answer, "the server of commands is gone"
        return int(answer)

    return wait


@cache
def _server() -> socket.socket:
    """This test process's server: it ends when the socket is closed."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LARGEST)
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    running = subprocess.Popen([sys.executable, "-c", SERVER], stdin=theirs.fileno(), env=env)
    theirs.close()
    atexit.register(running.wait)
    atexit.register(ours.close)  # the last that is registered is the first to run
    return ours


def serve() -> None:
    """Fork for each request on the socket that is descriptor 0, until the other end is closed."""
    bound_by_environment()
    for module in walk_packages(algid.__path__, "algid."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    for name in LOADED:
        import_module(name)
    gc.freeze()  # what is here already is not a fork's to collect
    requests = socket.socket(fileno=os.dup(0))
    while True:
        asked, descriptors, _, _ = socket.recv_fds(requests, LARGEST, 2)
        if not asked:
            return
        # of a fork beside the idle threads of polars and pyarrow
        with warnings.catch_warnings(action="ignore"):
            child = os.fork()
        if child == 0:
            requests.close()
            _become(json.loads(asked), *descriptors)
            _run_and_exit()
        for descriptor in descriptors:
            os.close(descriptor)
        requests.send(str(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])).encode())


def _become(request: dict[str, Any], stdout: int, stderr: int) -> None:
    """Make this process the one that was asked for."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    for descriptor, place in ((nothing, 0), (stdout, 1), (stderr, 2)):
        os.dup2(descriptor, place)
        os.close(descriptor)
    os.chdir(request["cwd"])
    sys.argv = request["argv"]
    os.environ.clear()
    os.environ.update(request["env"])


def _run_and_exit() -> NoReturn:
    """Run the command and end as the interpreter does, without the time that it takes to forget
    all modules.
    """
    from algid.cli import main

    code: int = 1
    try:
        main()
        code = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        else:
            code = end.code or 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        code = 120  # as the interpreter gives
    os._exit(code)
