"""Endogenous torques and feedback are told apart, and each has the estimate or the warning that it
needs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.significance import LEVEL
from algid.estimators import exogeneity, instruments, shrunk
from algid.estimators.exogeneity import ANSWERS, _crossed
from algid.estimators.fit import Fit
from algid.estimators.weak import Source, WeakSettings
from algid.signals.segments import Segment
from pipelines.disturbed import DT, NAMES, Scene, scene

SETTINGS = WeakSettings(bandwidth=60.0)


def coloured(rng: np.random.Generator, keep: float, count: int) -> FloatArray:
    """Two autoregressions (2, N) of unit variance."""
    made = rng.standard_normal((2, count))
    for place in range(1, count):
        made[:, place] = keep * made[:, place - 1] + np.sqrt(1 - keep**2) * made[:, place]
    return made


def test_the_variance_of_a_cross_correlation_is_that_of_independent_series() -> None:
    """Bartlett's: of 400 pairs of independent autoregressions of 0.8 and 0.9, each sum over its
    deviation.
    """
    rng = np.random.default_rng(7)
    found = []
    for _ in range(200):
        products, variance = _crossed(coloured(rng, 0.8, 400), coloured(rng, 0.9, 400))
        found.append(products[2] / np.sqrt(variance))
    spread = float(np.sqrt(np.mean(np.square(found))))
    assert 0.8 < spread < 1.2  # 400 values of ± 4 %, and variances from 400 samples


def sources_of(made: Scene, *, reference: bool = False) -> list[Source]:
    asked = made.reference if reference and made.reference is not None else [None] * len(made.tau)
    logs = [
        Segment(0.0, DT, theta, tau, reference=one)
        for theta, tau, one in zip(made.theta, made.tau, asked, strict=True)
    ]

    def source(log: Segment) -> Source:
        return lambda: [log]

    return [source(log) for log in logs[:4]]


def settled(made: Scene, *, reference: bool = False) -> tuple[Fit, Fit]:
    """By least squares, and what stands in the end."""
    sources = sources_of(made, reference=reference)
    least = shrunk.fit(sources, (), SETTINGS)
    return least, exogeneity.settled(least, sources, (), SETTINGS)


def off(fit: Fit, made: Scene) -> FloatArray:
    """Errors of k1 … k5 in half widths of their intervals."""
    places = [fit.names.index(name) for name in NAMES]
    truth = made.arm.constants()[:5]
    return np.abs(fit.values[places] - truth) / (fit.quantile * fit.std[places])


@pytest.mark.slow
def test_instruments_stand_where_the_torque_is_endogenous_and_answers_nothing() -> None:
    made = scene(1, feedback=False)
    least, found = settled(made)
    assert off(least, made).max() > 1
    assert found.estimator == "instruments"
    assert off(found, made).max() < 1
    assert [note.code for note in found.notes] == ["INSTRUMENTS"]


@pytest.mark.slow
def test_feedback_is_said_and_leaves_least_squares() -> None:
    """The logged torque of a PD controller is no instrument."""
    made = scene(1, feedback=True)
    least, found = settled(made)
    assert found.values == pytest.approx(least.values)
    assert [note.code for note in found.notes] == ["FEEDBACK"]
    by_instruments = exogeneity.instrumented(least, least.values, sources_of(made), (), SETTINGS)
    assert by_instruments is not None
    watched = exogeneity.watched(by_instruments, sources_of(made), (), SETTINGS)
    assert [note.code for note in watched.notes] == ["FEEDBACK"]


@pytest.mark.slow
def test_a_reference_is_the_instrument_under_feedback() -> None:
    """The same logs with the reference that the controller follows: no warning, and closer."""
    made = scene(1, feedback=True)
    least, found = settled(made, reference=True)
    assert found.estimator == "instruments"
    assert [note.code for note in found.notes] == ["INSTRUMENTS"]
    assert off(found, made).max() < 1
    assert off(found, made)[0] < 0.5 * off(least, made)[0]  # k1 is attenuated most
    sources = sources_of(made, reference=True)
    assert exogeneity.watched(found, sources, (), SETTINGS).notes == found.notes  # no warning
    asked = instruments.fit(sources_of(made, reference=True), settings=SETTINGS)
    by_torque = instruments.fit(sources_of(made), settings=SETTINGS)
    truth = made.arm.constants()[:5]
    error, worse = (np.abs(fit.values[:5] / truth - 1).mean() for fit in (asked, by_torque))
    assert error < 0.5 * worse


@pytest.mark.slow
def test_an_arm_without_unmodelled_torque_keeps_least_squares() -> None:
    made = scene(2, feedback=True, share=0.0)
    least, found = settled(made)
    assert found.notes == ()
    assert found.values == pytest.approx(least.values)
    assert found.endogeneity is not None


def test_unloaded_logs_alone_are_compared() -> None:
    """Without loaded logs there is no payload whose coefficients to ask for."""
    made = scene(2, feedback=True, share=0.0)
    log = Segment(0.0, DT, made.theta[0], made.tau[0]).part(0, 1500)
    sources: list[Source] = [lambda: [log]]
    least = shrunk.fit(sources, (), SETTINGS)
    found = exogeneity.instrumented(least, least.values, sources, (), SETTINGS)
    assert found is not None
    assert found.names == least.names


def test_both_conditions_are_asked() -> None:
    far = exogeneity.Exogeneity(distance=5.0, moved=2.0, same=LEVEL / 2, silent=1.0)
    assert far.endogenous
    assert not far.answers
    assert not replace(far, moved=0.9).endogenous
    assert not replace(far, same=2 * LEVEL).endogenous
    assert replace(far, silent=ANSWERS / 2).answers
