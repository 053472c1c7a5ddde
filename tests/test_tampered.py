"""Results that are none: one line that names the file and the place."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from algid.base.errors import ResultError
from algid.results import read_result
from tests.report.folders import build


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        (("parameters", "k1", "estimate"), math.inf, "parameters.k1.estimate: "),
        (("parameters", "k1", "status"), "FINE", "parameters.k1.status: "),
        (("fit", "covariance", 0), 1.0, "fit.covariance.0: "),
        (("log", "rows"), "many", "log.rows: "),
        (("schema_version",), 2, "schema_version: expected 4, found 2"),
    ],
)
def test_a_file_that_is_no_result_is_one_line(
    path: tuple[str | int, ...], value: Any, place: str, tmp_path: Path
) -> None:
    build(tmp_path, 2.0)
    file = tmp_path / "result.json"
    content = json.loads(file.read_text())
    holder: Any = content
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    file.write_text(json.dumps(content))
    with pytest.raises(ResultError) as refused:
        read_result(file)
    assert str(refused.value).startswith(f"{file}: {place}")
    assert str(refused.value).endswith("; identify again with this version")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 50_000, "\udcff"])
def test_what_is_no_json_of_a_result_is_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text(text, errors="surrogateescape")
    with pytest.raises(ResultError, match=r"^\S+: [^\n]+$"):
        read_result(file)
