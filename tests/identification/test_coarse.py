"""Logs whose arm turns far from sample to sample, identified without a flag."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from algid.estimators.coarse_likelihood import turns_far
from algid.identification import coarse
from algid.identification.identify import identify
from algid.log import Log
from algid.results import Result
from algid.signals.segments import segments
from pipelines import real_arms
from pipelines.accuracy_hold import scene
from pipelines.real_arms import Errors

RATE = 100
ARM = 11


@cache
def _scenes(errors: Errors) -> tuple[real_arms.Scene, ...]:
    return tuple(real_arms.campaigns(errors, [ARM], 1, 1)[ARM])


def _log(one: real_arms.Scene, seed: int) -> Log:
    """Every tenth sample of a simulated kilohertz, with noise."""
    step = round(real_arms.RATE) // RATE
    theta, tau = one.theta[:, ::step], one.tau[:, ::step]
    rng = np.random.default_rng(seed)
    theta = theta + real_arms.SIGMA_THETA * rng.standard_normal(theta.shape)
    tau = tau + real_arms.SIGMA_TAU * rng.standard_normal(tau.shape)
    return Log.from_arrays(np.arange(theta.shape[1]) / RATE, theta, tau)


def _z(result: Result, truth: dict[str, float]) -> Iterator[float]:
    for name, true in truth.items():
        found = {**result.parameters, **result.payload}.get(name)
        if found is not None and found.estimate is not None and found.std is not None:
            yield (found.estimate - true) / found.std


@pytest.mark.parametrize("held", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_fifty_hertz_show_the_hold_and_no_term_that_is_not_there(held: bool) -> None:
    here = scene("50", held, 302)
    result = identify(here.log(np.random.default_rng([1, held])), report=False)
    assert result.fit is not None
    hold = result.fit.torque_hold
    assert hold is not None
    assert (hold.used, hold.told) == ("zoh" if held else "foh", True)
    assert set(result.parameters) == {f"k{number}" for number in range(1, 8)}
    truth = dict(zip(result.parameters, here.arm.constants().tolist(), strict=True))
    z = list(_z(result, truth))
    assert len(z) == 7
    assert np.sqrt(np.mean(np.square(z))) < 1.85  # χ² of 7: one of a thousand


@pytest.mark.slow
def test_a_payload_and_terms_are_found_at_a_hundred_hertz() -> None:
    errors = Errors(coulomb=0.03, offset=0.03)
    bare, burdened = _scenes(errors)
    result = identify(_log(bare, 1), _log(burdened, 2), report=False)
    assert result.estimator == "refined"
    assert {"f1", "f2", "o1", "o2"} <= set(result.parameters)
    z = list(_z(result, bare.truth))
    assert len(z) == 10
    assert np.sqrt(np.mean(np.square(z))) < 2.0
    assert result.payload["m_p"].std is not None
    assert result.payload["m_p"].std < 2e-3 * bare.payload


@pytest.mark.slow
def test_gaps_leave_out_what_they_must() -> None:
    here = scene("50", True, 302)
    log = here.log(np.random.default_rng([7]))
    t = log.t
    kept = ~(((t > 3) & (t < 3.5)) | ((t > 11) & (t < 14)))
    gapped = Log.from_arrays(t[kept], log.theta[:, kept], log.tau[:, kept])
    result = identify(gapped, report=False)
    truth = dict(zip(result.parameters, here.arm.constants().tolist(), strict=True))
    z = list(_z(result, truth))
    assert result.estimator == "refined"
    assert np.sqrt(np.mean(np.square(z))) < 1.85


@pytest.mark.slow
def test_where_the_exact_likelihood_is_refuted_all_is_as_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A torque that no sensor sees, a third of the other."""
    bare, _ = _scenes(Errors(push=0.3))
    log = _log(bare, 3)
    found = identify(log, report=False)
    monkeypatch.setattr(coarse, "turns_far", lambda _: False)
    before = identify(log, report=False)
    assert found.parameters == before.parameters
    assert found.estimator == before.estimator != "refined"


def test_a_slow_motion_is_left_to_the_stencil() -> None:
    """Both joints at 0.5 Hz by a radian, 50 times a second."""
    t = np.arange(500) / 50
    theta = np.stack([np.sin(np.pi * t), np.cos(np.pi * t)])
    assert not turns_far(segments([Log.from_arrays(t, theta, theta)]))
