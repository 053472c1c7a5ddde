"""What the tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.runtime import bound_by_environment

bound_by_environment()  # as the command does, before anything loads numpy

from hypothesis import HealthCheck, settings  # noqa: E402

settings.register_profile("any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-machine")  # no test judges a machine by its speed

SHARED = Path(__file__).parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recorded logs; skips where it is absent."""
    if not (SHARED / "data").is_dir():
        pytest.skip("../shared/data is absent")
    return SHARED / "data"
