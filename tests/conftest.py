"""What the tests share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from algid.base.limits import LIMITS
from algid.base.runtime import bound_by_environment

bound_by_environment()  # as the command does, before anything loads numpy

from hypothesis import HealthCheck, settings  # noqa: E402

settings.register_profile(
    "any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any-machine")  # no test judges a machine by its speed

SHARED = Path(__file__).parents[2] / "shared"


Limited = Callable[..., None]


@pytest.fixture
def limited() -> Iterator[Limited]:
    """Sets bounds of `algid.base.limits.LIMITS` for one test, so that a small file reaches them."""
    before = dict(vars(LIMITS))

    def change(**bounds: float) -> None:
        assert bounds.keys() <= before.keys()
        for name, value in bounds.items():
            object.__setattr__(LIMITS, name, value)  # frozen for everybody else

    yield change
    for name, value in before.items():
        object.__setattr__(LIMITS, name, value)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recorded logs; skips where it is absent."""
    if not (SHARED / "data").is_dir():
        pytest.skip("../shared/data is absent")
    return SHARED / "data"
