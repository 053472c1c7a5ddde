"""How a log tells a held torque, and what stands where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators.hold import SURE, Lateness

HALF = 5e-4


@pytest.mark.parametrize("share", [0.05, 0.2, 1 / 3, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("true", [0.0, HALF])
def test_a_wrong_hold_is_taken_in_less_than_one_of_a_hundred_logs(
    share: float, true: float
) -> None:
    """Whatever the logs know: errors of a third of half a sample are the worst."""
    std = share * HALF
    drawn = true + std * np.random.default_rng(5).standard_normal(20_000)
    found = [Lateness(float(one), std, HALF) for one in drawn]
    wrong = "foh" if true else "zoh"
    assert np.mean([one.decided and one.hold == wrong for one in found]) < 0.01


@pytest.mark.parametrize("share", [0.05, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("true", [0.0, HALF])
def test_the_prior_of_both_makes_errors_as_large_as_it_says(share: float, true: float) -> None:
    """For a normal likelihood of deviation s: RMS error of the posterior over its deviation."""
    std = share * HALF
    drawn = true + std * np.random.default_rng(6).standard_normal(20_000)
    prior = Lateness(0.0, std, HALF).prior
    precision = std**-2 + float(prior.precision[0, 0])
    mean = (drawn * std**-2 + float(prior.mean[0] * prior.precision[0, 0])) / precision
    z = (mean - true) * np.sqrt(precision)
    # of 20,000 draws the RMS scatters by 0.5 %
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(z) < 1.96) > 0.945


def test_half_a_sample_that_moves_nothing_is_left_alone() -> None:
    late = Lateness(0.0, 10 * HALF, HALF, effect=0.05 / HALF)
    assert late.share == pytest.approx(0.05)
    assert abs(late.odds) < SURE
    assert late.decided
    assert late.hold == "foh"


@pytest.mark.parametrize(("late", "least"), [(0.0, 0.95), (5e-4, 0.95), (1e-3, 0.88)])
def test_where_a_faster_controller_may_hold_the_torque_the_error_is_within_what_is_said(
    late: float, least: float
) -> None:
    """Of no controller, one of 1 kHz and one of 500 Hz, in logs of 100 Hz that tell as much.

    That of 500 Hz is one and a half of the prior's deviations off: 0.9 hold it.
    """
    std = 5e-4
    drawn = late + std * np.random.default_rng(8).standard_normal(20_000)
    found = [Lateness(float(one), std, 5e-3, effect=1e3) for one in drawn]
    faster = [one for one in found if one.faster]
    assert len(faster) > 0.98 * len(found)
    assert not any(one.determined for one in faster)
    prior = faster[0].prior
    weight = float(prior.precision[0, 0])
    estimates = np.array([one.late for one in faster])
    mean = (estimates * std**-2 + prior.mean[0] * weight) / (std**-2 + weight)
    assert np.mean(np.abs(mean - late) * np.sqrt(std**-2 + weight) < 1.96) > least


@pytest.mark.parametrize(
    ("half", "effect"),
    [(5e-4, 1e3), (5e-3, 1e2), (5e-3, np.inf)],
    ids=["fast log", "no difference", "not compared"],
)
def test_no_faster_controller_is_thought_of_where_it_cannot_matter(
    half: float, effect: float
) -> None:
    assert not Lateness(0.0, 0.1 * half, half, effect).faster
