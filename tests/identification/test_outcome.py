"""What a result holds of a fit: intervals, Table 4, statistics and sentences, against numbers
worked out by hand.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from algid.estimators.combine import LogInformation, Prior, without
from algid.estimators.fit import Fit
from algid.estimators.prediction import NOTHING
from algid.estimators.terms import Selection
from algid.identification.by_likelihood import Fitted
from algid.identification.checks import fit_notes, remarks
from algid.identification.outcome import (
    estimate,
    outcome_of,
    table_rows,
)
from algid.identification.recordings import Recordings, open_source
from algid.identification.validate import prediction
from algid.log import Log, Origin
from algid.notices import Notice, of_codes
from algid.results import Estimate, FitSummary, Repeatability, Status, TorqueHold
from algid.settings import Settings
from algid.table4 import LOADED_ROWS, UNLOADED_ROWS
from tests.identification.fits import CASE, QUANTILE, K, fit_of, information, with_stds, with_values

ARM, PAYLOAD = CASE.arm, CASE.payload
ACCUSED = float(norm.isf(0.5e-6))  # standard deviations, by chance once in a million
K1, K2, K3, K4, K5, K6, K7 = K.tolist()


def survey(*, loaded: bool = True) -> Recordings:
    """A short log of each kind, or of the unloaded arm alone, too short to judge a
    prediction by.
    """
    t = np.arange(50) * 1e-3
    theta = np.stack([np.sin(9 * t), np.cos(7 * t)])
    logs = [
        Log((t * 1e9).astype(np.int64), theta, 3 * np.cos(theta), Origin(name, "csv", {}))
        for name in "ab"
    ]
    return Recordings(
        [open_source(logs[0], "unloaded"), *([open_source(logs[1], "loaded")] if loaded else [])]
    )


def summed(fit: Fit, chosen: Selection | None = None, **settings: Any) -> FitSummary:
    chosen = chosen or Selection(fit.shared.model, False)
    recordings = survey(loaded=fit.shared.payload)
    return outcome_of(Fitted(fit, recordings, Settings(**settings), chosen)).fit


def test_parameters_are_within_the_fits_quantile_of_their_deviations() -> None:
    found = outcome_of(Fitted(fit_of(), survey()))
    assert list(found.parameters) == [f"k{n}" for n in range(1, 8)]
    assert list(found.payload) == ["m_p", "l1", "l2"]
    k4 = found.parameters["k4"]
    assert k4.estimate == pytest.approx(K4)
    assert k4.unit == "N m"
    assert k4.ci95 == pytest.approx(
        (K4 * (1 - 0.01 * QUANTILE), K4 * (1 + 0.01 * QUANTILE)), rel=1e-12
    )
    assert found.payload["m_p"].std == pytest.approx(0.01 * PAYLOAD, rel=1e-12)
    assert {one.status for one in (found.parameters | found.payload | found.loaded).values()} == {
        Status.OK
    }


def test_rows_of_table_4_are_sums_of_constants_and_their_deviations_are_propagated() -> None:
    """By hand: Tables 1 and 2, and first-order propagation through z = m_p (l1², l2², l1 l2, g l1,
    g l2).
    """
    fit = fit_of()
    rows = table_rows(fit)
    assert list(rows) == [*UNLOADED_ROWS, *LOADED_ROWS]
    stds = {name: one.std for name, one in rows.items()}
    l1, l2, g = ARM.l1, ARM.l2, ARM.g
    unloaded = (K5 + K3, K1, K3, K6, K4, K2)
    m = PAYLOAD
    loaded = (
        K5 + K3 + m * (l1**2 + l2**2),
        K1 + m * l1 * l2,
        K3 + m * l2**2,
        K4 + m * g * l1,
        K2 + m * g * l2,
    )
    found = [one.estimate for one in rows.values()]
    assert found == pytest.approx([*unloaded, *loaded], rel=1e-12)
    assert stds["k5+k3"] == pytest.approx(0.01 * math.hypot(K5, K3), rel=1e-9)
    assert stds["k6"] == pytest.approx(0.01 * K6, rel=1e-9)
    z3 = m * l1 * l2  # moves by a hundredth of itself with each of m_p, l1 and l2
    assert stds["k1+z3"] == pytest.approx(0.01 * math.sqrt(K1**2 + 3 * z3**2), rel=1e-9)
    z2 = m * l2**2  # twice as far with l2
    assert stds["k3+z2"] == pytest.approx(0.01 * math.sqrt(K3**2 + z2**2 + (2 * z2) ** 2), rel=1e-9)


def test_rows_of_what_the_logs_leave_open_are_unknown() -> None:
    rows = table_rows(with_stds(fit_of(), k6=np.inf, m_p=np.inf))
    assert rows["k6"].estimate is None
    assert rows["k4"].estimate == pytest.approx(K4)
    assert list(table_rows(fit_of(payload=False))) == [*UNLOADED_ROWS]
    for fit in (fit_of(prior=without(None, ("k2", "k4"))), fit_of(gravity=0.0)):
        lost = {name for name, row in table_rows(fit).items() if row.estimate is None}
        assert lost == {"k2", "k4", "k2+z5", "k4+z4"}


def test_a_bound_broken_by_far_spoils_every_estimate_and_one_broken_by_chance_none() -> None:
    for k6, status in ((-2.9, Status.OK), (-3.2, Status.IMPLAUSIBLE)):
        fit = with_stds(with_values(fit_of(), k6=k6), k6=1.0)
        found = outcome_of(Fitted(fit, survey()))
        assert {one.status for one in (found.parameters | found.payload).values()} == {status}
        assert [one.bound for one in found.fit.broken_bounds] == ["k6 >= 0"]


def test_the_covariance_is_null_where_a_parameter_is_open() -> None:
    fit = with_stds(fit_of(), k3=np.inf)
    found = summed(fit).covariance
    place = fit.names.index("k3")
    for row, values in enumerate(found):
        for column, value in enumerate(values):
            expected = None if place in (row, column) else fit.covariance[row, column]
            assert value == (None if expected is None else pytest.approx(expected))


def test_each_log_tells_its_own_estimates() -> None:
    """A log whose information is 4e8 on every coefficient but the last, on which it is none."""
    size, c0 = 7, K
    S = np.tile(np.diag([4e8] * 6 + [0.0]), (1, 1, 1))
    g = np.array([[2e4, *[0.0] * 6]])  # the most likely k1 lies 2e4 / 4e8 further
    fit = replace(
        fit_of(), logs=(LogInformation(False, c0, S, g), information(size, loaded=True, c0=c0))
    )
    own, _ = summed(fit).by_log
    assert own["k1"].estimate == pytest.approx(K1 + 5e-5, rel=1e-9)
    assert own["k1"].std == pytest.approx(5e-5, rel=1e-6)
    assert own["k1"].ci95 == pytest.approx(
        (K1 + 5e-5 * (1 - QUANTILE), K1 + 5e-5 * (1 + QUANTILE)), rel=1e-6
    )
    assert own["k7"].status is Status.NOT_IDENTIFIABLE
    assert own["k7"].estimate is None


def test_a_prediction_without_samples_is_none_and_others_hold_their_sums() -> None:
    assert prediction(NOTHING) is None
    rows = np.array([[0.0, 50.0], [400.0, 125.0], [0.0, 0.0], [4.0, 9.0]])
    moved = np.full((1, 2), 100.0)
    found = prediction(np.concatenate([rows, moved, np.zeros((4, 2))]))
    assert found.rmse == pytest.approx((0.2, 0.3))
    assert found.nrmse == pytest.approx((0.1, math.sqrt(9 / 125)))
    # 125 − 50²/100 = 100 is the variance left to explain
    assert found.r2 == pytest.approx((0.99, 0.91))


def found(fit: Fit, code: str) -> list[Notice]:
    return [one for one in remarks(Fitted(fit)) if one.code == code]


def test_a_good_fit_is_passed_over_in_silence() -> None:
    assert list(remarks(Fitted(fit_of()))) == []


def test_a_payload_near_zero_is_at_most_the_end_of_its_interval() -> None:
    for mass in (0.1, -0.2):
        fit = with_stds(with_values(fit_of(), m_p=mass), m_p=0.1)
        assert [one.numbers["most"] for one in found(fit, "NO_PAYLOAD")] == [
            pytest.approx(mass + 0.1 * QUANTILE)
        ]
    assert not found(with_stds(with_values(fit_of(), m_p=0.26), m_p=0.1), "NO_PAYLOAD")
    lost = with_stds(fit_of(), m_p=np.inf)
    assert found(lost, "LENGTHS_NEEDED")
    assert not found(with_stds(fit_of(lengths={"l1": ARM.l1}), m_p=np.inf), "LENGTHS_NEEDED")


def test_torques_whose_gains_differ_are_told_by_as_much_as_without_a_prior() -> None:
    """The prior of a shrunk gain draws it to nothing: the logs say 0.1."""
    prior = Prior(("gain2",), np.zeros(1), np.array([[1e9]]))
    shrunk = with_values(fit_of(terms=("gain",), prior=prior, shrinkage=prior), gain2=1e-3)
    (one,) = found(shrunk, "TORQUE_GAIN")
    assert one.numbers["ratio"] == pytest.approx(1.1)


@pytest.mark.parametrize(("deviations", "named"), [(100.0, True), (2.0, False)])
def test_a_payload_far_below_zero_means_that_the_logs_are_exchanged(
    deviations: float, named: bool
) -> None:
    fit = with_values(fit_of(), m_p=-0.01 * PAYLOAD * deviations)
    found = of_codes(outcome_of(Fitted(fit, survey())).notices, "LOGS_APART")
    assert [one.numbers["case"] for one in found] == ["exchanged"] * named


def test_a_length_that_the_constants_contradict_is_named() -> None:
    """g k1 / k2 is l1 by Table 1, here uncertain by √2 %."""
    std = 0.01 * math.sqrt(2) * ARM.l1
    for times, told in ((0.99 * ACCUSED, False), (1.01 * ACCUSED, True)):
        fit = fit_of(payload=False, lengths={"l1": ARM.l1 + times * std})
        assert bool(found(fit, "LENGTH_CONTRADICTED")) is told
    (one,) = found(fit, "LENGTH_CONTRADICTED")
    given = ARM.l1 + 1.01 * ACCUSED * std
    assert {name: one.numbers[name] for name in ("estimate", "half", "given", "distance")} == (
        pytest.approx(
            {
                "estimate": ARM.l1,
                "half": QUANTILE * std,
                "given": given,
                "distance": 1.01 * ACCUSED,
            }
        )
    )
    assert one.numbers["p_value"] == pytest.approx(2 * norm.sf(1.01 * ACCUSED))


def test_repeatability_and_a_gain_of_one_are_told_in_numbers() -> None:
    repeated = Repeatability(masses=[0.5, 0.51234], std=0.0087, ci95=(0.0039, 0.28))
    gain = Estimate(estimate=1.02, std=0.01, ci95=(1.0, 1.04), unit="1")
    summary = FitSummary(
        noise={}, covariance_names=[], covariance=[], iterations=0, converged=True,
        intervals="likelihood", repeatability=repeated, torque_gain=gain,
        torque_hold=TorqueHold(asked="auto", used="foh", half=5e-3, faster=True),
    )  # fmt: skip
    told = {one.key: one for one in fit_notes(summary)}
    assert told["REPEATABILITY:payload"].text == (
        "the loaded runs by themselves weigh 0.5, 0.5123 kg: repeatability 0.0087 kg (95 %: "
        "0.0039 to 0.28)"
    )
    assert told["TORQUE_GAIN:known"].note
    assert told["TORQUE_HOLD:fast controller"].sentence.endswith(
        "half of the controller's period, in s: --set delay=VALUE; for a torque that is not held: "
        "--torque-hold foh"
    )


def test_a_known_payload_gives_the_torques_gain_with_the_ends_of_its_interval() -> None:
    """A weight of which the arm says 0.5 kg and the scales 0.51: the gain is 1.02."""
    fit = with_stds(with_values(fit_of(), m_p=0.5), m_p=0.01)
    gain = summed(fit, payload_mass=0.51).torque_gain
    assert gain is not None
    assert gain.estimate == pytest.approx(1.02)
    half = 0.01 * QUANTILE
    assert gain.ci95 == pytest.approx((0.51 / (0.5 + half), 0.51 / (0.5 - half)))


def test_cross_validation_that_could_not_be_done_is_told() -> None:
    outcome = outcome_of(Fitted(fit_of(), survey(), Settings(cross_validate=True)))
    assert [one.code for one in outcome.notices] == ["SHORT_LOG"]


def test_an_interval_that_contains_zero_is_never_ok() -> None:
    """By the quantile of the fit, also of an inertia, a length, and the loaded arm's sums."""
    wide = {"k3": 0.1, "k6": 0.1, "l2": 0.1, "m_p": 0.1}
    for std, status in ((1.01, Status.NOT_SIGNIFICANT), (0.99, Status.OK)):
        stds = {name: std * value / QUANTILE for name, value in wide.items()}
        fit = with_stds(with_values(fit_of(), **wide), **stds)
        outcome = outcome_of(Fitted(fit, survey()))
        every = outcome.parameters | outcome.payload | outcome.loaded
        assert {every[name].status for name in wide} == {status}
        assert every["k4"].status is Status.OK
        for one in every.values():
            low, high = one.ci95 or (None, None)
            assert (one.status is Status.OK) is not (low <= 0 <= high)


def test_that_what_is_only_rounding_is_zero_and_can_be_read_back() -> None:
    """A term that its prior holds at nothing comes out as 1e-31, by which nobody can divide."""
    found = estimate(-8.9628e-31, 0.1, 0.2, "N m", "OK")
    assert found.estimate == 0.0
    assert found.ci95 == (-0.2, 0.2)
    assert estimate(2e-30, 1e-31, 0.2, "N m", "OK").estimate == 2e-30
    assert estimate(2e-30, 1e-31, 0.2, "N m", "OK").std == 0.0
