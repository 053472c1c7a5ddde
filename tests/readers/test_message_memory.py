"""How much memory long logs of messages take, read in blocks as identification reads them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.readers.large import WRITERS, peak_of_reading

SAMPLES = 1_500_000
MOST_BYTES = 160e6
"""The samples' arrays alone take 60 MB, beside some 60 MB of a program that reads nothing."""
INDEXED = 200.0
"""Bytes a message that rosbags takes for the index of a ROS 1 bag."""


@pytest.mark.slow
@pytest.mark.parametrize("form", WRITERS)
def test_memory_does_not_grow_with_the_log(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{form}"
    try:
        WRITERS[form](path, SAMPLES)
        rows, peak = peak_of_reading(path)
    finally:
        path.unlink(missing_ok=True)
    assert rows == SAMPLES
    print(f"{form}: {peak / 1e6:.0f} MB")
    most = MOST_BYTES + INDEXED * SAMPLES * (form == "bag")
    assert peak < most, f"{peak / 1e6:.0f} MB"
