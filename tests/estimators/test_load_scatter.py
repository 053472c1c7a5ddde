"""What friction by load may be in proportion to is in the error bars, where the model fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import shrunk, weak
from algid.estimators.fit import Fit
from algid.estimators.load_scatter import widened
from algid.estimators.weak import Source, WeakSettings
from algid.model import Model, loads_of
from algid.signals.segments import Segment

from .conftest import Bench

BY_LOAD = Model(terms=("coulomb", "load"), coulomb_speed=0.05)
BY_TORQUE = replace(BY_LOAD, by_torque=True)
DRY, SHARE = np.array([[0.02], [0.02]]), 0.05
NAMES = ("k1", "k2", "k3", "k4", "k5")


def source_of(log: Segment) -> Source:
    return lambda: [log]


def geared(bench: Bench, sigma: float = 1e-5) -> Source:
    """A log of gears that rub by all the torque that passes, dry and viscous friction included."""
    log = bench.log(sigma=sigma)
    assert log.omega is not None
    sign = np.tanh(log.omega / BY_LOAD.coulomb_speed)
    passing = log.tau + DRY * sign
    return source_of(replace(log, tau=passing + SHARE * np.abs(passing) * sign))


def refitted(source: Source, model: Model) -> Fit:
    return weak.fit([source], (), WeakSettings(model=model))


def constants(fit: Fit) -> FloatArray:
    return fit.values[[fit.names.index(name) for name in NAMES]]


def test_friction_by_all_torque_looks_like_a_gain_where_it_is_taken_for_friction_by_load(
    bench: Bench,
) -> None:
    source = geared(bench)
    by_torque, by_load = (refitted(source, model) for model in (BY_TORQUE, BY_LOAD))
    truth = bench.truth[:5]
    assert constants(by_torque) == pytest.approx(truth, rel=2e-3)
    too_large = constants(by_load) / truth - 1
    assert np.all(too_large > 5e-3), too_large


def test_the_error_bars_hold_either_friction(bench: Bench) -> None:
    source = geared(bench)
    fit = refitted(source, BY_LOAD)
    found = widened(fit, lambda model: refitted(source, model))
    moved = refitted(source, BY_TORQUE).values - fit.values
    assert found.covariance - fit.covariance == pytest.approx(np.outer(moved, moved))
    assert np.array_equal(found.values, fit.values)
    places = [found.names.index(name) for name in NAMES]
    away = np.abs(constants(found) - bench.truth[:5])
    assert np.max(away / fit.std[places]) > 3
    assert np.max(away / found.std[places]) < 1.96


def test_a_model_without_friction_by_load_stays_as_it_is(bench: Bench) -> None:
    source = source_of(bench.log(sigma=1e-4))
    fit = refitted(source, Model(terms=("coulomb",)))
    assert widened(fit, lambda _: pytest.fail("nothing to compare")) is fit


def test_what_is_not_identifiable_moves_nothing(bench: Bench) -> None:
    source = geared(bench)
    fit = refitted(source, BY_LOAD)
    open_ = replace(fit, status=("NOT_IDENTIFIABLE", *fit.status[1:]))
    found = widened(open_, lambda model: refitted(source, model), fit)
    grown = found.covariance - fit.covariance
    assert not grown[0].any()
    assert grown[1, 1] > 0


def test_shrunk_terms_move_too(bench: Bench) -> None:
    source = geared(bench)

    def refit(model: Model) -> Fit:
        return shrunk.fit([source], (), WeakSettings(model=model))

    fit = refit(BY_LOAD)
    place = fit.names.index("k5")
    assert widened(fit, refit, fit).std[place] > fit.std[place]


def test_a_payload_is_no_friction() -> None:
    assert loads_of(BY_TORQUE) == loads_of(BY_LOAD) == ("k1", "k2", "k3", "k4", "k5")
