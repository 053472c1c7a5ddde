"""Draws of an arm: as the estimates are distributed, possible, repeatable, and loaded by others."""

from __future__ import annotations

import io
import json
import re
from typing import Any

import numpy as np
import polars as pl
import pytest

import algid
from algid.arm import FloatArray, inverse_dynamics
from algid.base.compiled import student_quantile
from algid.base.errors import ResultError, SettingError
from algid.exports.draws import drawn_files
from algid.model import Model
from algid.results import Result
from tests.exports.arms import ODD, result_of, states, values_of

VALUE = values_of(ODD, f1=0.4, f2=0.3)
FRICTION = Model(("coulomb",))
NU = 9.0


def correlated(seed: int = 5, std: float = 0.01, value: dict[str, float] = VALUE) -> Result:
    """A result of ν = 9 whose errors are correlated, payload included."""
    payload = {"m_p": 0.5, "l1": 0.4, "l2": 0.3, "y_p": 0.01, "J_p": 0.002}
    made = result_of(value, FRICTION, payload=payload, std=std)
    assert made.fit is not None
    size = np.sqrt(np.diag(made.covariance))
    mixed = np.random.default_rng(seed).normal(size=(size.size, 3 * size.size))
    correlation = np.corrcoef(mixed)
    half = student_quantile(NU)
    moved: dict[str, dict[str, algid.Estimate]] = {}
    for kind in ("parameters", "payload"):
        moved[kind] = {}
        for name, one in getattr(made, kind).items():
            ends = (one.estimate - half * one.std, one.estimate + half * one.std)
            moved[kind][name] = one.model_copy(update={"ci95": ends})
    fit = made.fit.model_copy(update={"covariance": (correlation * np.outer(size, size)).tolist()})
    return made.model_copy(update={**moved, "fit": fit})


def drawn(
    result: Result, to: str, count: int, seed: int
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Manifest and files of draws."""
    files, _ = drawn_files(result, "arm", to, {}, count, seed)
    return json.loads(files["manifest.json"]), files


def test_draws_are_students_with_the_estimates_covariance() -> None:
    result, count = correlated(std=1e-3), 3000
    manifest, files = drawn(result, "parquet", count, 1)
    said = {
        "algid": algid.__version__,
        "result": "arm",
        "estimator": "refined",
        "seed": 1,
        "refused": 0,
        "known": {},
    }
    assert manifest | said | {"distribution": "Student's t", "from_prior": []} == manifest
    assert manifest["degrees_of_freedom"] == pytest.approx(NU, rel=1e-6)
    assert drawn(result_of(VALUE, FRICTION), "csv", 1, 0)[0]["degrees_of_freedom"] == 1e10
    names, covariance = manifest["names"], np.array(manifest["covariance"])
    np.testing.assert_array_equal(covariance, result.covariance)
    table = pl.read_parquet(files["draws.parquet"])
    assert table["draw"].to_list() == list(range(1, count + 1))
    drawn_numbers = table.select(names).to_numpy()
    mean = np.array([result.estimates[name].estimate for name in names])
    size = np.sqrt(np.diag(covariance))
    z = (drawn_numbers - mean) / size
    # of Student's t: the variance ν / (ν - 2), 95 % within its quantile; bounds are four deviations
    wide = NU / (NU - 2)
    np.testing.assert_allclose(z.mean(axis=0), 0, atol=4 * np.sqrt(wide / count))
    kurtosis = 3 + 6 / (NU - 4)
    found, expected = np.cov(z.T), wide * covariance / np.outer(size, size)
    np.testing.assert_allclose(found, expected, atol=4 * wide * np.sqrt((kurtosis - 1) / count))
    within = np.mean(np.abs(z) < student_quantile(NU), axis=0)
    np.testing.assert_allclose(within, 0.95, atol=4 * np.sqrt(0.95 * 0.05 / count))


def test_every_draw_is_a_possible_arm() -> None:
    """Errors of 60 %: every other arm of the distribution has a friction or an inertia below 0."""
    result = correlated(std=0.6)
    manifest, files = drawn(result, "urdf", 50, 3)
    assert manifest["refused"] > 10
    for row in manifest["draws"]:
        assert min(row[name] for name in ("k3", "k5", "k6", "k7", "f1", "m_p", "l2", "J_p")) >= 0
        assert row["k3"] * row["k5"] > row["k1"] ** 2
        said = re.findall(r'(?:mass value|ixx|iyy|izz)="([^"]+)"', files[row["file"]].decode())
        assert len(said) == 8
        assert min(map(float, said)) > 0
    with pytest.raises(ResultError, match=r"100 of 100 draws are no arm .f1 >= 0.; identify"):
        drawn(correlated(value=VALUE | {"f1": -0.4}), "csv", 1, 0)


@pytest.mark.parametrize(("to", "end"), [("mjcf", "-->"), ("sdf", "-->"), ("c", "*/")])
def test_each_file_is_the_export_of_what_its_row_says(to: Any, end: str) -> None:
    result = correlated()
    made = algid.export(result, to, draws=12, seed=4)
    rows = json.loads(made.text)["draws"]
    assert [*made.files] == ["manifest.json", *(row["file"] for row in rows)]
    for row in rows:
        moved = {}
        for kind in ("parameters", "payload"):
            moved[kind] = {
                name: one.model_copy(update={"estimate": row[name]})
                for name, one in getattr(result, kind).items()
            }
        head, _, text = made.files[row["file"]].decode().partition(end)
        assert f"draw {row['draw']} of seed 4" in head
        assert "drawn, ± " in head
        alone = algid.export(result.model_copy(update=moved), to).text.partition(end)[2]
        assert NUMBER.sub("", text) == NUMBER.sub("", alone)
        found, expected = (np.array(NUMBER.findall(one), dtype=float) for one in (text, alone))
        np.testing.assert_allclose(found, expected, rtol=1e-6)  # of the masses that are chosen


NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


@pytest.mark.slow
def test_draws_cover_held_out_torques_as_often_as_stated() -> None:
    """Torques of an arm's truth at states of no log, within 95 % of what draws say of them."""
    covered = []
    theta, omega, alpha = states(40)
    for seed in range(16):
        log, _ = algid.synthesise(
            "case1",
            duration=3.0,
            torque="wide",
            position_noise=1e-3,
            torque_noise=1e-2,
            seed=seed,
        )
        result = algid.identify(log, model="plain")
        Y = np.stack([inverse_dynamics(k, theta, omega, alpha) for k in np.eye(7)], axis=1)
        truth = np.array([result.truth[f"k{number}"] for number in range(1, 8)])
        table = pl.read_csv(io.BytesIO(algid.export(result, "csv", draws=400).files["draws.csv"]))
        drawn = table.select([f"k{number}" for number in range(1, 8)]).to_numpy()
        torques: FloatArray = np.einsum("aqn,dq->dan", Y, drawn)
        low, high = np.quantile(torques, [0.025, 0.975], axis=0)
        true = np.einsum("aqn,q->an", Y, truth)
        covered.append(np.mean((low <= true) & (true <= high)))
    # of the share by arm, whose torques share their errors: three standard errors about 95 %
    assert np.mean(covered) == pytest.approx(0.95, abs=3 * np.std(covered) / np.sqrt(len(covered)))


def test_draws_of_what_has_no_error_bars_are_refused() -> None:
    bare = correlated().model_copy(update={"fit": None, "estimator": "paper"})
    with pytest.raises(ResultError, match="the result of --estimator paper has no error bars"):
        algid.export(bare, "csv", draws=2)
    with pytest.raises(SettingError, match="--draws: expected greater than or equal to 1, found 0"):
        algid.export(bare, "csv", draws=0)
    with pytest.raises(SettingError, match=r"^--draws: payload has no draws; leave it out$"):
        algid.export(bare, "payload", draws=2)
