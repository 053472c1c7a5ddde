"""Moments of bent arms as sizes and angles: against draws of what the covariance says."""

from __future__ import annotations

import numpy as np
import pytest

from algid.model import Model
from algid.report.brief import WIDTH, brief
from algid.report.phasors import moments
from algid.report.tables import arm_tables
from algid.results import Result
from tests.exports.arms import ODD, result_of, values_of

SIZE, ANGLE = 0.05, np.radians(20.0)


def bent(**more: float) -> Result:
    K = SIZE * np.exp(1j * ANGLE)
    value = values_of(ODD) | {"k1": float(K.real), "k1s": float(K.imag), "k2s": 0.1, "k4s": -0.5}
    return result_of(value | more, Model(("phases",)), std=0.02)


def test_size_and_angle_have_the_spread_of_draws() -> None:
    result = bent()
    assert result.fit is not None
    one = moments(result)["k1"]
    assert one.size == pytest.approx(SIZE)
    assert one.angle == pytest.approx(20.0)
    places = [result.fit.covariance_names.index(name) for name in ("k1", "k1s")]
    C = np.array(result.fit.covariance, dtype=np.float64)[np.ix_(places, places)]
    mean = [result.parameters[name].estimate for name in ("k1", "k1s")]
    drawn = np.random.default_rng(0).multivariate_normal(np.array(mean, float), C, 20_000)
    K = drawn[:, 0] + 1j * drawn[:, 1]
    # the spread of 20 000 draws is known to 0.5 %; four times that
    assert one.std == pytest.approx(np.abs(K).std(), rel=0.02)
    assert one.angle_std == pytest.approx(np.degrees(np.angle(K)).std(), rel=0.02)


def test_the_terminal_and_the_page_show_size_and_angle() -> None:
    lines = brief(bent())
    assert max(map(len, lines)) <= WIDTH
    (line,) = [line for line in lines if line.startswith("|K1|")]
    assert "0.050" in line
    assert "at 20.00° ± " in line
    assert not any(line.startswith("k1") for line in lines)
    (table,) = [one for one in arm_tables(bent()) if one.title.startswith("Moments")]
    assert [row[0] for row in table.rows] == ["|K1|", "|K2|", "|K4|"]
    assert table.rows[0][-1].startswith("20.00° ± ")


def test_a_straight_arm_and_shrunk_phases_show_none() -> None:
    assert moments(result_of(values_of(ODD))) == {}
    result = bent()
    assert result.fit is not None
    assert result.fit.model is not None
    model = result.fit.model.model_copy(update={"shrunk": ["k1s", "k2s", "k4s"]})
    shrunk = result.model_copy(update={"fit": result.fit.model_copy(update={"model": model})})
    assert moments(shrunk) == {}
    assert not [one for one in arm_tables(shrunk) if one.title.startswith("Moments") and one.rows]
