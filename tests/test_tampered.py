"""Results, tracks and tables of a batch that nobody wrote so: one line that names the file and the
place.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from algid.base.errors import ResultError
from algid.fleet.history import history_of, read_jobs
from algid.results import misfit_of_numbers, read_result
from tests.report.folders import build


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("result")
    build(folder, 2.0)
    found: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return found


def changed(content: dict[str, Any], *path: str | int, value: Any) -> dict[str, Any]:
    """A copy of the content with another value in one place."""
    made: dict[str, Any] = json.loads(json.dumps(content))
    holder: Any = made
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    return made


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        (
            ("parameters", "k1", "estimate"),
            1e308,
            "parameters.k1.estimate: expected a number below 1e+60 in size",
        ),
        (
            ("parameters", "k1", "estimate"),
            math.inf,
            "parameters.k1.estimate: expected a number below 1e+60 in size",
        ),
        (
            ("parameters", "k1", "estimate"),
            math.nan,
            "parameters.k1.estimate: expected a number below 1e+60 in size",
        ),
        (
            ("parameters", "k1", "estimate"),
            10**400,
            "parameters.k1.estimate: expected a number below 1e+60 in size",
        ),
        (("parameters", "k1", "estimate"), 1e50, "'k1': expected a number below 1e+30 in size"),
        (
            ("parameters", "k2", "estimate"),
            5e-324,
            "'k2': estimate: expected 0, or 1e-30 or more in size",
        ),
        (("parameters", "k1", "std"), -1.0, "'k1': std: expected 0, or 1e-30 or more, found -1"),
        (
            ("fit", "covariance", 0, 0),
            -1.0,
            "fit.covariance.0.0: expected 0, or 1e-30 or more, found -1",
        ),
        (("fit", "covariance", 0, 1), 1e23, "fit.covariance: expected a symmetric matrix"),
        (("fit", "covariance", 1, 0), -1.0, "fit.covariance: expected a symmetric matrix"),
        (("fit", "covariance_names", 1), "k1", "fit.covariance_names: expected each once"),
        (("fit", "noise", "tau1"), -1.0, "fit.noise.tau1: expected 0, or 1e-30 or more, found -1"),
        (("log", "rows"), -1, "rows, duration and rate may not be negative"),
        (("log", "start_ns"), 10**30, "nor the start 2^63 ns"),
        (
            ("settings", "gravity"),
            "heavy",
            "--gravity: expected a number from 0 to 1000, found 'heavy'",
        ),
        (("settings", "gravity"), True, "--gravity: expected a number from 0 to 1000, found True"),
        (
            ("settings", "payload_mass"),
            "x",
            "--payload-mass: expected a number from 1e-09 to 1e+06, found 'x'",
        ),
        (
            ("settings", "estimator"),
            "magic",
            "--estimator: expected 'refined', 'weak', 'instruments' or 'paper'",
        ),
        (("settings", "constrain"), 3, "--set constrain: expected a valid boolean, found 3"),
        (("settings", "model"), [1], "--model: expected a valid string, found [1]"),
        (("settings", "poles"), 7, "--set poles: expected six numbers, found 7"),
    ],
)
def test_a_result_that_no_identification_gives_is_refused_on_reading(
    content: dict[str, Any], path: tuple[str | int, ...], value: Any, told: str, tmp_path: Path
) -> None:
    file = tmp_path / "result.json"
    file.write_text(json.dumps(content))
    read_result(file)
    file.write_text(json.dumps(changed(content, *path, value=value)))
    with pytest.raises(ResultError) as refused:
        read_result(file)
    line = str(refused.value)
    assert line.startswith(f"{file}: ")
    assert told in line
    assert line.endswith("; identify again with this version")
    assert "\n" not in line


def test_depth_is_no_trouble() -> None:
    deep: Any = 1e300
    for _ in range(50_000):
        deep = [deep]
    assert misfit_of_numbers(deep) is not None
    assert misfit_of_numbers({"a": [1, {"b": True, "c": None, "d": "1e999"}]}) is None


def jobs() -> pl.DataFrame:
    """A batch's table with all that a fleet reads."""
    rows = 12
    columns: dict[str, Any] = {
        "job": [f"r1/{row}" for row in range(rows)],
        "robot": ["r1"] * rows,
        "time": pl.datetime_range(
            pl.datetime(2026, 1, 1), pl.datetime(2026, 1, rows), "1d", eager=True
        ),
        "status": ["ok"] * rows,
        "label_payload": [0.5] * rows,
    }
    for name in ("k1", "m_p"):
        columns |= {name: [1.0 + 1e-3 * row for row in range(rows)], f"{name}_std": [1e-2] * rows}
    return pl.DataFrame(columns)


COLUMNS = ("job", "robot", "time", "status", "label_payload", "k1", "k1_std", "m_p", "m_p_std")
KINDS: tuple[Any, ...] = (
    *(
        pl.String,
        pl.Int64,
        pl.Float32,
        pl.Boolean,
        pl.Date,
        pl.Datetime("ns"),
        pl.Datetime("ms", "Europe/Rome"),
    ),
    *(
        pl.Duration("us"),
        pl.Time,
        pl.Binary,
        pl.Categorical,
        pl.Null,
        pl.List(pl.Float64),
        pl.Struct({"a": pl.Int8}),
    ),
)


@pytest.mark.parametrize("column", COLUMNS)
def test_a_column_of_another_type_is_taken_or_refused_with_its_name(
    column: str, tmp_path: Path
) -> None:
    path = tmp_path / "jobs.parquet"
    sound = jobs()
    variants = [sound.with_columns(pl.lit(None, kind).alias(column)) for kind in KINDS]
    variants += [
        sound.drop(column),
        sound.head(0),
        sound.with_columns(pl.lit(None, sound[column].dtype).alias(column)),
    ]
    for kind in KINDS:
        try:
            variants.append(sound.with_columns(pl.col(column).cast(kind, strict=False)))
        except pl.exceptions.PolarsError:
            continue
    for frame in variants:
        frame.write_parquet(path)
        try:
            history = history_of(path)
        except ResultError as error:
            line = str(error)
            assert line.startswith(f"{path}: ")
            assert "\n" not in line
            continue
        json.dumps(history.as_dict(), allow_nan=False)  # pytest makes any overflow an error


@pytest.mark.parametrize("value", [1e308, -1e308, math.inf, math.nan, 5e-324, 0.0, -1.0])
@pytest.mark.parametrize("column", ["k1", "k1_std", "m_p", "m_p_std", "label_payload"])
def test_numbers_beyond_all_bounds_are_no_estimates(
    column: str, value: float, tmp_path: Path
) -> None:
    path = tmp_path / "jobs.parquet"
    places = pl.int_range(pl.len()) == 3
    jobs().with_columns(
        pl.when(places).then(pl.lit(value)).otherwise(pl.col(column)).alias(column)
    ).write_parquet(path)
    history = history_of(path)
    assert history.logs == 12
    json.dumps(history.as_dict(), allow_nan=False)


def test_a_sound_table_is_read_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "jobs.parquet"
    jobs().write_parquet(path)
    read = read_jobs(path)
    for name in ("k1", "k1_std", "m_p", "label_payload", "robot", "job"):
        assert read[name].to_list() == jobs()[name].to_list()
    assert read["time"].dt.replace_time_zone(None).to_list() == jobs()["time"].to_list()
