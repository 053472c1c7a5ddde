"""Freed memory stays with the process."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

CODE = """
import resource, sys
import numpy as np
from algid.base.runtime import keep_freed
if sys.argv[1] == "keep":
    keep_freed()
def work():
    return [np.ones(1 << 18) for _ in range(8)]
work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_the_same_arrays_again_take_no_new_pages() -> None:
    faults = {
        way: int(
            subprocess.run(
                [sys.executable, "-c", CODE, way], capture_output=True, check=True
            ).stdout
        )
        for way in ("keep", "leave")
    }
    assert faults["keep"] < 0.05 * faults["leave"]
