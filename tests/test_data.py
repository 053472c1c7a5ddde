"""What ships in data/ and with the package."""

from __future__ import annotations

import json
from importlib import resources
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from algid.readers import read_log
from algid.results import Result
from algid.synth.cases import case_names, load_case

DATA = Path(__file__).parents[1] / "data"


def _pinned(package: str) -> str:
    """The version of a package that constraints.txt names."""
    lines = (DATA.parent / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split("==") for line in lines if "==" in line)[package]


@pytest.mark.skipif(
    version("pydantic") != _pinned("pydantic"),
    reason="another version of pydantic writes the same schema in other words",
)
def test_schema_that_ships_is_that_of_the_models() -> None:
    shipped = json.loads(
        (resources.files("algid") / "result.schema.json").read_text(encoding="utf-8")
    )
    assert shipped == Result.model_json_schema(mode="serialization")


def test_cases_ship_with_the_package() -> None:
    assert case_names() == ["case1", "case2"]
    assert load_case("case1").paper_error_percent["k6"] == 0.008668
    assert load_case("case2").payload == 0.6315


def test_example_arm_is_an_arm() -> None:
    assert load_case(str(DATA / "example-arm.toml")).arm.l1 == 0.3


@pytest.mark.parametrize("kind", ["mcap", "parquet", "csv"])
def test_example_logs_hold_the_same_samples(kind: str) -> None:
    log, reference = read_log(DATA / f"example.{kind}"), read_log(DATA / "example.csv")
    np.testing.assert_array_equal(
        log.stamp_ns - log.stamp_ns[0], reference.stamp_ns - reference.stamp_ns[0]
    )
    np.testing.assert_array_equal(log.theta, reference.theta)
    np.testing.assert_array_equal(log.tau, reference.tau)
