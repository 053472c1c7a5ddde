"""How a log tells a held torque, and what stands where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators.hold import SURE, Lateness

HALF, SHARES = 5e-4, (0.05, 0.3, 1.0, 4.0)


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


@pytest.mark.parametrize(
    ("std", "true", "half", "effect", "least"),
    [
        *((share * HALF, true, HALF, np.inf, 0.945) for share in SHARES for true in (0.0, HALF)),
        # A controller that is faster than logs of 100 Hz: none, one of 1 kHz and one of 500 Hz,
        # which is one and a half of the prior's deviations off, so that 0.9 hold it.
        *(
            (5e-4, late, 5e-3, 1e3, least)
            for late, least in ((0, 0.95), (5e-4, 0.95), (1e-3, 0.88))
        ),
    ],
)
def test_the_prior_of_both_makes_errors_as_large_as_it_says(
    std: float, true: float, half: float, effect: float, least: float
) -> None:
    """For a normal likelihood of deviation s: errors of the posterior over its deviation."""
    drawn = true + std * np.random.default_rng(8).standard_normal(20_000)
    found = [Lateness(float(one), std, half, effect=effect) for one in drawn]
    if faster := np.isfinite(effect):
        found = [one for one in found if one.faster]
        assert len(found) > 0.98 * drawn.size
        assert not any(one.determined for one in found)
    prior = found[0].prior
    weight = float(prior.precision[0, 0])
    mean = (np.array([one.late for one in found]) * std**-2 + prior.mean[0] * weight) / (
        std**-2 + weight
    )
    z = (mean - true) * np.sqrt(std**-2 + weight)
    # of 20,000 draws the RMS scatters by 0.5 %
    assert faster or np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(z) < 1.96) > least


def test_half_a_sample_that_moves_nothing_is_left_alone() -> None:
    late = Lateness(0.0, 10 * HALF, HALF, effect=0.05 / HALF)
    assert late.share == pytest.approx(0.05)
    assert abs(late.odds) < SURE
    assert late.decided
    assert late.hold == "foh"


@pytest.mark.parametrize(
    ("half", "effect"),
    [(5e-4, 1e3), (5e-3, 1e2), (5e-3, np.inf)],
    ids=["fast log", "no difference", "not compared"],
)
def test_no_faster_controller_is_thought_of_where_it_cannot_matter(
    half: float, effect: float
) -> None:
    assert not Lateness(0.0, 0.1 * half, half, effect).faster
