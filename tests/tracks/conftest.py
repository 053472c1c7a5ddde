from __future__ import annotations

import pytest

from algid.log import Log
from algid.synth.run import Acquisition, excitation, synthesise
from tests.tracks.folders import CASE


@pytest.fixture(scope="session")
def picking() -> Log:
    """50 g picked and placed, without noise."""
    (log,) = synthesise(
        CASE,
        excitation(CASE, "wide"),
        Acquisition(duration=4.5),
        schedule=[(1.5, 0.05), (3.0, 0.0)],
    )
    return log
