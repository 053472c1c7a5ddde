"""Results and tables of a batch that are none: one line that names the file and the place."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from algid.base.errors import ResultError
from algid.fleet.history import history_of
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


def jobs() -> pl.DataFrame:
    """A batch's table with all that a fleet reads."""
    rows = 12
    days = pl.datetime_range(pl.datetime(2026, 1, 1), pl.datetime(2026, 1, rows), "1d", eager=True)
    columns: dict[str, Any] = {
        "job": [f"r1/{row}" for row in range(rows)],
        "robot": ["r1"] * rows,
        "time": days,
        "status": ["ok"] * rows,
        "label_payload": [0.5] * rows,
    }
    for name in ("k1", "m_p"):
        columns |= {name: [1.0 + 1e-3 * row for row in range(rows)], f"{name}_std": [1e-2] * rows}
    return pl.DataFrame(columns)


@pytest.mark.parametrize("value", [1e308, math.nan, 0.0])
@pytest.mark.parametrize("column", ["k1", "k1_std", "label_payload"])
def test_numbers_beyond_all_bounds_are_no_estimates(
    column: str, value: float, tmp_path: Path
) -> None:
    path = tmp_path / "jobs.parquet"
    places = pl.int_range(pl.len()) == 3
    changed = pl.when(places).then(pl.lit(value)).otherwise(pl.col(column)).alias(column)
    jobs().with_columns(changed).write_parquet(path)
    history = history_of(path)
    assert history.jobs.height == 12
    json.dumps(history.as_dict(), allow_nan=False)


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 50_000, "\udcff"])
def test_what_is_no_json_of_a_result_is_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text(text, errors="surrogateescape")
    with pytest.raises(ResultError, match=r"^\S+: [^\n]+$"):
        read_result(file)
