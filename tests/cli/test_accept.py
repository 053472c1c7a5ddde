"""A log that physics refuses is identified where the user accepts it, and its result carries the
warning.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from algid.writers import write_log
from tests.inspection.test_checks import REFUSED, spoiled
from tests.processes import Outcome


@pytest.mark.parametrize("code", REFUSED)
def test_a_refused_log_is_identified_where_its_code_is_accepted(code: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.parquet"
    write_log(path, spoiled(code))
    refused = Outcome("identify", path, "-o", tmp_path, "--no-report")
    assert (refused.code, refused.out) == (2, "")
    assert refused.err.count("\n") == 1, refused.err
    assert f"{path}: {code}: " in refused.err
    assert f"--accept {code}" in refused.err
    assert sorted(one.name for one in tmp_path.iterdir()) == ["arm.parquet"]

    taken = Outcome(
        "identify",
        path,
        "-o",
        tmp_path,
        "--no-report",
        "--model",
        "plain",
        "--estimator",
        "weak",
        "--accept",
        code,
    )
    assert taken.code in (0, 3), taken.err
    result = json.loads((tmp_path / "arm.algid" / "result.json").read_text())
    assert [one["logs"] for one in result["notices"] if one["code"] == code] == [["arm.parquet"]], (
        result["notices"]
    )
    assert "Traceback" not in taken.err
    assert code in taken.out
    assert result["parameters"]
