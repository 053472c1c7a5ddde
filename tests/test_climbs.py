"""On a log's way no room calls a higher one."""

from __future__ import annotations

import subprocess
import sys

import pytest

_TRACED = """
from pipelines.house import climbs, way

calls, resumed = way()
print(climbs(calls), climbs(resumed))
"""


@pytest.mark.slow
def test_no_room_calls_a_higher_one() -> None:
    # samples alone are drawn from above, since a log may be longer than memory: what cuts them
    # into pieces goes on with the survey's pass
    traced = subprocess.run([sys.executable, "-c", _TRACED], capture_output=True, check=True)
    assert traced.stdout.decode().splitlines()[-1] == "[] ['signals to identification']"
