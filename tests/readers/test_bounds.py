"""Every loop over what a file claims has a bound, `algid.base.limits.LIMITS`.

And patterns take time with a text's length.

A text here is so long that a pattern which takes time with its square would not end.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.identification.identify import identify
from algid.readers import read_log
from algid.readers.column_names import Name, take_apart
from algid.writers import write_log
from pipelines.mutations import clean_log
from tests.conftest import Limited
from tests.readers.logs import same


def test_a_name_beyond_the_bound_is_its_own_stem(limited: Limited) -> None:
    take_apart.cache_clear()
    limited(name_letters=6)
    assert take_apart("tau_01") == Name("tau", "1", None)
    assert take_apart("theta_1") == Name("theta_1", None, None)


@pytest.mark.parametrize("step", [1, 10, 999])
@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_steps_that_no_arm_is_sampled_with_are_refused(
    step: int, kind: str, tmp_path: Path
) -> None:
    log = clean_log(300)
    quick = replace(log, stamp_ns=10**18 + np.arange(300) * step)
    write_log(tmp_path / f"log.{kind}", quick)
    with pytest.raises(
        LogError, match=f"its stamps are {step} ns apart in the median, .* say their unit"
    ):
        identify(tmp_path / f"log.{kind}", report=False)
    with pytest.raises(LogError, match="as no arm's log is"):
        identify(quick, report=False)


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"bad\xff.csv")
    path.write_text("t,theta1,theta2,tau1,tau2\n0,0,0,0,0\n")
    with pytest.raises(LogError, match="not valid UTF-8; rename"):
        read_log(path)


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.csv")
    for path in (tmp_path / "log.csv", Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(LogError, match="no regular file"):
            read_log(path)


@pytest.mark.parametrize("name", ["col[1]", "a*", "q?", "**", "{a,b}", "~"])
@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_a_path_is_no_pattern(name: str, kind: str, tmp_path: Path) -> None:
    write_log(tmp_path / f"{name}.{kind}", clean_log(20))
    for other in ("col1", "ab", "qq", "a", "b"):
        write_log(tmp_path / f"{other}.{kind}", clean_log(10))
    assert same(read_log(tmp_path / f"{name}.{kind}"), clean_log(20))
