"""Tries mutants, for `pipelines.mutants`: run in mutmut's copy of the project, where each name
switches one change on.

Reads lines of JSON: a mutant's name, its tests, the seconds of processor time that they may take.
Writes a line for each: the name, and what pytest ended with in a process of its own (0 where no
test failed; negative: a signal).
"""

from __future__ import annotations

import json
import os
import resource
import sys

import pytest

PYTEST = ("-p", "no:xdist", "-o", "addopts=-q -m 'not slow'", "-o", "filterwarnings=")
"""How the tests are run, by mutmut as it times them too."""


def _quietly(arguments: list[str]) -> int:
    """What pytest ends with; what it prints is thrown away."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    kept = [os.dup(stream) for stream in (1, 2)]
    for stream in (1, 2):
        os.dup2(nothing, stream)
    try:
        return int(pytest.main(["--rootdir=.", "-p", "no:cacheprovider", *PYTEST, *arguments]))
    finally:
        for stream, was in zip((1, 2), kept, strict=True):
            os.dup2(was, stream)


def _tried(name: str, tests: list[str], limit: int) -> int:
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
        os.environ["MUTANT_UNDER_TEST"] = name
        code = 3
        try:
            code = _quietly(["-x", *tests])
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def main() -> None:
    """Import all tests once, then a process a mutant."""
    jobs = [json.loads(line) for line in sys.stdin]
    os.environ["MUTANT_UNDER_TEST"] = ""
    _quietly(
        [
            "--collect-only",
            *sorted({test.partition("::")[0] for _, tests, _ in jobs for test in tests}),
        ]
    )
    for name, tests, limit in jobs:
        print(name, _tried(name, tests, limit), flush=True)


if __name__ == "__main__":
    main()
